"""The project's one manner of refusing input: the thing, the value got, what is allowed, the remedy."""

import difflib
import math
from collections.abc import Iterable


class InputError(ValueError):
    """Input from outside that is refused; the command line prints it as one line and exits with code 2."""


def refusal(thing: str, got, allowed: str, remedy: str) -> InputError:
    """An `InputError` in one line.

    >>> str(refusal("severity", 1.5, "0 to 1", "give a fraction"))
    'severity: got 1.5; allowed is 0 to 1; give a fraction'
    """
    return InputError(f"{thing}: got {got!r}; allowed is {allowed}; {remedy}")


def known_name(kind: str, name, names: Iterable[str]) -> str:
    """The name if it is registered, else a refusal with the nearest name and the whole list.

    >>> known_name("side", "prot", ["port", "starboard"])
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: side: got 'prot'; allowed is one of port, starboard; did you mean 'port'?
    """
    names = list(names)
    if name in names:
        return name
    near = difflib.get_close_matches(str(name), names, n=1)
    remedy = f"did you mean {near[0]!r}?" if near else "take a name of the list"
    raise refusal(kind, name, "one of " + ", ".join(names), remedy)


def finite_in_range(thing: str, value, low: float, high: float) -> float:
    """The value as a float if it is a finite number in [low, high], else a refusal.

    >>> finite_in_range("severity", float("nan"), 0, 1)
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: severity: got nan; allowed is a number from 0 to 1; give one in that range
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not low <= number <= high:
        raise refusal(thing, value, f"a number from {low:g} to {high:g}", "give one in that range")
    return number
