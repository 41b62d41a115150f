"""Texts of the live page: the belief, the advice and the truth, in words for an operator."""

import math

from auv_fault_env.faults import NORMAL, UNKNOWN, classes
from auv_fault_env.parameters import PARAMETERS
from diagnosers.advisory import Advice, Quantiles
from training.live.history import History
from training.live.session import Truth

NEGLIGIBLE = 1e-3  # probability below which words stand for the number
LEAST_SHOWN = 0.05  # probability from which a fault is named, and its severity shown
LEAST_NUMBER = 1e-4  # below which a number would be shown as a power
HIDDEN_TRUTH = "hidden: the switch “show the truth” shows the faults of the vehicle"


def belief_text(history: History) -> str:
    """How probable it is that the vehicle is healthy, the likeliest fault, and its severity.

    A fault below `LEAST_SHOWN` is not named; `unknown` has no severity.
    """
    probability = history.probability[-1]
    index = history.likeliest_fault
    name = classes()[index]
    healthy = f"healthy: {likelihood(probability[0])}"
    if probability[index] < LEAST_SHOWN:
        return f"{healthy} · no fault is likely"
    fault = f"{name}: {likelihood(probability[index])}"
    if name == UNKNOWN:
        return f"{healthy} · {fault}"
    mean, low, high = (values[-1] for values in history.severity(index))
    return f"{healthy} · {fault}, severity {mean:.2f} ({low:.2f}–{high:.2f})"


def likelihood(probability: float) -> str:
    """A probability as a number that can be read, or as words where it is all or nothing.

    >>> likelihood(0.034), likelihood(3e-9), likelihood(0.0), likelihood(0.99999)
    ('3.4 %', 'practically excluded', 'practically excluded', 'practically certain')
    """
    if probability < NEGLIGIBLE:
        return "practically excluded"
    if probability > 1.0 - NEGLIGIBLE:
        return "practically certain"
    return f"{100 * probability:.1f} %"


def advice_text(advice: Advice) -> str:
    """The reason of the advice, and what the vehicle can still reach."""
    lines = advice.reason[0].split("; ")
    lines += [
        f"reachable speed: {_quantiles_text(advice.reachable_speed, 'm/s', 2)}",
        f"energy at the mission speed: {_quantiles_text(advice.energy_per_metre, 'J/m', 1)}",
        f"range at the mission speed: {_quantiles_text(advice.range, 'm', 0)}",
        f"range home: {_quantiles_text(advice.range_home, 'm', 0)}",
    ]
    return "\n".join(lines)


def _quantiles_text(quantiles: Quantiles, unit: str, decimals: int) -> str:
    values = (float(each[0]) for each in quantiles)
    low, median, high = (
        f"{value:.{decimals}f}" if math.isfinite(value) else "unlimited" for value in values
    )
    return f"{median} {unit} ({low}–{high})"


def truth_text(truth: Truth) -> str:
    """The faults of the vehicle, and the parameters that they have changed."""
    if truth.label == NORMAL:
        return "The vehicle is healthy."
    lines = [f"{name}, severity {severity:.2f}" for name, severity in truth.severity.items()]
    for name, (healthy, faulty) in truth.parameters.items():
        lines.append(f"{name}: {_change_text(healthy, faulty, PARAMETERS[name].unit)}")
    return "\n".join(lines)


def _change_text(healthy: float, faulty: float, unit: str) -> str:
    """The change of a parameter: relative, or in its unit if the healthy value is zero."""
    if healthy:
        return f"{100 * faulty / healthy:.0f} % of the healthy value"
    if abs(faulty) < LEAST_NUMBER:
        return "no longer zero"
    return f"{faulty:.3g} {unit} instead of 0".replace(" 1 ", " ")
