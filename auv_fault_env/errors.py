"""Refusals of input in one form: the thing, its value, what is allowed, the remedy."""

import contextlib
import difflib
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence

from auv_fault_env.printable import printable

MAX_CHARACTERS = 200  # of a value that an error shows
MAX_LISTED = 2000  # characters of the names that an error lists


class InputError(ValueError):
    """Input that is refused; the command line prints it as one line and exits with code 2."""


def refusal(thing: str, got, allowed: str, remedy: str) -> InputError:
    """An `InputError` in one line.

    >>> str(refusal("severity", 1.5, "0 to 1", "give a fraction"))
    'severity: got 1.5; allowed is 0 to 1; give a fraction'
    """
    shown = " ".join(repr(got).split())
    if len(shown) > MAX_CHARACTERS:
        shown = shown[:MAX_CHARACTERS] + " ..."
    return InputError(printable(f"{thing}: got {shown}; allowed is {allowed}; {remedy}"))


def known_name(kind: str, name, names: Iterable[str]) -> str:
    """The name if it is registered, else a refusal with the nearest name and all names.

    >>> known_name("side", "prot", ["port", "starboard"])  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: side: got 'prot'; ...; did you mean 'port'?
    """
    names = list(names)
    if isinstance(name, str) and name in names:
        return name
    near = difflib.get_close_matches(str(name), names, n=1)
    remedy = f"did you mean {near[0]!r}?" if near else "take a name of the list"
    listed = ", ".join(names)
    if len(listed) > MAX_LISTED:
        listed = f"{listed[:MAX_LISTED].rpartition(', ')[0]}, ... ({len(names)} in all)"
    raise refusal(kind, name, f"one of {listed}", remedy)


def finite_in_range(thing: str, value, low: float, high: float) -> float:
    """The value as a float if it is a finite number in [low, high], else a refusal.

    >>> finite_in_range("severity", float("nan"), 0, 1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: severity: got nan; allowed is a number from 0 to 1; ...
    """
    number = math.nan
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        with contextlib.suppress(OverflowError):
            number = float(value)
    if not low <= number <= high:
        raise refusal(
            thing,
            value,
            f"a number from {low:g} to {high:g}",
            "give one in that range",
        )
    return number


def whole_number(thing: str, value, low: int = 1) -> int:
    """The value as an int if it is a whole number from `low`, else a refusal.

    >>> whole_number("lanes", 2.5)
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: lanes: got 2.5; allowed is a whole number from 1; give one
    """
    is_whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if not is_whole or value < low:
        raise refusal(thing, value, f"a whole number from {low}", "give one")
    return int(value)


def pair_in_range(thing: str, value, low: float, high: float) -> tuple[float, float]:
    """The pair (from, to) if both are finite numbers in [low, high], in order, else a refusal."""
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != 2:
        raise refusal(thing, value, "a pair (from, to)", "give two numbers")
    first = finite_in_range(thing, value[0], low, high)
    last = finite_in_range(thing, value[1], low, high)
    if first > last:
        raise refusal(thing, value, "a pair (from, to) in ascending order", "swap them")
    return first, last


def one_per_lane(thing: str, values, n_lanes: int, remedy: str = "give one each") -> Sequence:
    """The values if there is one for each lane, else a refusal."""
    is_sequence = hasattr(values, "__len__") and hasattr(values, "__getitem__")
    if not is_sequence or isinstance(values, str | bytes | Mapping):
        raise refusal(thing, values, f"a sequence of {n_lanes}, one per lane", remedy)
    if len(values) != n_lanes:
        raise refusal(f"number of {thing}", len(values), f"{n_lanes}, one per lane", remedy)
    return values
