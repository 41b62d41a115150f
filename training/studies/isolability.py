"""Which faults can be isolated from which, at which speed, and by which sensor.

Run ``python -m training.studies.isolability``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.faults import CATALOGUE, NORMAL, known_classes
from auv_fault_env.missions import MISSIONS, Mission, mission_of
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.schedules import FaultEvent
from training.bounds import active_ceiling, cramer_rao
from training.bounds.delays import late_rate
from training.bounds.information import (
    Lanes,
    faults_by_class,
    log_likelihoods_unknown_severity,
    simulate_lanes,
)
from training.bounds.structural_isolability import isolability_tables
from training.seeds import seeds
from training.stimuli import Cruise
from training.studies.isolability_page import page
from training.studies.run import command_line, run_study

SEVERITY = 0.6
# s
ONSET = 5.0
CONSTANT_SPEEDS = (0.15, 0.3, 0.45, 0.6)
CONDITIONS = {f"{speed:g} m/s": mission_of(speed) for speed in CONSTANT_SPEEDS}
CONDITIONS |= {"thesis": MISSIONS["thesis"]}
SURGE_SENSORS = ("speed", "acceleration")
# factor on the noise of a sensor that carries no information
UNINFORMATIVE_NOISE = 1e6
# within the seeds of tests
FIRST_SEED = 800_000_000
N_CRAMER_RAO = 300


@dataclass(frozen=True)
class Isolability:
    """Measure rates of evidence for every class against every other, and what each sensor adds."""

    output: Path = Path("runs/isolability")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 10
    """Vehicles for each class and condition; the faults of a class take turns."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: Isolability) -> None:
    """Measure rates of evidence, and write results and page."""
    finite_in_range("vehicles", arguments.vehicles, 1, 10_000)
    finite_in_range("seed", arguments.seed, 0, 50_000_000)

    def study(_folder: Path) -> dict[str, Any]:
        return isolability(arguments.vehicles, arguments.seed)

    run_study("isolability", arguments, study)


def isolability(vehicles: int, seed: int) -> dict[str, Any]:
    """All results as plain data, and the sections of the page made from them."""
    rates: dict[str, Any] = {}
    band_rates: dict[str, Any] = {}
    ceilings: dict[str, Any] = {}
    with tqdm(total=len(CONDITIONS) + len(active_ceiling.FAULTS), unit="part") as bar:
        for name, mission in CONDITIONS.items():
            bar.set_postfix_str(name)
            lanes = faulty_lanes(mission, vehicles, seed)
            rates[name] = rate_table(lanes)
            band_rates[name] = rate_table(lanes, knows_vehicle=False)
            bar.update()
        # the lanes of the last condition, the thesis' stimulus
        without = {channel: rate_table(without_sensor(lanes, channel)) for channel in READINGS}
        for fault in active_ceiling.FAULTS:
            bar.set_postfix_str(f"stimulus for {fault}")
            ceilings[fault] = active_ceiling.periodic_ceiling(fault, seed)
            bar.update()
    cramer_rao_seeds = seeds("test", N_CRAMER_RAO, FIRST_SEED + seed)
    results = {
        "rates": rates,
        "band_rates": band_rates,
        "without": without,
        "ceiling": ceilings,
        "cramer_rao": cramer_rao.compare_filters_with_bound(cramer_rao_seeds),
        "structure": isolability_tables(),
        "classes": list(known_classes()),
        "vehicles": vehicles,
        "severity": SEVERITY,
    }
    return results | page(results)


def faulty_lanes(mission: Mission, vehicles: int, seed: int) -> Lanes:
    """Vehicles of every class, normal first, on one mission; the faults of a class take turns."""
    faults = {NORMAL: [next(iter(CATALOGUE))]} | faults_by_class()
    events = []
    for name in known_classes():
        severity = 0.0 if name == NORMAL else SEVERITY
        for k in range(vehicles):
            fault = faults[name][k % len(faults[name])]
            events.append(FaultEvent(fault, ONSET, severity))
    lane_seeds = seeds("test", len(events), FIRST_SEED + seed)
    return simulate_lanes(Cruise(), events, [mission] * len(events), lane_seeds)


def rate_table(lanes: Lanes, knows_vehicle: bool = True) -> list[list[float]]:
    """`evidence_rates` as plain numbers; without `knows_vehicle` only the healthy band is known."""
    log_likelihoods = log_likelihoods_unknown_severity(lanes, knows_vehicle)
    rates = evidence_rates(log_likelihoods, lanes)
    return np.round(rates.astype(float), 4).tolist()


def evidence_rates(log_likelihoods: np.ndarray, lanes: Lanes) -> np.ndarray:
    """Rate [nat/s] of evidence for each class (row) against each other (column).

    It is the `late_rate`, at which evidence continues to grow; the transient of an abrupt onset may
    distinguish classes that are alike later.

    Parameters
    ----------
    log_likelihoods
        With unknown severities, (n_samples, n_lanes, n_known).
    lanes
        Their classes are the true ones; severity 0 is normal.

    Returns
    -------
    rates
        (n_known, n_known).
    """
    true_class = np.where(lanes.severity > 0.0, lanes.diagnosis, 0)
    gain = late_rate(log_likelihoods)
    rows = []
    for k in range(gain.shape[1]):
        own = true_class == k
        rows.append((gain[own, k, None] - gain[own]).mean(axis=0))
    return np.array(rows)


def without_sensor(lanes: Lanes, channel: str) -> Lanes:
    """The same lanes without a sensor, which the bank knows to be missing.

    Motor sensors read zero as if disconnected, and the bank uses the others; speed and acceleration
    are only noise. The likelihoods of the classes remain comparable, except for the faults of the
    missing sensor itself.
    """
    observations = lanes.observations.copy()
    healthy = lanes.healthy.copy()
    names = list(PARAMETERS)
    if channel in SURGE_SENSORS:
        healthy[:, names.index(f"{channel}_noise")] *= UNINFORMATIVE_NOISE
    else:
        observations[:, :, INDEX[channel]] = 0.0
        healthy[:, names.index(f"{channel}_dropout")] = 1.0
    return lanes._replace(observations=observations, healthy=healthy)


if __name__ == "__main__":
    command_line(main)
