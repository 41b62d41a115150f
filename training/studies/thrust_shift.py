"""Whether thrust shifted between the sides shows faults sooner, and at which cost.

Run ``python -m training.studies.thrust_shift``. Rates of evidence at 1 ft/s under excitations of
the speed and of the thrust, and isolation times of `filter_bank` with rules that shift the thrust.
In its results an excitation has offset, shift, alternates, family, strength, cost, saving and
rates: by severity and fault, those of `training.bounds.thrust_shift.Rate`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, whole_number
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training.benchmark.suites import STANDARD, Conditions, Episode, load
from training.benchmark.trials import run_closed_loop
from training.bounds.delays import right_for_good
from training.bounds.thrust_shift import (
    Excitation,
    cost,
    evidence_rates,
    faulty_vehicles,
    offset_of_energy,
)
from training.metrics import sample_at
from training.metrics.intervals import interval, paired_bootstrap
from training.metrics.records import HORIZON
from training.seeds import seeds
from training.stimuli import BUDGET, STIMULI, Stimulus
from training.studies.run import command_line, run_study
from training.studies.thrust_shift_page import page

# of the sides both for one fault, the starboard one to show thrust away from the fault
FAULTS = (
    *("increased_drag", "decreased_drag"),
    *("propeller_damage:port", "propeller_damage:starboard", "propeller_loss:port"),
    *("seal_friction:port", "motor_overheating:port", "sensor_scale:speed"),
)
SEVERITIES = (0.3, 0.6)
# what the likelihoods know of the healthy vehicle
KNOWLEDGE = {"the vehicle": True, "the healthy band": False}
DEPTHS = (0.1, 0.2, 0.4, 0.8)
OFFSETS = (0.02, 0.05, BUDGET)  # m/s
FASTER = "faster"
WAVE = "speed wave"
ALTERNATING = "shift, alternating"
TO_PORT = "shift, to port"
# the shift whose energy a change of speed gets as well
COMPARED_DEPTH = 0.4
SAME_ENERGY = f"energy of a shift of {COMPARED_DEPTH:g}"
# the closed loop: onset [s] and severity of abrupt faults, diagnoser, stimuli with their budgets
LOOP_ONSET = (10.0, 20.0)
LOOP_SEVERITY = (0.2, 1.0)
# the faults that a shift shows sooner at a known vehicle, but those that are found at once
LOOP_FAULTS = ("propeller_damage:port", "propeller_damage:starboard")
DIAGNOSER = "filter_bank"
LOOP_BUDGET = 0.05  # m/s
# each with the same stimulus without a shift
STIMULI_IN_LOOP = {
    "cruise": "cruise",
    "shift_wave": "cruise",
    "triggered_shift": "cruise",
    "triggered_surge": "triggered_surge",
    "surge_and_shift": "triggered_surge",
}
FIRST_SEED = 880_000_000  # within those of tests
LARGEST_SEED = 10_000_000


class LoopRun(NamedTuple):
    """What a stimulus did.

    Attributes
    ----------
    isolation
        Time from onset until the right class is the most probable one for good [s], (n_lanes,).
    healthy_energy
        Of all vehicles without their faults [J].
    healthy_speed
        Theirs [m/s], (n_samples, n_lanes).
    suspected
        Share of their samples at which `normal` is not the most probable class.
    """

    isolation: np.ndarray
    healthy_energy: float
    healthy_speed: np.ndarray
    suspected: float


@dataclass(frozen=True)
class ThrustShift:
    """Measure evidence, costs and isolation times with thrust shifted between the sides."""

    output: Path = Path("runs/thrust_shift")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 4
    """Vehicles for each fault, severity and excitation."""
    lanes: int = 60
    """Vehicles for each fault in the closed loop."""
    seed: int = 0
    """Offset within the seeds of tests, and seed of the bootstrap."""


def main(arguments: ThrustShift) -> None:
    """Measure, and write results and page."""
    whole_number("vehicles", arguments.vehicles)
    whole_number("lanes", arguments.lanes)
    finite_in_range("seed", arguments.seed, 0, LARGEST_SEED)

    def study(_folder: Path) -> dict[str, Any]:
        return {
            "faults": list(FAULTS),
            "severities": list(SEVERITIES),
            "knowledge": list(KNOWLEDGE),
            "vehicles": arguments.vehicles,
            "excitations": excitations(arguments.vehicles, arguments.seed),
            "loop": closed_loop(arguments.lanes, arguments.seed),
        }

    run_study("thrust_shift", arguments, study, page)


def planned_excitations() -> dict[str, tuple[str, Excitation]]:
    """Family and excitation by name; cruise comes first and belongs to none."""
    planned = {"cruise": ("", Excitation())}
    for offset in OFFSETS:
        planned[f"{offset:.2g} m/s faster"] = (FASTER, Excitation(offset))
        planned[f"speed wave of {offset:.2g} m/s"] = (WAVE, Excitation(-offset, alternates=True))
    for depth in DEPTHS:
        alternating = Excitation(shift=depth, alternates=True)
        planned[f"shift of {depth:g}, alternating"] = (ALTERNATING, alternating)
        planned[f"shift of {depth:g} to port"] = (TO_PORT, Excitation(shift=depth))
    energy = cost(Excitation(shift=COMPARED_DEPTH)).energy
    planned[f"faster, {SAME_ENERGY}"] = (FASTER, Excitation(offset_of_energy(energy)))
    return planned


def excitations(vehicles: int, seed: int) -> dict[str, Any]:
    """Cost and rates of every planned excitation by name, as plain data."""
    results = {}
    passive = cost(Excitation()).energy
    for name, (family, excitation) in tqdm(planned_excitations().items(), unit="excitation"):
        paid = cost(excitation)
        results[name] = {
            "family": family,
            **excitation._asdict(),
            **paid._asdict(),
            "added_energy": paid.energy / passive - 1.0,
            "rates": rates_by_severity(excitation, vehicles, seed),
        }
    return results


def rates_by_severity(excitation: Excitation, vehicles: int, seed: int) -> dict[str, Any]:
    """By severity, knowledge and fault the fields of `Rate`."""
    cases = [(fault, severity) for severity in SEVERITIES for fault in FAULTS]
    lanes = faulty_vehicles(excitation, cases, vehicles, seed)
    found = {name: evidence_rates(lanes, cases, knows) for name, knows in KNOWLEDGE.items()}
    return {
        f"{severity:g}": {
            name: {fault: rates[fault, severity]._asdict() for fault in FAULTS}
            for name, rates in found.items()
        }
        for severity in SEVERITIES
    }


def loop_episodes(conditions: Conditions, lanes: int, seed: int) -> list[Episode]:
    """Episodes with one abrupt and lasting fault of hull or propellers, so many of each."""
    random = np.random.default_rng([FIRST_SEED, seed])
    faults = [fault for fault in LOOP_FAULTS for _ in range(lanes)]
    onset = random.uniform(*LOOP_ONSET, len(faults)).round(1)
    least = [CATALOGUE[fault].least_severity for fault in faults]
    severity = np.maximum(random.uniform(*LOOP_SEVERITY, len(faults)), least)
    lane_seeds = seeds("test", len(faults), FIRST_SEED + seed)
    missions = conditions.sample_missions(lane_seeds)
    schedules = [(FaultEvent(*event),) for event in zip(faults, onset, severity, strict=True)]
    return [Episode(*fields) for fields in zip(lane_seeds, schedules, missions, strict=True)]


def closed_loop(lanes: int, seed: int) -> dict[str, Any]:
    """Isolation times and costs under the rules, on vehicles like those of the suite `standard`.

    Returns
    -------
    results
        lanes, diagnoser, budget; stimuli: by name the mean isolation time [s] of all lanes and its
        difference to that of the same stimulus without a shift, (mean, low, high); of each fault;
        and of the vehicles without their faults the energy added to that in cruise, as a share, the
        root mean square of the added speed [m/s], and the share of samples at which `normal` is not
        the most probable class.
    """
    conditions = load(STANDARD).conditions
    episodes = loop_episodes(conditions, lanes, seed)
    runs = {
        name: run_loop(STIMULI[name](LOOP_BUDGET), conditions, episodes)
        for name in tqdm(STIMULI_IN_LOOP, unit="stimulus")
    }
    passive = runs["cruise"]
    results = {}
    for name, run in runs.items():
        time = run.isolation
        unshifted = runs[STIMULI_IN_LOOP[name]].isolation
        difference = float((time - unshifted).mean())
        of_faults = time.reshape(-1, lanes).mean(axis=1).tolist()
        added_speed = run.healthy_speed - passive.healthy_speed
        results[name] = {
            "isolation": [float(time.mean()), *interval(time, seed)],
            "difference": [difference, *paired_bootstrap(time, unshifted, seed)],
            "by_fault": dict(zip(LOOP_FAULTS, of_faults, strict=True)),
            "healthy_energy": run.healthy_energy / passive.healthy_energy - 1.0,
            "healthy_speed_rms": float(np.sqrt(np.mean(np.square(added_speed)))),
            "healthy_suspected": run.suspected,
        }
    return {"lanes": lanes, "diagnoser": DIAGNOSER, "budget": LOOP_BUDGET, "stimuli": results}


def run_loop(stimulus: Stimulus, conditions: Conditions, episodes: list[Episode]) -> LoopRun:
    """Run the episodes, and the same vehicles without their faults, in the closed loop.

    A lane that is wrong at the horizon counts with the horizon.
    """
    n_lanes = len(episodes)
    names = classes()
    twins = [episode._replace(schedule=()) for episode in episodes]
    events = [episode.schedule[0] for episode in episodes]
    true_class = np.array([names.index(CATALOGUE[event.fault].diagnosis) for event in events])
    first = sample_at(np.array([event.onset for event in events])) + 1
    n_after = round(HORIZON * SAMPLE_RATE)
    n_samples = int(first.max()) + n_after
    is_right = np.zeros((n_samples, n_lanes), bool)
    speed = np.zeros((n_samples, n_lanes))
    energy = 0.0
    n_suspected = 0
    loop = run_closed_loop(make(DIAGNOSER), stimulus, conditions, episodes + twins)
    for k, sample in zip(range(n_samples), loop, strict=False):
        top = sample.belief.log_probability.argmax(axis=1)
        is_right[k] = top[:n_lanes] == true_class
        n_suspected += int((top[n_lanes:] > 0).sum())
        speed[k] = sample.true_speed[n_lanes:]
        energy += float(sample.energy[n_lanes:].sum())
    after_onset = first + np.arange(n_after)[:, None]
    isolation = right_for_good(is_right[after_onset, np.arange(n_lanes)])
    return LoopRun(isolation, energy, speed, n_suspected / speed.size)


if __name__ == "__main__":
    command_line(main)
