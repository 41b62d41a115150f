"""What the live page says in words: the belief, the advice, the truth."""

from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.parameters import PARAMETERS
from diagnosers.advisory import Advice, Quantiles
from training.live.history import History
from training.live.session import Truth


def believed(history: History) -> str:
    """How probable it is that nothing is wrong, the likeliest fault, and its severity."""
    probability = history.probability[-1]
    index = history.suspect
    mean, low, high = (values[-1] for values in history.severity(index))
    fault = f"likeliest fault {classes()[index]} {percent(probability[index])}"
    return f"p(normal) {percent(probability[0])} · {fault} · severity {mean:.2f} ({low:.2f}–{high:.2f})"


def percent(probability: float) -> str:
    """In words that do not round a small chance to none.

    >>> percent(0.034), percent(3e-9), percent(0.0), percent(0.99999)
    ('3.4 %', '3e-09', 'below 1e-99', '100.0 %')
    """
    if probability < 1e-99:
        return "below 1e-99"
    return f"{100 * probability:.1f} %" if probability >= 1e-3 else f"{probability:.0e}"


def advised(advice: Advice) -> str:
    """Why this is advised, and what the vehicle can still do."""
    figures = {
        "reachable speed": _spread(advice.reachable_speed, "m/s", 2),
        "energy at the mission's speed": _spread(advice.energy_per_metre, "J/m", 1),
        "range at the mission's speed": _spread(advice.range, "m", 0),
        "range home": _spread(advice.range_home, "m", 0),
    }
    return "\n".join(
        (*advice.reason[0].split("; "), *(f"{name}: {figure}" for name, figure in figures.items()))
    )


def _spread(spread: Quantiles, unit: str, decimals: int) -> str:
    low, middle, high = (f"{float(values[0]):.{decimals}f}" for values in spread)
    return f"{middle} {unit} ({low}–{high})"


def true(truth: Truth) -> str:
    """What is wrong with the vehicle, and which of its parameters are no longer healthy."""
    if truth.label == NORMAL:
        return "The vehicle is healthy."
    faults = [f"{name}, severity {severity:.2f}" for name, severity in truth.severity.items()]
    changes = [
        f"{name}: {now:.3g} instead of {healthy:.3g} {PARAMETERS[name].unit}".removesuffix(" 1")
        for name, (healthy, now) in truth.parameters.items()
    ]
    return "\n".join((*faults, *changes))
