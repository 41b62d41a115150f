"""Rules that shift thrust, in the closed loop on damaged propellers."""

from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, make
from training.benchmark.suites import STANDARD, Conditions, Episode, load
from training.benchmark.trials import run_closed_loop
from training.bounds.delays import right_for_good
from training.metrics import sample_at
from training.metrics.intervals import interval, paired_bootstrap
from training.metrics.records import HORIZON
from training.seeds import seeds
from training.stimuli import Cruise, Stimulus
from training.stimuli.thrust_shift import DEPTH, TriggeredShift, shift_to_suspect
from training.stimuli.triggered_surge import TriggeredSurge
from training.stimuli.waveforms import square

# onset [s] and severity of the abrupt faults
LOOP_ONSET = (10.0, 20.0)
LOOP_SEVERITY = (0.2, 1.0)
# a shift shows neither hull nor paddle wheel sooner, and other faults of a shaft show at once
LOOP_FAULTS = ("propeller_damage:port", "propeller_damage:starboard")
DIAGNOSER = "filter_bank"
LOOP_BUDGET = 0.05  # m/s
FIRST_SEED = 880_000_000  # within those of tests


class ShiftWave(Cruise):
    """Ten seconds more thrust at starboard, ten seconds at port, at the mission's speed.

    It needs no budget: there is no offset. What it costs is energy and rudder.
    """

    name = "shift_wave"

    def thrust_shift(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The wave at this sample."""
        wave = square()
        return np.full(len(observation), DEPTH * wave[sample % wave.size])


class SurgeAndShift(TriggeredSurge):
    """Faster by the odds of a fault of hull or propellers, with thrust to the suspected side."""

    name = "surge_and_shift"

    def thrust_shift(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The shift of the rule."""
        return shift_to_suspect(belief.log_probability)


# each with the name of the same one without a shift
RULES: dict[str, tuple[Stimulus, str]] = {
    "cruise": (Cruise(), "cruise"),
    "shift_wave": (ShiftWave(), "cruise"),
    "triggered_shift": (TriggeredShift(), "cruise"),
    "triggered_surge": (TriggeredSurge(LOOP_BUDGET), "triggered_surge"),
    "surge_and_shift": (SurgeAndShift(LOOP_BUDGET), "triggered_surge"),
}


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


def loop_episodes(conditions: Conditions, lanes: int, seed: int) -> list[Episode]:
    """Episodes with one abrupt and lasting fault of a propeller, so many of each side."""
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
        name: run_loop(stimulus, conditions, episodes)
        for name, (stimulus, _) in tqdm(RULES.items(), unit="stimulus")
    }
    passive = runs["cruise"]
    results = {}
    for name, run in runs.items():
        time = run.isolation
        unshifted = runs[RULES[name][1]].isolation
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
