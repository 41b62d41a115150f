"""Which faults can be told from which, at which speed, and by which sensor: ``python -m training.studies.isolability``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.faults import CATALOGUE, NORMAL, classes
from auv_fault_env.missions import MISSIONS, Mission, mission_of
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.schedules import FaultEvent
from training.bounds import active_ceiling, cramer_rao
from training.bounds.delays import late_rate
from training.bounds.information import Lanes, log_likelihoods_unknown_severity, simulate_lanes
from training.bounds.structural_isolability import isolability_tables
from training.seeds import seeds
from training.stimuli import Cruise
from training.studies.isolability_page import page
from training.studies.run import command_line, run_study

SEVERITY = 0.6
ONSET = 5.0
CONDITIONS = {f"{speed:g} m/s": mission_of(speed) for speed in (0.15, 0.3, 0.45, 0.6)} | {
    "thesis": MISSIONS["thesis"]
}
# times the noise: a sensor that tells nothing
SURGE_SENSORS = ("speed", "acceleration")
DEAF = 1e6
FIRST_SEED = 800_000_000  # within those of tests


@dataclass(frozen=True)
class Isolability:
    """Measure at which rate evidence for every class gathers against every other, and what every sensor adds."""

    output: Path = Path("runs/isolability")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 10
    """Vehicles for each class and condition; the kinds of a class take turns."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: Isolability) -> None:
    """Measure, and write report, figures and results."""
    finite_in_range("vehicles", arguments.vehicles, 1, 10_000)
    finite_in_range("seed", arguments.seed, 0, 50_000_000)

    def study(_folder: Path) -> dict[str, Any]:
        return isolability(arguments.vehicles, arguments.seed)

    run_study("isolability", arguments, study)


def isolability(vehicles: int, seed: int) -> dict[str, Any]:
    """All results as plain data, and the page's sections made from them."""
    results: dict[str, Any] = {"rates": {}, "band_rates": {}, "without": {}}
    with tqdm(total=len(CONDITIONS) + len(active_ceiling.FAULTS), unit="part") as bar:
        for name, mission in CONDITIONS.items():
            bar.set_postfix_str(name)
            lanes = faulty_lanes(mission, vehicles, seed)
            results["rates"][name] = _plain(rates(log_likelihoods_unknown_severity(lanes), lanes))
            results["band_rates"][name] = _plain(
                rates(log_likelihoods_unknown_severity(lanes, knows_vehicle=False), lanes)
            )
            bar.update()
        results["without"] = {
            channel: _plain(rates(log_likelihoods_unknown_severity(without(lanes, channel)), lanes))
            for channel in READINGS
        }
        results["ceiling"] = {}
        for fault in active_ceiling.FAULTS:
            bar.set_postfix_str(f"stimulus for {fault}")
            results["ceiling"][fault] = active_ceiling.periodic_ceiling(fault, seed)
            bar.update()
    results["cramer_rao"] = cramer_rao.compare_filters_with_bound(
        seeds("test", 300, FIRST_SEED + seed)
    )
    results["structure"] = isolability_tables()
    results |= {"classes": list(classes()), "vehicles": vehicles, "severity": SEVERITY}
    results["command"] = (
        f"python -m training.studies.isolability --vehicles {vehicles} --seed {seed}"
    )
    return results | page(results)


def faulty_lanes(mission: Mission, vehicles: int, seed: int) -> Lanes:
    """Vehicles of every class, normal first, on one mission; the kinds of a class take turns."""
    events = []
    for name in classes():
        kinds = [fault.name for fault in CATALOGUE.values() if fault.diagnosis == name] or [
            next(iter(CATALOGUE))
        ]
        severity = 0.0 if name == NORMAL else SEVERITY
        events += [FaultEvent(kinds[k % len(kinds)], ONSET, severity) for k in range(vehicles)]
    return simulate_lanes(
        Cruise(), events, [mission] * len(events), seeds("test", len(events), FIRST_SEED + seed)
    )


def rates(paths: np.ndarray, lanes: Lanes) -> np.ndarray:
    """Rate [nat/s] at which evidence for each class (row) gathers against each other (column), (n_classes, n_classes).

    Of likelihoods (n_samples, n_lanes, n_classes) over severities that are not known. It is that in
    which evidence goes on gathering, `late_rate`; the shock of an abrupt onset may tell classes
    apart that are alike thereafter.
    """
    of_lane = np.where(lanes.severity > 0.0, lanes.diagnosis, 0)
    gained = late_rate(paths)
    return np.array(
        [
            (gained[of_lane == k, k, None] - gained[of_lane == k]).mean(axis=0)
            for k in range(paths.shape[2])
        ]
    )


def without(lanes: Lanes, channel: str) -> Lanes:
    """The same lanes without a sensor, and a bank told of them knows that it is missing.

    Motor sensors read zero, as if disconnected, and the bank does with the others; those of surge
    are nothing but noise. The classes' likelihoods are comparable but for that of the missing
    sensor's own faults.
    """
    observations = lanes.observations.copy()
    healthy = lanes.healthy.copy()
    names = list(PARAMETERS)
    if channel in SURGE_SENSORS:
        healthy[:, names.index(f"{channel}_noise")] *= DEAF
    else:
        observations[:, :, INDEX[channel]] = 0.0
        healthy[:, names.index(f"{channel}_dropout")] = 1.0
    return lanes._replace(observations=observations, healthy=healthy)


def _plain(matrix: np.ndarray) -> list[list[float]]:
    return np.round(matrix.astype(float), 4).tolist()


if __name__ == "__main__":
    command_line(main)
