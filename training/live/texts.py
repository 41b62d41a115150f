"""Texts of the live page: the belief, the advice and the truth."""

from auv_fault_env.faults import NORMAL, UNKNOWN, classes
from auv_fault_env.parameters import PARAMETERS
from diagnosers.advisory import Advice, Quantiles
from training.live.history import History
from training.live.session import Truth


def belief_text(history: History) -> str:
    """Probability of `normal`, the likeliest fault, and its severity if it is a known one."""
    probability = history.probability[-1]
    index = history.likeliest_fault
    name = classes()[index]
    normal = f"p(normal) {percent(probability[0])}"
    fault = f"likeliest fault {name} {percent(probability[index])}"
    if name == UNKNOWN:
        return f"{normal} · {fault}"
    mean, low, high = (values[-1] for values in history.severity(index))
    return f"{normal} · {fault} · severity {mean:.2f} ({low:.2f}–{high:.2f})"


def percent(probability: float) -> str:
    """A probability as text that does not round a small one to zero.

    >>> percent(0.034), percent(3e-9), percent(0.0), percent(0.99999)
    ('3.4 %', '3e-09', 'below 1e-99', '100.0 %')
    """
    if probability < 1e-99:
        return "below 1e-99"
    return f"{100 * probability:.1f} %" if probability >= 1e-3 else f"{probability:.0e}"


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
    low, median, high = (f"{float(values[0]):.{decimals}f}" for values in quantiles)
    return f"{median} {unit} ({low}–{high})"


def truth_text(truth: Truth) -> str:
    """The faults of the vehicle, and the parameters that they have changed."""
    if truth.label == NORMAL:
        return "The vehicle is healthy."
    lines = [f"{name}, severity {severity:.2f}" for name, severity in truth.severity.items()]
    for name, (healthy, faulty) in truth.parameters.items():
        change = f"{name}: {faulty:.3g} instead of {healthy:.3g} {PARAMETERS[name].unit}"
        lines.append(change.removesuffix(" 1"))
    return "\n".join(lines)
