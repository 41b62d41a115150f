"""Allowed values as annotations of arguments: the help shows them, and `check` refuses others."""

import dataclasses
import math
from collections.abc import Callable
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from tyro.constructors import PrimitiveConstructorSpec

LONGEST_INTEGER = 10**9  # greater powers of two are written as such


@dataclasses.dataclass(frozen=True, kw_only=True)
class Range(PrimitiveConstructorSpec[Any]):
    """Numbers of a kind from `low` to `high`, both included; text that is none stays text."""

    kind: str
    low: float
    high: float

    @property
    def description(self) -> str:
        """The allowed values in words."""
        return f"a {self.kind} {_in_words(self.low, self.high)}"

    def contains(self, value: Any) -> bool:
        """Whether the value is allowed; text and NaN are not."""
        return not isinstance(value, str) and self.low <= value <= self.high


def whole(low: int, high: float = math.inf) -> Range:
    """Whole numbers from `low` to `high`.

    >>> whole(0, 2**62).metavar
    'INT from 0 to 2^62'
    >>> whole(1).metavar
    'INT from 1'
    """
    return _range(int, "whole number", low, high)


def number(low: float, high: float) -> Range:
    """Numbers from `low` to `high`.

    >>> number(0.05, 1000.0).metavar
    'FLOAT from 0.05 to 1000'
    """
    return _range(float, "number", low, high)


def listed(*names: str, several: bool = False) -> PrimitiveConstructorSpec[Any]:
    """Names that the help shows; the command looks them up in their registry, which may grow.

    >>> listed("csv", "parquet", several=True).metavar
    '{csv,parquet} ...'
    """
    return PrimitiveConstructorSpec(
        nargs="*" if several else 1,
        metavar="{" + ",".join(names) + "}" + (" ..." if several else ""),
        instance_from_str=tuple if several else lambda words: words[0],
        is_instance=lambda value: True,
        str_from_instance=lambda value: list(value) if several else [str(value)],
    )


def check(arguments: Any) -> None:
    """Refuse the first argument outside its `Range`; `arguments` is a dataclass."""
    hints = get_type_hints(type(arguments), include_extras=True)
    for name, hint in hints.items():
        ranges = [one for one in _annotations(hint) if isinstance(one, Range)]
        value = getattr(arguments, name)
        if value is not None and not all(one.contains(value) for one in ranges):
            # after the parser, so that --help does not wait for numba
            from auv_fault_env.errors import refusal

            shown = name.replace("_", "-")
            raise refusal(shown, value, ranges[0].description, "give one in that range")


def _range(parse: Callable[[str], float], kind: str, low: float, high: float) -> Range:
    def parsed(words: list[str]) -> float | str:
        try:
            return parse(words[0])
        except ValueError:
            return words[0]

    return Range(
        nargs=1,
        metavar=f"{parse.__name__.upper()} {_in_words(low, high)}",
        instance_from_str=parsed,
        is_instance=lambda value: True,
        str_from_instance=lambda value: [str(value)],
        kind=kind,
        low=low,
        high=high,
    )


def _in_words(low: float, high: float) -> str:
    if high == math.inf:
        return f"from {low:.10g}"
    is_long = high > LONGEST_INTEGER
    return f"from {low:.10g} to " + (f"2^{math.log2(high):.0f}" if is_long else f"{high:.10g}")


def _annotations(hint: Any) -> tuple[Any, ...]:
    return get_args(hint)[1:] if get_origin(hint) is Annotated else ()
