"""Classes and functions by the place where Python finds them, so that JSON can have them."""

import pkgutil
from typing import Any

from auv_fault_env.errors import refusal


def found(thing: str, target: str) -> Any:
    """What is at ``module:name``; importing its module runs it."""
    try:
        return pkgutil.resolve_name(target)
    except (Exception, SystemExit) as error:  # importing runs foreign code
        allowed = "'module:name' of something that can be imported"
        reason = str(error) or type(error).__name__
        raise refusal(thing, target, allowed, f"correct it: {reason}") from error


def place_of(value: Any) -> Any:
    """The place ``module:name`` of a class or function, or the value where it has none."""
    target = f"{getattr(value, '__module__', '')}:{getattr(value, '__qualname__', '')}"
    try:
        return target if pkgutil.resolve_name(target) is value else value
    except (ImportError, AttributeError, ValueError):
        return value
