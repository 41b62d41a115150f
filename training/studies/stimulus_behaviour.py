"""What stimuli do in the closed loop: around onsets, on healthy vehicles, and in single episodes.

The vehicles have seeds of validation and the conditions of the suite `ideal`, those that the
stimuli are built for. Beside them runs one that knows the onset, which none can, to show how much
there is to gain.
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
from training.benchmark.suites import IDEAL, Conditions, Episode, load
from training.benchmark.trials import lane_truth, run_closed_loop
from training.benchmark.workers import with_catalogue
from training.bounds.information import faults_by_class
from training.metrics.intervals import central, resamples
from training.metrics.plain import rounded
from training.metrics.records import HORIZON, PERSISTENCE, Truth
from training.seeds import seeds
from training.stimuli import STIMULI, Stimulus
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.known_onset import FasterFromOnset
from training.stimuli.open_loop import Cruise
from training.stimuli.triggered_surge import is_of_hull_or_propellers
from training.studies.stimulus_comparisons import (
    paired_figures,
    resampled_means,
    with_agent,
)

# lanes
PER_CLASS = 20
N_HEALTHY = 300
# within the seeds of validation
FIRST_FAULTY = 400_000_000
FIRST_HEALTHY = 450_000_000
# onset [s] and severity of the faulty lanes
ONSET = (10.0, 30.0)
SEVERITY = (0.2, 1.0)
# s, the window around onset, and the bins in which offsets are averaged
BEFORE = 10.0
AFTER = 25.0
BIN = 0.5
# classes with an episode on the page, and every how many samples it is plotted
EPISODE_CLASSES = (
    *("increased_drag", "propeller_damage:port", "sensor:speed"),
    *("decreased_drag", "motor_overheating:starboard", "seal_friction:port"),
)
PLOTTED_EVERY = 2
# budget [m/s] of the stimuli with known onset, as the results name them; None for that of all
KNOWN_ONSET_BUDGETS = {"onset known": None, "onset known, without budget": LARGEST_OFFSET}


class ClosedLoopRun(NamedTuple):
    """Series of some lanes under a stimulus and a diagnoser, (n_samples, n_lanes) each.

    Attributes
    ----------
    mission, offset, speed
        Mission speed, speed offset and true speed [m/s].
    energy
        Energy of the step that follows [J].
    log_normal, log_true
        Log probabilities of `normal` and of the fault of the lane.
    top
        Index of the most probable fault.
    """

    mission: np.ndarray
    offset: np.ndarray
    speed: np.ndarray
    energy: np.ndarray
    log_normal: np.ndarray
    log_true: np.ndarray
    top: np.ndarray


def record_closed_loop(
    stimulus: Stimulus,
    diagnoser: str,
    episodes: Sequence[Episode],
    conditions: Conditions,
) -> ClosedLoopRun:
    """Simulate the episodes; the stimulus gets the beliefs of a diagnoser of the registry."""
    lanes = np.arange(len(episodes))
    fault = lane_truth(conditions, episodes).at_instants.fault
    n_series = len(ClosedLoopRun._fields)
    run = ClosedLoopRun(*np.empty((n_series, conditions.n_samples, len(episodes))))
    loop = run_closed_loop(make(diagnoser), stimulus, conditions, episodes)
    for k, sample in enumerate(loop):
        log_probability = sample.belief.log_probability
        run.mission[k] = sample.mission_speed
        run.offset[k] = sample.offset
        run.speed[k] = sample.true_speed
        run.energy[k] = sample.energy
        run.log_normal[k] = log_probability[:, 0]
        run.log_true[k] = log_probability[lanes, fault]
        run.top[k] = 1 + log_probability[:, 1:].argmax(axis=1)
    return run


def faulty_lanes(conditions: Conditions, per_class: int, seed: int) -> list[Episode]:
    """Episodes with one abrupt and lasting fault, `per_class` of each class, its faults in turn."""
    faults = []
    for names in faults_by_class().values():
        faults += [names[k % len(names)] for k in range(per_class)]
    random = np.random.default_rng([FIRST_FAULTY, seed])
    onset = random.uniform(*ONSET, len(faults)).round(1)
    least = [CATALOGUE[name].least_severity for name in faults]
    severity = np.maximum(random.uniform(*SEVERITY, len(faults)), least)
    schedules = [(FaultEvent(*event),) for event in zip(faults, onset, severity, strict=True)]
    lane_seeds = seeds("validation", len(faults), FIRST_FAULTY + seed)
    missions = conditions.sample_missions(lane_seeds)
    return [Episode(*fields) for fields in zip(lane_seeds, schedules, missions, strict=True)]


def healthy_lanes(conditions: Conditions, n_lanes: int, seed: int) -> list[Episode]:
    """Episodes without a fault."""
    lane_seeds = seeds("validation", n_lanes, FIRST_HEALTHY + seed)
    missions = conditions.sample_missions(lane_seeds)
    return [Episode(*fields) for fields in zip(lane_seeds, [()] * n_lanes, missions, strict=True)]


def behaviour(
    faulty_stimuli: Sequence[str],
    healthy_stimuli: Sequence[str],
    budget: float,
    diagnoser: str,
    threshold: float,
    workers: int,
    seed: int,
) -> dict[str, Any]:
    """What stimuli do within a budget [m/s] on faulty and on healthy lanes, as plain data.

    Parameters
    ----------
    diagnoser, threshold
        The diagnoser in the loop, and the log p(normal) below which it raises its alarm.
    workers
        Number of processes.
    seed
        Offset within the seeds, and seed of the bootstrap.

    Returns
    -------
    behaviour
        around_onset: see `offsets_around_onset`. healthy: lanes, how many, and share, see
        `budget_shares`. known_onset: figures (`stimulus_comparisons.paired_figures`) of the
        isolation time of faults of hull and propellers, under the faulty stimuli, in cruise, and
        with known onset (`FasterFromOnset`). episodes: stimulus, the last of the faulty stimuli,
        and drawn, see `median_episodes`.
    """
    conditions = load(IDEAL).conditions
    faulty = faulty_lanes(conditions, PER_CLASS, seed)
    healthy = healthy_lanes(conditions, N_HEALTHY, seed)
    truth = lane_truth(conditions, faulty).at_instants
    on_faulty = {name: STIMULI[name](budget) for name in (*faulty_stimuli, Cruise.name)}
    for name, own_budget in KNOWN_ONSET_BUDGETS.items():
        on_faulty[name] = FasterFromOnset(own_budget or budget, onset=truth.onset)
    jobs = [(stimulus, faulty) for stimulus in on_faulty.values()]
    jobs += [(STIMULI[name](budget), healthy) for name in healthy_stimuli]
    call = delayed(with_catalogue)
    faults = dict(CATALOGUE)
    calls = (
        call(faults, record_closed_loop, stimulus, diagnoser, lanes, conditions)
        for stimulus, lanes in jobs
    )
    results = Parallel(n_jobs=workers, return_as="generator")(calls)
    runs = list(tqdm(results, total=len(jobs), desc=f"behaviour at {budget:g} m/s"))
    faulty_runs = dict(zip(on_faulty, runs, strict=False))
    healthy_runs = dict(zip(healthy_stimuli, runs[len(on_faulty) :], strict=True))
    shown_runs = {name: faulty_runs[name] for name in faulty_stimuli}
    last = faulty_stimuli[-1]
    mean_squares = {
        name: np.square(run.offset).mean(axis=0, keepdims=True)
        for name, run in healthy_runs.items()
    }
    return {
        "around_onset": offsets_around_onset(shown_runs, truth.fault, truth.onset),
        "known_onset": _known_onset_figures(faulty_runs, truth, threshold, seed),
        "healthy": {
            "lanes": len(healthy),
            "share": budget_shares(mean_squares, budget, seed),
        },
        "episodes": {
            "stimulus": last,
            "drawn": median_episodes(shown_runs[last], truth.fault, truth.onset, threshold),
        },
    }


def _known_onset_figures(
    runs: Mapping[str, ClosedLoopRun], truth: Truth, threshold: float, seed: int
) -> dict[str, Any]:
    """Figures of the isolation time on the lanes with faults of hull and propellers."""
    lanes = is_of_hull_or_propellers(classes())[truth.fault]
    times = {}
    for name, run in runs.items():
        isolation = isolation_times(run, truth.fault, truth.onset, threshold)
        times[name] = isolation.time[None, lanes]
    return paired_figures(times, seed)


def offsets_around_onset(
    runs: Mapping[str, ClosedLoopRun], fault: np.ndarray, onset: np.ndarray
) -> dict[str, Any]:
    """Mean offset and mean absolute offset [m/s] in bins of the time since onset.

    `fault` and `onset` are class and onset [s] of each lane, (n_lanes,).

    Returns
    -------
    offsets
        time: middle of each bin [s]; mean, absolute: by class and stimulus, a value for each bin.
    """
    time = np.arange(-BEFORE, AFTER, BIN)
    samples_per_bin = round(BIN * SAMPLE_RATE)
    first = metrics.sample_at(onset - BEFORE)
    samples = first + np.arange(time.size * samples_per_bin)[:, None]
    offsets = {"time": rounded(time + BIN / 2), "mean": {}, "absolute": {}}
    for kind, transform in (("mean", np.asarray), ("absolute", np.abs)):
        binned = {}
        for name, run in runs.items():
            offset = transform(run.offset[samples, np.arange(onset.size)])
            binned[name] = offset.reshape(time.size, samples_per_bin, -1).mean(axis=1)
        for k in np.unique(fault):
            lanes = fault == k
            offsets[kind][classes()[k]] = {
                name: rounded(offset[:, lanes].mean(axis=1)) for name, offset in binned.items()
            }
    return offsets


def budget_shares(
    mean_squares: Mapping[str, np.ndarray], budget: float, seed: int
) -> dict[str, list[float]]:
    """Root mean square of the offsets as a share of the budget, a triple for each stimulus.

    `mean_squares` holds the mean square of the offsets of each lane, (1, n_lanes); the seeds of the
    agent count together as well. The seed is that of the bootstrap.
    """
    shares = {}
    for name, values in with_agent(mean_squares).items():
        means = resampled_means(values, resamples(values.shape[1], seed), seed)
        triple = (values.mean(), *central(means))
        shares[name] = [float(np.sqrt(mean)) / budget for mean in triple]
    return shares


def isolation_times(
    run: ClosedLoopRun, fault: np.ndarray, onset: np.ndarray, threshold: float
) -> metrics.Times:
    """Isolation times of the lanes."""
    alarm = metrics.alarms(run.log_normal, threshold, PERSISTENCE)
    decision = np.where(alarm, run.top, metrics.NORMAL)
    return metrics.isolation_time(decision, fault, onset, HORIZON)


def median_episodes(
    run: ClosedLoopRun, fault: np.ndarray, onset: np.ndarray, threshold: float
) -> list[dict[str, Any]]:
    """For each of `EPISODE_CLASSES` the episode with the median isolation time of its lanes."""
    isolation = isolation_times(run, fault, onset, threshold)
    episodes = []
    for name in EPISODE_CLASSES:
        lanes = np.flatnonzero(fault == classes().index(name))
        by_time = np.argsort(isolation.time[lanes], kind="stable")
        lane = lanes[by_time[len(lanes) // 2]]
        is_isolated = not isolation.censored[lane]
        series = ClosedLoopRun(*(values[::PLOTTED_EVERY, lane] for values in run))
        time = np.arange(0, len(run.speed), PLOTTED_EVERY) * SAMPLE_TIME
        episode = {
            "class": name,
            "onset": round(float(onset[lane]), 1),
            "isolation": round(float(isolation.time[lane]), 1) if is_isolated else None,
            "time": rounded(time),
            "mission": rounded(series.mission),
            "command": rounded(series.mission + series.offset),
            "speed": rounded(series.speed),
            "offset": rounded(series.offset),
            NORMAL: rounded(np.exp(series.log_normal)),
            "true": rounded(np.exp(series.log_true)),
        }
        episodes.append(episode)
    return episodes
