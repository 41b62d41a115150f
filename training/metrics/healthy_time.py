"""False alarms over the time of healthy vehicles: when they begin, and how long they stand."""

from typing import NamedTuple

import numpy as np

# minutes since the start of a mission, limits of the ages by which false alarms are counted
AGE_LIMITS = (0.0, 1.0, 5.0, 15.0, 30.0, 60.0, 120.0)
N_QUARTERS = 4  # parts of a mission by which they are counted


class Changes(NamedTuple):
    """Where alarms begin, or where they end, at thresholds above `low` and up to `high`."""

    low: np.ndarray  # (n_changes,)
    high: np.ndarray
    sample: np.ndarray
    lane: np.ndarray


class CountedAlarms(NamedTuple):
    """False alarms and hours of operation by age of the mission, (n_ages,) each."""

    first: np.ndarray  # minutes
    last: np.ndarray
    alarms: np.ndarray
    hours: np.ndarray


def begins(depth: np.ndarray) -> Changes:
    """Every alarm that some threshold would raise, by time and then lane.

    depth is (n_samples, n_lanes), the maximum of log p(normal) over the samples that an alarm
    needs: an alarm stands where it is below the threshold.
    """
    before = np.concatenate([np.full_like(depth[:1], np.inf), depth[:-1]])
    sample, lane = np.nonzero(depth < before)
    return Changes(depth[sample, lane], before[sample, lane], sample, lane)


def ends(depth: np.ndarray) -> Changes:
    """Every end of an alarm that some threshold would raise; the last sample ends all.

    An end is at the first sample without the alarm. depth is that of `begins`, infinite after the
    end of a lane that is shorter than others.
    """
    after = np.concatenate([depth[1:], np.full_like(depth[:1], np.inf)])
    sample, lane = np.nonzero(after > depth)
    return Changes(depth[sample, lane], after[sample, lane], sample + 1, lane)


def is_raised(low: np.ndarray, high: np.ndarray, threshold: float) -> np.ndarray:
    """Whether each change happens at the threshold, (n_changes,)."""
    return (low < threshold) & (threshold <= high)


def time_in_alarm(begin: np.ndarray, end: np.ndarray) -> float:
    """Time during which alarms stand [s], from the times of all beginnings and ends [s].

    Says nothing of how often: one alarm for an hour is as long as sixty for a minute. Read it
    beside the number of alarms.
    """
    return float(end.sum(dtype=np.float64) - begin.sum(dtype=np.float64))


def by_age(begin: np.ndarray, hours: np.ndarray) -> CountedAlarms:
    """False alarms by the age of the mission at their beginning [s], and the hours at that age.

    hours is the operation of each lane, (n_lanes,). Ages that no lane has reached are left out.
    Misleads if lanes of different length differ in more than their length, and where an age has
    few hours: read it with its intervals.
    """
    limits = np.append(AGE_LIMITS, np.inf)
    alarms = np.histogram(np.asarray(begin) / 60.0, limits)[0]
    minutes = np.minimum(60.0 * hours[:, None], limits)
    at_age = np.diff(minutes, axis=1).sum(axis=0) / 60.0
    reached = at_age > 0.0
    return CountedAlarms(
        limits[:-1][reached], limits[1:][reached], alarms[reached], at_age[reached]
    )


def by_quarter(quarter: np.ndarray) -> np.ndarray:
    """False alarms by quarter of the mission in which they begin, (4,), of quarters 0 to 3.

    Quarters of short and of long missions are added: read it beside `by_age`.
    """
    return np.bincount(quarter.astype(np.int64), minlength=N_QUARTERS)
