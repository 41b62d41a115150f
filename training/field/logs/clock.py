"""The clock of a log: stamps that are missing, wild, repeated, coarse or out of order, made a time that only grows."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal

GAP = 5.0  # s: a longer one begins a new stretch
JUMP = 86_400.0  # s: a longer gap is the clock being set, not time that has passed
LATEST = 1e20  # s: beyond, a number is no time in any unit
UNORDERED = 0.1  # share of steps back in time from which the rows are in no order at all
SETTLED = 3  # rows after a step back by which a clock that was not set back has caught up


class Clock(NamedTuple):
    """Rows of the table in the order of time, their time [s], and where unbroken stretches begin (first of each)."""

    rows: np.ndarray
    time: np.ndarray
    starts: np.ndarray


def clock_of(stamps: np.ndarray, sample_rate: float, repairs: list[str]) -> Clock:
    """Put the rows of a log into the order of time.

    Parameters
    ----------
    stamps
        Seconds, (n_rows,), as they stand in the log; NaN where they are missing.
    sample_rate
        Of the log [Hz], as the vehicle's file has it.
    repairs
        Gets a line for each thing repaired.

    Raises
    ------
    InputError
        If there are no stamps, or if they are in another unit than the vehicle's file says.
    """
    rows = np.flatnonzero(abs(stamps) < LATEST)
    if rows.size == 0:
        raise refusal(
            "time",
            "no stamp",
            "a number of seconds in each row",
            "correct [time] in the vehicle file",
        )
    _say(repairs, stamps.size - rows.size, "rows without a stamp left out")
    if np.mean(np.diff(stamps[rows], prepend=stamps[rows[0]]) < 0) > UNORDERED:
        repairs.append("time: the rows are in no order; sorted by their stamps")
        rows = rows[np.argsort(stamps[rows], kind="stable")]
    kept = ~_wild(stamps[rows])
    _say(repairs, rows.size - kept.sum(), "rows with a stamp far from those around it left out")
    rows = rows[kept]
    time = _spread(stamps[rows] - stamps[rows[0]], sample_rate, repairs)
    block = _blocks(time, repairs)
    order = np.lexsort((time, block))
    rows = rows[order]
    time = time[order]
    block = block[order]
    last = np.append((np.diff(time) > 0) | (np.diff(block) > 0), True)
    _say(repairs, (~last).sum(), "rows whose stamp comes again left out, the last kept")
    rows = rows[last]
    time = time[last]
    block = block[last]
    _check_rate(time, sample_rate, repairs)
    return _stretches(rows, time, np.diff(block) > 0, sample_rate, repairs)


def _say(repairs: list[str], count: int, words: str) -> None:
    if count:
        repairs.append(f"time: {words} ({count})")


def _wild(time: np.ndarray) -> np.ndarray:
    """Single stamps that are far from both neighbours, which agree with each other."""
    wild = np.zeros(time.size, bool)
    before = time[:-2]
    here = time[1:-1]
    after = time[2:]
    wild[1:-1] = (
        (abs(here - before) > GAP) & (abs(here - after) > GAP) & (abs(after - before) <= GAP)
    )
    return wild


def _spread(time: np.ndarray, sample_rate: float, repairs: list[str]) -> np.ndarray:
    """Rows between two ticks of a clock that is coarser than the rows come, spread evenly over the tick."""
    ticks = np.flatnonzero(np.diff(time, prepend=-np.inf))
    count = np.diff(ticks, append=time.size)
    length = np.median(np.diff(time[ticks])) if ticks.size > 1 else 0.0
    if not (
        length > 0
        and np.median(count) > 1
        and 0.7 < np.median(count) / (length * sample_rate) < 1.4
    ):
        return time
    repairs.append(
        f"time: the clock ticks every {length:.3g} s only; the rows between are spread evenly"
    )
    within = np.arange(time.size) - np.repeat(ticks, count)
    return time + length * within / np.repeat(count, count)


def _blocks(time: np.ndarray, repairs: list[str]) -> np.ndarray:
    """Number of times that the clock has been set back before each row, (n_rows,)."""
    back = np.flatnonzero(np.diff(time) < 0)
    restarts = back[time[np.minimum(back + SETTLED, time.size - 1)] < time[back]]
    _say(repairs, back.size - restarts.size, "rows out of order sorted in")
    _say(repairs, restarts.size, "the clock is set back and a new stretch begins")
    return np.searchsorted(restarts, np.arange(time.size), side="left")


def _check_rate(time: np.ndarray, sample_rate: float, repairs: list[str]) -> None:
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0 / sample_rate
    ratio = step * sample_rate
    if not 0.02 < ratio < 50:
        got = (
            f"rows {step:.3g} s apart, {ratio:.3g} times what sample_rate = {sample_rate:g} Hz says"
        )
        raise refusal(
            "time", got, "stamps in the unit that [time] names", "correct the unit or sample_rate"
        )
    if not 0.8 < ratio < 1.25:
        repairs.append(
            f"time: rows are {step:.3g} s apart, not {1 / sample_rate:.3g} s as sample_rate says"
        )


def _stretches(
    rows: np.ndarray,
    time: np.ndarray,
    restarted: np.ndarray,
    sample_rate: float,
    repairs: list[str],
) -> Clock:
    """Cut at gaps and where the clock was set; there the time goes on one sample later."""
    step = np.diff(time)
    jumps = (step > JUMP) & ~restarted
    gaps = (step > GAP) & ~restarted & ~jumps
    _say(repairs, gaps.sum(), f"gaps of more than {GAP:g} s, after which a new stretch begins")
    _say(repairs, jumps.sum(), "the clock jumps by more than a day and a new stretch begins")
    step = np.where(restarted | jumps, 1.0 / sample_rate, step)
    starts = 1 + np.flatnonzero(gaps | jumps | restarted)
    return Clock(rows, np.append(0.0, np.cumsum(step)), np.append(0, starts))
