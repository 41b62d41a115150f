"""The time of a log: its column, its unit and the rate of the rows."""

from collections.abc import Mapping

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE
from training.field.proposal.evidence import Match
from training.field.proposal.guess import Guess
from training.field.units import UNITS
from training.field.vehicle_file import Column

# least stamp that counts from 1970 in this unit
EPOCHS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
# least step between two rows in this unit
STEPS = {"ns": 5e6, "us": 5e3, "ms": 3.0, "s": 1e-4}
# first and last day number of the years 1954 to 2119, by what counts days
DAYS = {
    "days since 1900 as spreadsheets do": (20_000.0, 80_000.0),
    "days since the year 0 as MATLAB does": (713_700.0, 774_000.0),
}
YEAR_2001 = 1e9  # s since 1970
LONGEST_STEP = 10.0  # s, of a log that counts from 1970
COARSE_CLOCK = 0.3  # share of rows with the stamp of the row before
RATES = (0.5, 1e4)  # Hz, that a vehicle file can have


def time_of(matches: Mapping[str, Match], columns: Mapping[str, np.ndarray]) -> Guess | None:
    """The time of most certain name, of equal ones that with fewest repeated stamps."""
    times = [match for match in matches.values() if match.quantity == "time"]
    if not times:
        return None
    match = max(times, key=lambda one: (one.score, _share_of_steps(columns[one.label])))
    stamps = columns[match.label]
    named = Guess(Column(match.label, UNITS["s"][match.unit or "s"]), "by its name")
    unit, why = _unit(stamps)
    is_date = unit in EPOCHS and np.nanmedian(stamps) * UNITS["s"][unit] > YEAR_2001
    is_believed = unit == match.unit or not is_date
    if match.unit and is_believed and _is_possible(_rate(named, columns)):
        return named
    if match.unit:
        why += f"; in {match.unit}, as its name says, it would be wrong"
    return Guess(Column(match.label, UNITS["s"][unit]), why)


def _share_of_steps(stamps: np.ndarray) -> float:
    return float(np.mean(np.diff(stamps[np.isfinite(stamps)]) != 0))


def _unit(column: np.ndarray) -> tuple[str, str]:
    """The unit of stamps (n_rows,) by their size or step, and why."""
    stamps = column[np.isfinite(column)]
    size = float(np.median(stamps))
    steps = np.diff(stamps)
    step = float(np.median(steps[steps > 0]))
    for unit, least in EPOCHS.items():
        if size > least and step * UNITS["s"][unit] < LONGEST_STEP:
            return unit, f"counts from 1970 in {unit}, by its size"
    for about, (first, last) in DAYS.items():
        if first < size < last and step < STEPS["s"]:
            return "d", f"counts {about}, by the step of {step:.3g}"
    unit = next((unit for unit, least in STEPS.items() if step > least), "s")
    return unit, f"in {unit}, by the step of {step:.3g}"


def sample_rate(time: Guess | None, columns: Mapping[str, np.ndarray]) -> tuple[float, str]:
    """Rows per second in Hz, and why; a clock with few ticks counts the rows between two."""
    if time is None:
        return SAMPLE_RATE, "a guess: no time in the log"
    rate = _rate(time, columns)
    if _is_possible(rate):
        return rate, "by the stamps of its rows"
    return SAMPLE_RATE, f"a guess: the stamps say {rate:g} Hz, which cannot be"


def _rate(time: Guess, columns: Mapping[str, np.ndarray]) -> float:
    stamps = time.column.scale * columns[time.column.name]
    steps = np.diff(stamps[np.isfinite(stamps)])
    is_coarse = np.mean(steps == 0) > COARSE_CLOCK
    step = steps[steps >= 0].mean() if is_coarse else np.median(steps[steps > 0])
    return float(f"{1 / step:.3g}")


def _is_possible(rate: float) -> bool:
    return RATES[0] <= rate <= RATES[1]
