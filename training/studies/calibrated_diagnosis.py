"""The diagnosis of calibrated vehicles beside that of known ones.

Run ``python -m training.studies.calibrated_diagnosis``. Vehicles far from the preset are calibrated
on healthy logs; then they have the catalogue's faults, in the episodes of
`training.benchmark.open_loop`. The filter bank diagnoses them with the calibrated parameters, with
the true ones, and with the preset's, and beside them the preset's own vehicle. Score: macro-F1 ten
seconds after onset, as in the benchmark.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, known_name
from auv_fault_env.faults import classes
from auv_fault_env.parameters import PRESETS, Vehicle
from diagnosers import Diagnoser, make
from training.benchmark.assessment import assess
from training.benchmark.open_loop import believed, both_halves, true_of
from training.field.calibration.calibration import calibrate
from training.field.diagnosis.diagnosis import THRESHOLDS, diagnoser_for
from training.metrics import confusion, macro_f1, restricted_mean
from training.metrics.intervals import f1_interval
from training.metrics.records import Record, Truth, concatenate_lanes, healthy_outcome
from training.report.cells import with_interval
from training.report.sections import table_section
from training.seeds import seeds
from training.studies.calibration import sampled_vehicle, simulated_logs
from training.studies.run import command_line, run_study

NAME = "filter_bank"
FIRST_SEED = 720_000_000  # within those of tests
REFERENCE = "the preset's, known"
CALIBRATED = "another, calibrated"
KNOWN = "another, known"
ASSUMED = "another, taken for the preset's"


class VehicleEpisodes(NamedTuple):
    """Beliefs of the bank on one vehicle's faulty and healthy episodes, and the truth."""

    faulty: Record
    faulty_truth: Truth
    healthy: Record
    healthy_truth: Truth


@dataclass(frozen=True)
class DiagnosisStudy:
    """Calibrate vehicles far from the preset and score the filter bank on their faults."""

    output: Path = Path("runs/diagnosis-study")
    """Folder of the results; an earlier run there is replaced."""
    vehicles: int = 20
    """Vehicles, up to 30 % off the preset."""
    lanes: int = 72
    """Faulty episodes of each vehicle; a third as many healthy ones."""
    preset: str = "npsnet1995"
    """Preset around which vehicles are sampled."""
    seed: int = 0
    """Offset within the seeds of tests, and of the vehicles."""


def main(arguments: DiagnosisStudy) -> None:
    """Calibrate, score, and write the results."""
    finite_in_range("vehicles", arguments.vehicles, 1, 10_000)
    finite_in_range("lanes", arguments.lanes, 12, 10_000)
    known_name("preset", arguments.preset, PRESETS)
    run_study("calibrated_diagnosis", arguments, lambda folder: study(arguments))


def study(arguments: DiagnosisStudy) -> dict[str, Any]:
    """Scores by the parameters of the bank, as plain data and as a table."""
    by_case: dict[str, list[VehicleEpisodes]] = {}
    n_lanes = 2 * arguments.lanes
    numbers = range(arguments.seed, arguments.seed + arguments.vehicles)
    for number in tqdm(numbers, unit="vehicle"):
        lanes = seeds("test", n_lanes, FIRST_SEED + n_lanes * number)
        for name, (plant, bank) in cases(PRESETS[arguments.preset], number).items():
            by_case.setdefault(name, []).append(episodes(plant, bank, lanes))
    scores = {name: score(vehicles, arguments.seed) for name, vehicles in by_case.items()}
    ratio = scores[CALIBRATED]["macro_f1"] / scores[REFERENCE]["macro_f1"]
    return {
        "title": "Is a calibrated vehicle diagnosed as well as a known one?",
        "summary": summary(scores, ratio, arguments.vehicles),
        "intro": [],
        "scores": scores,
        "ratio": ratio,
        "sections": [section(scores, ratio, arguments.vehicles)],
    }


def summary(scores: Mapping[str, Mapping[str, Any]], ratio: float, n_vehicles: int) -> list[str]:
    """How much is lost by calibrating, and what not to calibrate would cost."""
    return [
        f"{n_vehicles} vehicles unlike the preset were calibrated and then diagnosed by the "
        "filter bank.",
        f"Their macro-F1 is {100 * ratio:.0f} % of that on the preset; with the true parameters "
        f"it is {scores[KNOWN]['macro_f1']:.3f}, calibrated {scores[CALIBRATED]['macro_f1']:.3f}.",
        f"Without calibration, with the preset's parameters, it is "
        f"{scores[ASSUMED]['macro_f1']:.3f}, with {scores[ASSUMED]['false_alarms']} false alarms "
        f"in {scores[ASSUMED]['hours']:.1f} h.",
    ]


def cases(preset: Vehicle, number: int) -> dict[str, tuple[Vehicle, Diagnoser]]:
    """By case: the vehicle that is simulated, and the bank that diagnoses it."""
    vehicle = sampled_vehicle(preset, number)
    file = calibrate(*simulated_logs(vehicle, number)).vehicle
    return {
        REFERENCE: (preset, make(NAME, vehicle=preset)),
        CALIBRATED: (vehicle, diagnoser_for(NAME, file, {})),
        KNOWN: (vehicle, make(NAME, vehicle=vehicle)),
        ASSUMED: (vehicle, make(NAME, vehicle=preset)),
    }


def episodes(plant: Vehicle, bank: Diagnoser, lanes: range) -> VehicleEpisodes:
    """Faulty and healthy episodes of a vehicle, half of each with the thesis' stimulus."""
    n = len(lanes) // 2
    records = {}
    truths = {}
    for faulty, chosen in ((True, lanes[:n]), (False, lanes[n : n + n // 3])):
        halves = both_halves(chosen, faulty, plant, healthy_band=0.0)
        records[faulty] = believed(bank, halves)
        truths[faulty] = true_of(halves)
    return VehicleEpisodes(records[True], truths[True], records[False], truths[False])


def score(vehicles: Sequence[VehicleEpisodes], seed: int) -> dict[str, Any]:
    """Scores over all vehicles, at the threshold that `auv-fault diagnose` uses."""
    faulty, truth, healthy, healthy_truth = map(concatenate_lanes, zip(*vehicles, strict=True))
    outcome = healthy_outcome(healthy, healthy_truth.onset)
    assessment = assess(THRESHOLDS[NAME], faulty, truth, outcome)
    label = assessment.label
    decision = assessment.decision
    n_classes = len(classes())
    return {
        "macro_f1": float(macro_f1(confusion(label, decision, n_classes))),
        "macro_f1_interval": f1_interval(label, decision, n_classes, seed),
        "isolation": restricted_mean(assessment.isolation),
        "false_alarms": assessment.false_alarms,
        "hours": assessment.hours,
        "episodes": len(label),
    }


def section(
    scores: Mapping[str, Mapping[str, Any]], ratio: float, n_vehicles: int
) -> dict[str, Any]:
    """The table of the scores."""
    rows = [
        [
            name,
            with_interval(score["macro_f1"], score["macro_f1_interval"], 3),
            f"{score['isolation']:.2f}",
            f"{score['false_alarms']} in {score['hours']:.1f} h",
            str(score["episodes"]),
        ]
        for name, score in scores.items()
    ]
    columns = [
        "vehicle and parameters of the bank",
        "macro-F1 at 10 s (95 %)",
        "isolation [s]",
    ]
    heading = f"{n_vehicles} vehicles: macro-F1 calibrated is {ratio:.3f} of that on the preset"
    return table_section(heading, [*columns, "false alarms", "episodes"], rows)


if __name__ == "__main__":
    command_line(main)
