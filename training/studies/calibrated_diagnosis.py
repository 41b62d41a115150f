"""Is a calibrated vehicle diagnosed as well as a known one? ``python -m training.studies.calibrated_diagnosis``.

Vehicles far from the preset are calibrated on healthy logs; then all of the catalogue's faults
befall them, in the episodes of `training.benchmark.open_loop`. The filter bank judges them on the calibrated
parameters, on the true ones, and on the preset's, and beside them the preset's own vehicle. Score:
macro-F1 ten seconds after onset, as in the benchmark.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import tyro
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
from training.report.page import print_tables
from training.report.run_folder import run_folder, write_json
from training.seeds import seeds
from training.studies.calibration import sampled_vehicle, simulated_logs

NAME = "filter_bank"
FIRST_SEED = 720_000_000  # within those of tests
REFERENCE = "the preset's, known"
CALIBRATED = "another, calibrated"
KNOWN = "another, known"
ASSUMED = "another, taken for the preset's"


class Part(NamedTuple):
    """What the bank believed of one vehicle's faulty and healthy episodes, and what was so."""

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
    """Vehicles, drawn up to 30 % off the preset."""
    lanes: int = 72
    """Faulty episodes of each vehicle; a third as many healthy ones."""
    preset: str = "npsnet1995"
    """Preset that the vehicles are drawn around."""
    seed: int = 0
    """Offset within the seeds of tests, and of the vehicles."""


def main(arguments: DiagnosisStudy) -> None:
    """Calibrate, score, and write the results."""
    finite_in_range("vehicles", arguments.vehicles, 1, 10_000)
    finite_in_range("lanes", arguments.lanes, 12, 10_000)
    known_name("preset", arguments.preset, PRESETS)
    with run_folder(arguments.output, "diagnosis-study", arguments) as folder:
        results = study(arguments)
        write_json(folder / "results.json", results)
    print_tables(results["sections"])


def study(arguments: DiagnosisStudy) -> dict[str, Any]:
    """Scores by what the bank knew, as plain data and as a table."""
    parts: dict[str, list[Part]] = {}
    for number in tqdm(range(arguments.seed, arguments.seed + arguments.vehicles), unit="vehicle"):
        lanes = seeds("test", 2 * arguments.lanes, FIRST_SEED + 2 * arguments.lanes * number)
        for name, (plant, bank) in cases(PRESETS[arguments.preset], number).items():
            parts.setdefault(name, []).append(episodes(plant, bank, lanes))
    scores = {name: scored(ones, arguments.seed) for name, ones in parts.items()}
    ratio = scores[CALIBRATED]["macro_f1"] / scores[REFERENCE]["macro_f1"]
    return {"scores": scores, "ratio": ratio, "sections": [section(scores, ratio, arguments)]}


def cases(preset: Vehicle, number: int) -> dict[str, tuple[Vehicle, Diagnoser]]:
    """By what the bank knows: the vehicle that is simulated, and the bank that diagnoses it."""
    vehicle = sampled_vehicle(preset, number)
    file = calibrate(*simulated_logs(vehicle, number)).vehicle
    return {
        REFERENCE: (preset, make(NAME, vehicle=preset)),
        CALIBRATED: (vehicle, diagnoser_for(NAME, file, {})),
        KNOWN: (vehicle, make(NAME, vehicle=vehicle)),
        ASSUMED: (vehicle, make(NAME, vehicle=preset)),
    }


def episodes(plant: Vehicle, bank: Diagnoser, lanes: range) -> Part:
    """Faulty and healthy episodes of a vehicle as the bank sees them, half of each with the thesis' stimulus."""
    n = len(lanes) // 2
    records = {}
    truths = {}
    for faulty, chosen in ((True, lanes[:n]), (False, lanes[n : n + n // 3])):
        halves = both_halves(chosen, faulty, plant, healthy_band=0.0)
        records[faulty] = believed(bank, halves)
        truths[faulty] = true_of(halves)
    return Part(records[True], truths[True], records[False], truths[False])


def scored(parts: Sequence[Part], seed: int) -> dict[str, Any]:
    """Scores over all vehicles, at the threshold that `auv-fault diagnose` uses."""
    faulty, truth, healthy, calm_truth = (
        concatenate_lanes(ones) for ones in zip(*parts, strict=True)
    )
    judged = assess(THRESHOLDS[NAME], faulty, truth, healthy_outcome(healthy, calm_truth.onset))
    n_classes = len(classes())
    return {
        "macro_f1": float(macro_f1(confusion(judged.label, judged.decision, n_classes))),
        "macro_f1_interval": f1_interval(judged.label, judged.decision, n_classes, seed),
        "isolation": restricted_mean(judged.isolation),
        "false_alarms": judged.false_alarms,
        "hours": judged.hours,
        "episodes": len(judged.label),
    }


def section(
    scores: Mapping[str, Mapping[str, Any]], ratio: float, arguments: DiagnosisStudy
) -> dict[str, Any]:
    """The table of the scores."""
    rows = [
        [
            name,
            f"{score['macro_f1']:.3f} ({score['macro_f1_interval'][0]:.3f}–{score['macro_f1_interval'][1]:.3f})",
            f"{score['isolation']:.2f}",
            f"{score['false_alarms']} in {score['hours']:.1f} h",
            str(score["episodes"]),
        ]
        for name, score in scores.items()
    ]
    columns = [
        "vehicle and what the bank knows of it",
        "macro-F1 at 10 s (95 %)",
        "isolation [s]",
        "false alarms",
    ]
    heading = (
        f"{arguments.vehicles} vehicles: macro-F1 calibrated is {ratio:.3f} of that on the preset"
    )
    return {"heading": heading, "table": {"columns": [*columns, "episodes"], "rows": rows}}


if __name__ == "__main__":
    main(tyro.cli(DiagnosisStudy))
