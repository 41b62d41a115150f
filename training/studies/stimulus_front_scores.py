"""What a point of the front costs and brings, from its closed loops.

Pure functions of runs by part. A triple is a figure and the ends of its 95 % interval.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from training import metrics
from training.benchmark.trials import COUNTING, FAULTY, THRESHOLD
from training.metrics import Times
from training.metrics.intervals import central, poisson_interval, resamples
from training.metrics.records import HIGHEST_THRESHOLD, HORIZON, PERSISTENCE
from training.studies.stimulus_comparisons import resampled_means
from training.studies.stimulus_front_runs import FrontRun, FrontRuns

RATES = {"1 h": 3600.0, "10 h": 36000.0, "100 h": 360000.0}  # s between false alarms
# deepest vehicles from which the tail of log p(normal) is fitted, at least two
TAIL_SHARE = 0.1
MILLI = 1000.0

Triple = list[float]


class Threshold(NamedTuple):
    """A threshold of log p(normal), and whether the hours did not suffice to count it."""

    value: float
    is_extrapolated: bool


class Detected(NamedTuple):
    """When faults are detected and isolated at a threshold."""

    isolation: Times
    detection: Times


def threshold_at(log_normal: np.ndarray, mean_time: float) -> Threshold:
    """The threshold for one false alarm per `mean_time` [s] on healthy vehicles.

    `log_normal` (n_samples, n_lanes) is that of the vehicles that set it. Where they run for less
    than `mean_time` together, the threshold is extrapolated: beyond a level that a tenth of the
    vehicles cross, the lowest values of log p(normal) are taken as exponentially distributed
    (maximum likelihood), at most one alarm for each vehicle.

    Misleads on few hours: with n alarms allowed the true rate scatters by 1/sqrt(n), and nothing
    proves that the tail stays exponential.
    """
    seconds = log_normal.size * SAMPLE_TIME
    if metrics.allowed_alarms(seconds, mean_time):
        value = metrics.threshold_for(log_normal, mean_time, PERSISTENCE)
        return Threshold(min(value, HIGHEST_THRESHOLD), False)
    depth = metrics.running_maximum(log_normal, PERSISTENCE).min(axis=0)
    deepest = np.sort(depth)
    n_beyond = max(round(TAIL_SHARE * depth.size), 2)
    level = deepest[min(n_beyond, depth.size - 1)]
    scale = float(np.mean(level - deepest[:n_beyond]))
    value = float(level) - scale * math.log(n_beyond * mean_time / seconds)
    return Threshold(min(value, HIGHEST_THRESHOLD), True)


def detected(run: FrontRun, threshold: float, fault: np.ndarray, onset: np.ndarray) -> Detected:
    """Isolation times and detection delays of faulty lanes with these classes and onsets [s]."""
    alarm = metrics.alarms(run.log_normal, threshold, PERSISTENCE)
    decision = np.where(alarm, run.top, metrics.NORMAL)
    return Detected(
        metrics.isolation_time(decision, fault, onset, HORIZON),
        metrics.detection_delay(alarm, onset, HORIZON),
    )


def cost(run: FrontRun, passive: FrontRun) -> dict[str, float]:
    """What the lanes of a run pay relative to the passive run on the same lanes.

    Returns
    -------
    cost
        rms, rms_without_mean: root mean square of the speed offset over all lanes, and that around
        the mean of each lane [m/s]. energy: added [J/m]. time: added over the same distance [s/km],
        negative where the vehicle arrives earlier. time_share: the same as a share.
    """
    square = float(run.offset_square.mean())
    around_mean = float((run.offset_square - np.square(run.offset_mean)).mean())
    duration = len(run.log_normal) * SAMPLE_TIME * run.distance.size
    pace = duration / run.distance.sum()
    passive_pace = duration / passive.distance.sum()
    energy = run.energy.sum() / run.distance.sum()
    passive_energy = passive.energy.sum() / passive.distance.sum()
    return {
        "rms": math.sqrt(square),
        "rms_without_mean": math.sqrt(max(around_mean, 0.0)),
        "energy": float(energy - passive_energy),
        "energy_share": float(energy / passive_energy - 1.0),
        "time": float(MILLI * (pace - passive_pace)),
        "time_share": float(pace / passive_pace - 1.0),
    }


def compared(times: np.ndarray, reference: np.ndarray, seed: int) -> dict[str, Triple]:
    """Mean of times (n_members, n_lanes) [s], its ratio to and its difference from a reference.

    The reference has the same lanes, which are resampled together; members, the trainings of an
    agent, are resampled as well. Few members remain few: their intervals are rather too short.
    """
    lanes = resamples(times.shape[1], seed)
    resampled = resampled_means(times, lanes, seed)
    of_reference = resampled_means(reference, lanes, seed)
    mean = float(times.mean())
    reference_mean = float(reference.mean())
    return {
        "mean": [mean, *central(resampled)],
        "ratio": [mean / reference_mean, *central(resampled / of_reference)],
        "difference": [mean - reference_mean, *central(resampled - of_reference)],
    }


def false_alarms(run: FrontRun, threshold: float) -> dict[str, Any]:
    """False alarms on healthy lanes, the hours of these, and the interval of the rate per hour."""
    alarm = metrics.alarms(run.log_normal, threshold, PERSISTENCE)
    count = int(metrics.rising(alarm).sum())
    hours = run.log_normal.size * SAMPLE_TIME / 3600.0
    return {"count": count, "hours": hours, "interval": poisson_interval(count, hours)}


def point_scores(
    runs: FrontRuns, passive: FrontRuns, fault: np.ndarray, onset: np.ndarray
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Costs, thresholds and false alarms of a point as plain data; its isolation times by rate.

    Also the detection delays at the first rate, under `detection`.
    """
    scores: dict[str, Any] = {
        "healthy": cost(runs[COUNTING], passive[COUNTING]),
        "faulty": cost(runs[FAULTY], passive[FAULTY]),
        "rates": {},
    }
    times: dict[str, np.ndarray] = {}
    for rate, mean_time in RATES.items():
        threshold = threshold_at(runs[THRESHOLD].log_normal, mean_time)
        found = detected(runs[FAULTY], threshold.value, fault, onset)
        times[rate] = found.isolation.time
        scores["rates"][rate] = {
            "threshold": threshold.value,
            "is_extrapolated": threshold.is_extrapolated,
            "detection": metrics.restricted_mean(found.detection),
            "isolated": metrics.probability(found.isolation),
            "false_alarms": false_alarms(runs[COUNTING], threshold.value),
        }
    return scores, times


def at_cost(
    costs: Sequence[float], times: Sequence[np.ndarray], wanted: float
) -> np.ndarray | None:
    """Times (n_members, n_lanes) of a stimulus at a healthy cost [m/s] between its points.

    The times are linear between the mean squares of the two next points: that is what a vehicle has
    on average that takes one of the two strengths by chance at the start of each mission. None
    where the stimulus has no point on either side.
    """
    order = np.argsort(costs, kind="stable")
    square = np.square(costs)[order]
    place = int(np.searchsorted(square, wanted**2))
    # costs are averages of floats: a point that is meant to be there counts as there
    close = np.flatnonzero(np.isclose(np.sqrt(square), wanted, rtol=1e-3))
    if close.size:
        return times[order[close[0]]]
    if place in (0, len(costs)):
        return None
    share = (wanted**2 - square[place - 1]) / (square[place] - square[place - 1])
    return (1.0 - share) * times[order[place - 1]] + share * times[order[place]]


def at_costs(
    points: Mapping[str, tuple[Sequence[float], Sequence[np.ndarray]]],
    wanted: Sequence[float],
    reference: np.ndarray,
    seed: int,
) -> dict[str, dict[str, dict[str, Triple] | None]]:
    """By stimulus and healthy cost, as text: `compared` with a reference; None beyond its points.

    `points` are costs and times of each stimulus.
    """
    found: dict[str, dict[str, dict[str, Triple] | None]] = {}
    for name, (costs, times) in points.items():
        found[name] = {}
        for target in wanted:
            of_target = at_cost(costs, times, target)
            is_there = of_target is not None
            found[name][f"{target:g}"] = compared(of_target, reference, seed) if is_there else None
    return found
