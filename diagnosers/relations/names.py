"""The residuals of a vehicle's relations in words."""

from diagnosers.relations.windows import BALANCE, PUSH

NAMES = {PUSH: "drag", BALANCE: "difference of the voltages"}


def name_of(residual: str) -> str:
    """What has changed where a residual is not zero.

    >>> name_of("push"), name_of("port_load")
    ('drag', 'port load')
    """
    return NAMES.get(residual, residual.replace("_", " "))


def sign_of(residual: str) -> float:
    """The sign with which a residual counts in words: less net force is more drag."""
    return -1.0 if residual == PUSH else 1.0
