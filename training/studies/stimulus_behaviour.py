"""What stimuli do with a diagnoser in the loop: around the onset of each class, on healthy vehicles, and in episodes.

On vehicles of the seeds for validation, under the conditions of the standard suite.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.faults import CATALOGUE, NORMAL, classes
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training import metrics
from training.benchmark.scores import rounded
from training.benchmark.suites import STANDARD, Conditions, Episode, load
from training.benchmark.trials import lane_truth, run_closed_loop
from training.metrics.intervals import central, resamples
from training.metrics.records import HORIZON, PERSISTENCE, Truth
from training.seeds import seeds
from training.stimuli import STIMULI, Stimulus
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.open_loop import Cruise
from training.stimuli.triggered_surge import HULL_AND_PROPELLERS
from training.studies.stimulus_comparisons import paired, resampled_means, with_agent
from training.studies.told_onset import ToldOnset

# lanes
PER_CLASS = 20
N_HEALTHY = 300
# within the seeds for validation
FIRST_FAULTY = 400_000_000
FIRST_HEALTHY = 450_000_000
ONSET = (10.0, 30.0)
SEVERITY = (0.2, 1.0)
# s, around the onset; over a bin the offsets are averaged
BEFORE = 10.0
AFTER = 25.0
BIN = 0.5
DRAWN = (  # classes, an episode of each
    *("increased_drag", "propeller_damage:port", "sensor:speed"),
    *("decreased_drag", "motor_overheating:starboard", "seal_friction:port"),
)
EVERY = 2  # samples from one drawn to the next
# budget [m/s], None for that of all
TOLD = {"told the onset": None, "told, without budget": LARGEST_OFFSET}


class Path(NamedTuple):
    """What happened on some lanes, (n_samples, n_lanes) each.

    Mission speed, offset and true speed [m/s]; log p(normal), log p(what is wrong in the end), most
    probable fault.
    """

    mission: np.ndarray
    offset: np.ndarray
    speed: np.ndarray
    log_normal: np.ndarray
    log_true: np.ndarray
    top: np.ndarray


def in_the_loop(
    stimulus: Stimulus, diagnoser: str, episodes: Sequence[Episode], conditions: Conditions
) -> Path:
    """Run the episodes with the stimulus, which sees the beliefs of a diagnoser of the registry."""
    lanes = np.arange(len(episodes))
    fault = lane_truth(conditions, episodes).at_instants.fault
    path = Path(*np.empty((len(Path._fields), conditions.n_samples, lanes.size)))
    loop = run_closed_loop(make(diagnoser), stimulus, conditions, episodes)
    for k, sample in enumerate(loop):
        log_probability = sample.belief.log_probability
        path.mission[k] = sample.mission_speed
        path.offset[k] = sample.offset
        path.speed[k] = sample.true_speed
        path.log_normal[k] = log_probability[:, 0]
        path.log_true[k] = log_probability[lanes, fault]
        path.top[k] = 1 + log_probability[:, 1:].argmax(axis=1)
    return path


def faulty_lanes(conditions: Conditions, per_class: int, seed: int) -> list[Episode]:
    """Episodes with one abrupt and lasting fault: every class as often as any other, its kinds in turn."""
    kinds = {
        name: [one.name for one in CATALOGUE.values() if one.diagnosis == name]
        for name in classes()[1:]
    }
    faults = [names[k % len(names)] for names in kinds.values() for k in range(per_class)]
    random = np.random.default_rng([FIRST_FAULTY, seed])
    onset = random.uniform(*ONSET, len(faults)).round(1)
    severity = random.uniform(*SEVERITY, len(faults))
    schedules = [(FaultEvent(*event),) for event in zip(faults, onset, severity, strict=True)]
    lane_seeds = seeds("validation", len(faults), FIRST_FAULTY + seed)
    missions = conditions.draw_missions(lane_seeds)
    return [Episode(*one) for one in zip(lane_seeds, schedules, missions, strict=True)]


def healthy_lanes(conditions: Conditions, n_lanes: int, seed: int) -> list[Episode]:
    """Episodes without a fault."""
    lane_seeds = seeds("validation", n_lanes, FIRST_HEALTHY + seed)
    missions = conditions.draw_missions(lane_seeds)
    return [Episode(one, (), mission) for one, mission in zip(lane_seeds, missions, strict=True)]


def behaviour(
    drawn: Sequence[str],
    counted: Sequence[str],
    budget: float,
    diagnoser: str,
    threshold: float,
    workers: int,
    seed: int,
) -> dict[str, Any]:
    """What stimuli do within a budget [m/s], as plain data.

    around_onset
        time [s] since onset; mean and absolute: by class and stimulus the mean offset, and the mean
        of its size [m/s].
    healthy
        By stimulus the root mean square of the offsets of healthy vehicles as a share of the
        budget, a triple as in `training.studies.stimulus_comparisons`; lanes, how many of them.
    told
        Figures as `training.studies.stimulus_comparisons.paired` tells of the isolation time on the
        lanes with faults of hull and propellers, under what is drawn, in cruise, and, told the
        onset, under `ToldOnset` with that budget or none.
    episodes
        Of the last stimulus drawn, for each of `DRAWN` that of median isolation time, series over
        `time` [s].

    Parameters
    ----------
    drawn, counted
        Stimuli whose offsets are averaged around the onset; and those counted on healthy vehicles.
    diagnoser, threshold
        Who is in the loop, and below which log p(normal) it raises its alarm.
    workers
        Processes.
    seed
        Offset within the seeds, and that of the bootstrap.
    """
    conditions = load(STANDARD).conditions
    faulty = faulty_lanes(conditions, PER_CLASS, seed)
    healthy = healthy_lanes(conditions, N_HEALTHY, seed)
    truth = lane_truth(conditions, faulty).at_instants
    told = {name: ToldOnset(least or budget, onset=truth.onset) for name, least in TOLD.items()}
    tried = {name: STIMULI[name](budget) for name in (*drawn, Cruise.name)} | told
    jobs = [(stimulus, faulty) for stimulus in tried.values()]
    jobs += [(STIMULI[name](budget), healthy) for name in counted]
    runs = Parallel(n_jobs=workers, return_as="generator")(
        delayed(in_the_loop)(stimulus, diagnoser, lanes, conditions) for stimulus, lanes in jobs
    )
    paths = list(tqdm(runs, total=len(jobs), desc=f"behaviour at {budget:g} m/s"))
    on_faulty = dict(zip(tried, paths, strict=False))
    of_drawn = {name: on_faulty[name] for name in drawn}
    last = drawn[-1]
    squared = {
        name: np.square(path.offset).mean(axis=0, keepdims=True)
        for name, path in zip(counted, paths[len(on_faulty) :], strict=True)
    }
    return {
        "around_onset": around_onset(of_drawn, truth.fault, truth.onset),
        "told": told_figures(on_faulty, truth, threshold, seed),
        "healthy": {"lanes": len(healthy), "share": shares(squared, budget, seed)},
        "episodes": {
            "stimulus": last,
            "drawn": episodes_of(of_drawn[last], truth.fault, truth.onset, threshold),
        },
    }


def told_figures(
    paths: Mapping[str, Path], truth: Truth, threshold: float, seed: int
) -> dict[str, Any]:
    """Figures of the isolation time on the lanes with faults of hull and propellers, by stimulus."""
    lanes = HULL_AND_PROPELLERS[truth.fault]
    times = {
        name: isolated(path, truth.fault, truth.onset, threshold).time
        for name, path in paths.items()
    }
    return paired({name: one[None, lanes] for name, one in times.items()}, seed)


def around_onset(paths: Mapping[str, Path], fault: np.ndarray, onset: np.ndarray) -> dict[str, Any]:
    """Mean offset and mean size of the offset by class and stimulus, in bins of time since onset."""
    time = np.arange(-BEFORE, AFTER, BIN)
    samples = round(BIN * SAMPLE_RATE)
    at = metrics.sample_at(onset - BEFORE) + np.arange(time.size * samples)[:, None]
    found: dict[str, Any] = {"time": rounded(time + BIN / 2), "mean": {}, "absolute": {}}
    offset = {name: path.offset[at, np.arange(onset.size)] for name, path in paths.items()}
    for kind, values in (
        ("mean", offset),
        ("absolute", {name: np.abs(one) for name, one in offset.items()}),
    ):
        binned = {
            name: one.reshape(time.size, samples, -1).mean(axis=1) for name, one in values.items()
        }
        for k in np.unique(fault):
            of_class = {
                name: rounded(one[:, fault == k].mean(axis=1)) for name, one in binned.items()
            }
            found[kind][classes()[k]] = of_class
    return found


def shares(squared: Mapping[str, np.ndarray], budget: float, seed: int) -> dict[str, list[float]]:
    """Root mean square of the offsets as a share of the budget, triples by stimulus.

    From the lanes' mean squares (1, n_lanes); those of the agent's seeds come together as well.
    """
    found = {}
    for name, values in with_agent(squared).items():
        drawn = resampled_means(values, resamples(values.shape[1], seed), seed)
        found[name] = [float(np.sqrt(one)) / budget for one in (values.mean(), *central(drawn))]
    return found


def isolated(path: Path, fault: np.ndarray, onset: np.ndarray, threshold: float) -> metrics.Times:
    """Isolation times of the lanes."""
    alarm = metrics.alarms(path.log_normal, threshold, PERSISTENCE)
    return metrics.isolation_time(np.where(alarm, path.top, metrics.NORMAL), fault, onset, HORIZON)


def episodes_of(
    path: Path, fault: np.ndarray, onset: np.ndarray, threshold: float
) -> list[dict[str, Any]]:
    """For each class of `DRAWN` the episode whose isolation time is the median of its lanes."""
    isolation = isolated(path, fault, onset, threshold)
    found = []
    for name in DRAWN:
        lanes = np.flatnonzero(fault == classes().index(name))
        lane = lanes[np.argsort(isolation.time[lanes], kind="stable")[len(lanes) // 2]]
        series = Path(*(values[::EVERY, lane] for values in path))
        found.append(
            {
                "class": name,
                "onset": round(float(onset[lane]), 1),
                "isolation": None
                if isolation.censored[lane]
                else round(float(isolation.time[lane]), 1),
                "time": rounded(np.arange(0, len(path.speed), EVERY) * SAMPLE_TIME),
                "mission": rounded(series.mission),
                "command": rounded(series.mission + series.offset),
                "speed": rounded(series.speed),
                "offset": rounded(series.offset),
                NORMAL: rounded(np.exp(series.log_normal)),
                "true": rounded(np.exp(series.log_true)),
            }
        )
    return found
