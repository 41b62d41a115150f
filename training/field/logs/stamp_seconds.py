"""From the stamps of a column to seconds that go on: turns of a clock, dates, summer time."""

from collections.abc import Mapping

import numpy as np

from training.field.logs.clock import DAY, HOUR, unwrapped
from training.field.logs.stamps import Stamps, Undecided

# of its usual steps, by which a clock may miss the full hour when summer time sets it
SUMMER_TIME_STEPS = 3
LATEST_SUMMER_TIME = 60.0  # s after the full hour
SUMMER_TIME_MONTHS = (3, 4, 9, 10, 11)


def seconds_of(stamps: Stamps, is_whole: bool = True) -> tuple[np.ndarray, str]:
    """Seconds since 1970 (n_rows,), or since a midnight where there is no date, and a remark.

    Where a clock begins again, as after midnight, its seconds go on. `Undecided` where day and
    month may be either, and the rows do not show which.
    """
    if not stamps.dates:
        return unwrapped(stamps.clock, stamps.period), stamps.remark
    readings = {
        order: unwrapped(DAY * days + stamps.clock, stamps.period)
        for order, days in stamps.dates.items()
    }
    order, remark = _only_order(readings, is_whole)
    if not (stamps.is_local and stamps.has_clock and is_whole):
        return readings[order], "; ".join(filter(None, (stamps.remark, remark)))
    seconds, n_changes = without_summer_time(readings[order])
    if n_changes:
        remark = f"the clock was set by an hour for summer time; the time goes on ({n_changes})"
    return seconds, "; ".join(filter(None, (stamps.remark, remark)))


def _only_order(readings: Mapping[str, np.ndarray], is_whole: bool) -> tuple[str, str]:
    """The order of day and month, and a remark where it does not matter which."""
    orders = list(readings)
    if len(orders) == 1:
        return orders[0], ""
    if not is_whole:
        raise Undecided(", or ".join(orders))
    elapsed = [_elapsed(readings[order]) for order in orders]
    if all(np.array_equal(elapsed[0], other) for other in elapsed[1:]):
        return orders[0], f"dates may be {' or '.join(orders)}; the time between rows is the same"
    unbroken = [
        order
        for order, one in zip(orders, elapsed, strict=True)
        if abs(np.diff(one)).max(initial=0.0) < DAY
    ]
    if len(unbroken) != 1:
        raise Undecided(", or ".join(orders))
    return unbroken[0], f"dates read {unbroken[0]}: otherwise the rows would be days apart"


def _elapsed(seconds: np.ndarray) -> np.ndarray:
    known = seconds[~np.isnan(seconds)]
    return np.round(known - known[:1], 6)


def without_summer_time(seconds: np.ndarray) -> tuple[np.ndarray, int]:
    """Local time (n_rows,) without the hours by which summer time sets a clock, and their number.

    That is on a Sunday in spring or autumn, at a full hour.
    """
    rows = np.flatnonzero(~np.isnan(seconds))
    known = seconds[rows]
    steps = np.diff(known)
    places = np.flatnonzero((abs(steps) > HOUR / 2) & (abs(steps) < 2 * HOUR))
    if not places.size:
        return seconds, 0
    near = min(SUMMER_TIME_STEPS * np.median(abs(steps[steps != 0])), LATEST_SUMMER_TIME)
    hours = np.sign(steps[places])
    after = known[places + 1]
    is_hour = (abs(steps[places] - HOUR * hours) <= near) & (after % HOUR <= near)
    is_change = is_hour & _may_change(after)
    shift = np.zeros(known.size)
    shift[places[is_change] + 1] = HOUR * hours[is_change]
    corrected = seconds.copy()
    corrected[rows] = known - np.cumsum(shift)
    return corrected, int(is_change.sum())


def _may_change(seconds: np.ndarray) -> np.ndarray:
    """Whether a time is on a Sunday of the months in which summer time begins or ends."""
    days = np.floor(seconds / DAY).astype("datetime64[D]")
    month = days.astype("datetime64[M]").astype(int) % 12 + 1
    is_sunday = (days.astype(int) + 4) % 7 == 0  # 1 January 1970 was a Thursday
    return is_sunday & np.isin(month, SUMMER_TIME_MONTHS)
