"""The clock of a log: stamps that are missing, repeated or unordered become a time axis."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from training.field.units import UNITS

GAP = 5.0  # s: a longer one begins a new segment
HOUR = 3600.0  # s
DAY = 86_400.0  # s
WEEK = 7 * DAY
JUMP = DAY  # a longer gap means that the clock was set, not that time has passed
LATEST = 1e20  # s: beyond, a number is no time in any unit
UNORDERED = 0.1  # share of steps back in time from which the rows have no order
SETTLED = 3  # rows after a step back within which a clock that was not set back catches up
FEWEST_TICKS = 0.7  # of the rows per tick that the sample rate implies, to be a coarse clock
MOST_TICKS = 1.4


class TimeAxis(NamedTuple):
    """The rows of a table in the order of time."""

    rows: np.ndarray  # their numbers in the table, (n,)
    time: np.ndarray  # seconds from the first of them, (n,); it only grows
    starts: np.ndarray  # where segments without a gap begin, as indices of `rows`

    @property
    def ends(self) -> np.ndarray:
        """Where the segments end, as indices of `rows`."""
        return np.append(self.starts[1:], self.time.size)


def unwrapped(stamps: np.ndarray, period: float, share: float = 1 / 24) -> np.ndarray:
    """Stamps [s] (n_rows,) of a clock that begins again after each period, as stamps that go on.

    It begins again where a stamp is less than the one before it and would follow it within this
    share of the period; otherwise the clock was set back.

    >>> unwrapped(np.array([86_399.0, 0.0, 1.0]), DAY)
    array([86399., 86400., 86401.])
    """
    if np.isinf(period):
        return stamps
    rows = np.flatnonzero(~np.isnan(stamps))
    step = np.diff(stamps[rows])
    is_begun = (step < 0) & (step + period <= share * period)
    is_undone = (step > 0) & (step - period >= -share * period)  # rows out of order at the turn
    turns = np.append(0, np.cumsum(is_begun.astype(int) - is_undone.astype(int)))
    continued = stamps.copy()
    continued[rows] += period * turns
    return continued


def time_axis(stamps: np.ndarray, sample_rate: float, remarks: list[str]) -> TimeAxis:
    """Put the rows of a log into the order of time.

    Stamps are seconds, (n_rows,), NaN where missing; the sample rate [Hz] is that of the vehicle
    file. `InputError` if there are no stamps, or if they are in another unit than that file says.
    """
    rows = _stamped_rows(stamps, remarks)
    rows = _in_rough_order(rows, stamps, remarks)
    is_isolated = _is_isolated(stamps[rows])
    kind = "rows with a stamp far from those around it left out"
    _add_remark(remarks, is_isolated.sum(), kind)
    rows = rows[~is_isolated]
    time = _over_turns(stamps[rows])
    time = time - time[0]
    time = _between_coarse_ticks(time, sample_rate, remarks)
    n_restarts = _restarts_before(time, remarks)
    order = np.lexsort((time, n_restarts))
    is_step = (np.diff(time[order]) > 0) | (np.diff(n_restarts[order]) > 0)
    is_last_of_stamp = np.append(is_step, True)
    kind = "rows with the stamp of a later row left out"
    _add_remark(remarks, (~is_last_of_stamp).sum(), kind)
    order = order[is_last_of_stamp]
    time = time[order]
    _check_rate(time, sample_rate, remarks)
    is_restart = np.diff(n_restarts[order]) > 0
    return _with_segments(rows[order], time, is_restart, sample_rate, remarks)


def _over_turns(time: np.ndarray) -> np.ndarray:
    """The time of a clock that counts the seconds of a day or of a week, beyond its turns."""
    for period in (DAY, WEEK):
        if time.min() >= 0.0 and time.max() < period:
            time = unwrapped(time, period, share=GAP / period)
    return time


def _add_remark(remarks: list[str], count: int, kind: str) -> None:
    if count:
        remarks.append(f"time: {kind} ({count})")


def _stamped_rows(stamps: np.ndarray, remarks: list[str]) -> np.ndarray:
    rows = np.flatnonzero(abs(stamps) < LATEST)
    if rows.size == 0:
        allowed = "a number of seconds in each row"
        raise refusal("time", "no stamp", allowed, "correct [time] in the vehicle file")
    _add_remark(remarks, stamps.size - rows.size, "rows without a stamp left out")
    return rows


def _in_rough_order(rows: np.ndarray, stamps: np.ndarray, remarks: list[str]) -> np.ndarray:
    """The rows, sorted if most of their order is lost."""
    steps = np.diff(stamps[rows], prepend=stamps[rows[0]])
    if np.mean(steps < 0) <= UNORDERED:
        return rows
    remarks.append("time: the rows are in no order; sorted by their stamps")
    return rows[np.argsort(stamps[rows], kind="stable")]


def _is_isolated(time: np.ndarray) -> np.ndarray:
    """Whether a stamp is far from both neighbours, which are near each other."""
    before = time[:-2]
    inner = time[1:-1]
    after = time[2:]
    is_far = (abs(inner - before) > GAP) & (abs(inner - after) > GAP)
    isolated = np.zeros(time.size, bool)
    isolated[1:-1] = is_far & (abs(after - before) <= GAP)
    return isolated


def _between_coarse_ticks(time: np.ndarray, sample_rate: float, remarks: list[str]) -> np.ndarray:
    """The time; rows with the same stamp of a coarse clock are evenly apart until the next."""
    ticks = np.flatnonzero(np.diff(time, prepend=-np.inf))
    count = np.diff(ticks, append=time.size)
    length = np.median(np.diff(time[ticks])) if ticks.size > 1 else 0.0
    if length <= 0 or np.median(count) <= 1:
        return time
    if not FEWEST_TICKS < np.median(count) / (length * sample_rate) < MOST_TICKS:
        return time
    step = f"the clock ticks every {length:.3g} s only"
    remarks.append(f"time: {step}; the rows between are spread evenly")
    index_in_tick = np.arange(time.size) - np.repeat(ticks, count)
    return time + length * index_in_tick / np.repeat(count, count)


def _restarts_before(time: np.ndarray, remarks: list[str]) -> np.ndarray:
    """How often the clock has been set back before each row, (n_rows,)."""
    back = np.flatnonzero(np.diff(time) < 0)
    settled = np.minimum(back + SETTLED, time.size - 1)
    restarts = back[time[settled] < time[back]]
    _add_remark(remarks, back.size - restarts.size, "rows out of order sorted in")
    _add_remark(remarks, restarts.size, "the clock is set back and a new segment begins")
    return np.searchsorted(restarts, np.arange(time.size), side="left")


def _check_rate(time: np.ndarray, sample_rate: float, remarks: list[str]) -> None:
    steps = np.diff(time)
    positive = steps[steps > 0]
    step = float(np.median(positive)) if positive.size else 1.0 / sample_rate
    ratio = step * sample_rate
    if not 0.02 < ratio < 50:
        expected = f"{ratio:.3g} times what sample_rate = {sample_rate:g} Hz says"
        allowed = "stamps in the unit that [time] names"
        got = f"rows {step:.3g} s apart, {expected}"
        fitting = [unit for unit, factor in UNITS["s"].items() if 0.7 < ratio * factor < 1.4]
        hint = f" ({' or '.join(fitting)}?)" if fitting else ""
        raise refusal("time", got, allowed, f"correct the unit{hint} or sample_rate")
    if not 0.8 < ratio < 1.25:
        expected = f"not {1 / sample_rate:.3g} s as sample_rate says"
        remarks.append(f"time: rows are {step:.3g} s apart, {expected}")


def _with_segments(
    rows: np.ndarray,
    time: np.ndarray,
    is_restart: np.ndarray,
    sample_rate: float,
    remarks: list[str],
) -> TimeAxis:
    """Cut at gaps and where the clock was set; there the time goes on one sample later."""
    step = np.diff(time)
    is_jump = (step > JUMP) & ~is_restart
    is_gap = (step > GAP) & ~is_restart & ~is_jump
    kind = f"gaps of more than {GAP:g} s, after which a new segment begins"
    _add_remark(remarks, is_gap.sum(), kind)
    kind = "the clock jumps by more than a day and a new segment begins"
    _add_remark(remarks, is_jump.sum(), kind)
    step = np.where(is_restart | is_jump, 1.0 / sample_rate, step)
    starts = 1 + np.flatnonzero(is_gap | is_jump | is_restart)
    return TimeAxis(rows, np.append(0.0, np.cumsum(step)), np.append(0, starts))
