"""What is the wrapper's own in the options of a reset, and in its information."""

from collections.abc import Mapping, Sequence
from typing import Any

from auv_fault_env.errors import refusal


def inner_options(
    options: dict[str, Any] | None, names: Sequence[str]
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """Our options, those with these names and a value, and the options of the environment.

    An environment gets None, as without a wrapper, where all options were ours.
    """
    if not isinstance(options, Mapping | None):
        raise refusal("reset options", options, "a mapping", f"give some of {', '.join(names)}")
    given = options or {}
    ours = {name: given[name] for name in names if given.get(name) is not None}
    others = {name: value for name, value in given.items() if name not in names}
    return ours, others if others or options == {} else None


def need_no_other_truth(info: Mapping[str, Any]) -> None:
    """Refuse an environment whose information has a truth of its own."""
    for name in ("true_class", "truth"):
        if name in info:
            allowed = "an environment without a truth of its own"
            raise refusal(f"{name} in info", info[name], allowed, "make it with truth=False")
