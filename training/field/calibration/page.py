"""The page of `auv-fault calibrate`: what was fitted, what was not and why, and how well the model predicts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SAMPLE_TIME, SIDES
from training.field.calibration import motor_fit
from training.field.calibration.calibration import NAMES, Calibration, Estimate, side_differences
from training.field.calibration.checks import KINDS, LeftOut, errors, simulated
from training.field.calibration.healthy_band import PRIOR_UNITS
from training.field.calibration.robust_fit import LARGEST_STD
from training.field.calibration.samples import BLOCK, Samples
from training.field.logs.log import Log

POINTS = 1500  # of a figure's line
REPAIRS = "Repairs"
UNITS = {"speed": "m/s", "rpm": "rpm", "current": "A"}
# relative standard deviation of a mission's own estimate; poorer ones are not drawn
LARGEST_OWN = 0.5


def page(
    logs: Sequence[Log], samples: Samples, calibration: Calibration, left_out: Sequence[LeftOut]
) -> dict[str, Any]:
    """The report as plain data."""
    estimates = [calibration.estimate(name) for name in NAMES]
    sections = [
        parameters([one for one in estimates if np.isfinite(one.std)]),
        unidentified([one for one in estimates if one.why]),
        left_out_section(logs, left_out),
        fits(logs, samples, calibration),
        missions(calibration),
        sides(calibration),
        noise(samples, calibration),
        repairs(logs),
    ]
    seconds = len(samples.starts) * SAMPLE_TIME
    return {
        "title": f"Calibration of {calibration.vehicle.vehicle.name}",
        "intro": [
            f"{len(logs)} healthy logs, {seconds:.0f} s. Surge is fitted by one-sample predictions of the speed that "
            "know of the disturbance, the motors by what voltage, current and shaft speed must have in common. "
            f"Intervals are 95 %, from leaving out one block of {BLOCK:g} s after the other. The calibrated vehicle is "
            "vehicle.toml.",
        ],
        "sections": [section for section in sections if section],
    }


def parameters(estimates: Sequence[Estimate]) -> dict[str, Any]:
    """What was fitted."""
    rows = [
        [
            one.name,
            f"{one.value:.4g}",
            f"{one.low:.4g} to {one.high:.4g}",
            f"± {50 * (one.high - one.low) / abs(one.value):.1f} %",
            f"{one.before:.4g}",
            f"± {100 * one.band:.1f} %" if one.band else "",
            one.unit,
        ]
        for one in estimates
    ]
    return {
        "heading": "Fitted parameters",
        "text": [
            "Intervals hold with what was not fitted as it is in the file. The healthy band is how far a healthy "
            "mission may be from the value: the spread between missions beyond the errors of their estimates, averaged "
            f"with the file's band, which counts as {PRIOR_UNITS:g} missions, and the error of the value itself. "
            "propeller_torque is a factor on C1 and C2; beta is that of all shafts together."
        ],
        "table": {
            "columns": [
                "parameter",
                "value",
                "95 % interval",
                "half-width",
                "in the file",
                "healthy band",
                "unit",
            ],
            "rows": rows,
        },
    }


def unidentified(estimates: Sequence[Estimate]) -> dict[str, Any] | None:
    """What the logs do not tell."""
    rows = [[one.name, f"{one.value:.4g}", one.why, one.remedy] for one in estimates]
    return rows and {
        "heading": "Not identified",
        "text": [
            "These keep the file's value: fitted together with the others, their standard deviation would be above "
            f"{100 * LARGEST_STD:.0f} %, or what it takes was not logged. The fitted ones rest on them."
        ],
        "table": {"columns": ["parameter", "kept value", "why", "what would help"], "rows": rows},
    }


def left_out_section(logs: Sequence[Log], left_out: Sequence[LeftOut]) -> dict[str, Any]:
    """Each mission predicted by the fit to the others."""
    kinds = [kind for kind in KINDS if any(kind in row.error for row in left_out)]
    rows = []
    for row in left_out:
        name, change = max(row.changes.items(), key=lambda item: abs(item[1]))
        cells = [
            f"{row.error[kind]:.4g} / {row.error_without[kind]:.4g}" if kind in row.error else ""
            for kind in kinds
        ]
        rows.append([logs[row.mission].name, *cells, f"{name} {100 * change:+.1f} %"])
    text = (
        "Root mean square of reading minus simulation on a mission, by the fit to all / by the fit to the others. The "
        "speed is simulated from the shaft speeds over the whole mission, so the disturbance is in it; shaft speed and "
        "current from the voltage."
    )
    return {
        "heading": "Leaving one mission out",
        "text": [
            text if rows else "There is one mission only, so nothing to leave out: give more logs."
        ],
        "table": {
            "columns": [
                "mission",
                *(f"{kind} [{UNITS[kind]}]" for kind in kinds),
                "largest change",
            ],
            "rows": rows,
        },
    }


def fits(logs: Sequence[Log], samples: Samples, calibration: Calibration) -> dict[str, Any] | None:
    """Measured and simulated readings of the first mission."""
    alone = samples.of(samples.mission == 0)
    at = simulated(alone, calibration.vehicle)
    chosen = np.arange(0, len(alone.starts), -(-len(alone.starts) // POINTS))
    # a slow log: what was read, not what lies between
    if np.isfinite(alone.reading).any(axis=1)[chosen].mean() < 0.5:
        chosen = np.flatnonzero(np.isfinite(alone.reading[:, 4:]).any(axis=1))[:POINTS]
    panels = {
        f"{name.replace('_', ' ')} [{CHANNELS[name].unit}]": {
            "measured": _series(alone.channel(name)[chosen]),
            "simulated": _series(values[chosen]),
        }
        for name, values in at.items()
    }
    return panels and {
        "heading": "Fit",
        "text": [],
        "figures": [
            {
                "plot": "measured_and_simulated",
                "name": "fit",
                "caption": f"{logs[0].name}: readings, what the calibrated model makes of them, and the difference.",
                "data": {"time": _series(SAMPLE_TIME * chosen), "panels": panels},
            }
        ],
    }


def _series(values: np.ndarray) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]


def missions(calibration: Calibration) -> dict[str, Any] | None:
    """Estimates by mission."""
    panels = {
        name: {"band": calibration.estimate(name).band, "sides": _by_side(calibration, name)}
        for name in NAMES
        if name in calibration.part(name).fit.names and calibration.estimate(name).band
    }
    return panels and {
        "heading": "How much the missions differ",
        "text": ["Missions that tell nothing of a parameter by themselves are left out."],
        "figures": [
            {
                "plot": "mission_estimates",
                "name": "missions",
                "caption": "Each mission's own estimate against the common one, and the healthy band.",
                "data": {"panels": panels},
            }
        ],
    }


def _by_side(calibration: Calibration, name: str) -> dict[str, dict[str, list]]:
    fit = calibration.part(name).fit
    k = fit.names.index(name)
    value = fit.own[:, k] / fit.estimate[k] - 1.0
    std = np.sqrt(fit.own_variance[:, k]) / abs(fit.estimate[k])
    if name in motor_fit.PARAMETERS:
        groups = {
            side: (fit.units % len(SIDES) == number, fit.units // len(SIDES))
            for number, side in enumerate(SIDES)
        }
    else:
        groups = {"all shafts": (np.full(value.size, True), fit.units)}
    telling = {
        side: (chosen & (std < LARGEST_OWN), mission) for side, (chosen, mission) in groups.items()
    }
    return {
        side: {
            "mission": (mission[one] + 1).tolist(),
            "value": _series(value[one]),
            "std": _series(std[one]),
        }
        for side, (one, mission) in telling.items()
        if one.any()
    }


def sides(calibration: Calibration) -> dict[str, Any] | None:
    """Port against starboard."""
    rows = [
        [name, f"{100 * difference:+.1f} %", f"{100 * std:.1f} %"]
        for name, (difference, std) in side_differences(calibration).items()
    ]
    return rows and {
        "heading": "Port against starboard",
        "text": ["Both shafts are fitted as one; what they differ by is part of the healthy band."],
        "table": {
            "columns": ["parameter", "port minus starboard", "standard deviation"],
            "rows": rows,
        },
    }


def noise(samples: Samples, calibration: Calibration) -> dict[str, Any]:
    """Noise of the sensors, and residuals by channel."""
    left = errors(samples, calibration.vehicle)
    rows = []
    for name in filter(samples.exists, calibration.vehicle.noise):
        levels = [f"{file.noise[name]:.3g}" for file in (calibration.vehicle, calibration.before)]
        rows.append(
            [name, *levels, *_residual(left.get(name), samples.mission), CHANNELS[name].unit]
        )
    return {
        "heading": "Noise and residuals",
        "text": [
            "Noise is the standard deviation of a reading, from second differences. The residual is reading minus "
            "simulation as above: its root mean square, and the range of its mean over the missions."
        ],
        "table": {
            "columns": ["reading", "noise", "in the file", "residual", "means by mission", "unit"],
            "rows": rows,
        },
    }


def _residual(values: np.ndarray | None, mission: np.ndarray) -> list[str]:
    known = values is not None and np.isfinite(values)
    if not np.any(known):
        return ["", ""]
    means = [values[known & (mission == one)].mean() for one in np.unique(mission[known])]
    return [
        f"{np.sqrt(np.mean(values[known] ** 2)):.3g}",
        f"{min(means):+.2g} to {max(means):+.2g}",
    ]


def repairs(logs: Sequence[Log]) -> dict[str, Any] | None:
    """What was repaired while reading."""
    rows = [[log.name, line] for log in logs for line in log.remarks]
    return rows and {
        "heading": REPAIRS,
        "text": ["What was repaired in the logs before they were used."],
        "table": {"columns": ["log", "repair"], "rows": rows},
    }


def plain(
    calibration: Calibration, left_out: Sequence[LeftOut], logs: Sequence[Log]
) -> Mapping[str, Any]:
    """All figures by name, for results.json; None for what is not known."""
    estimates = {}
    for name in NAMES:
        values = calibration.estimate(name)._asdict()
        estimates[name] = {key: _known(value) for key, value in values.items() if key != "name"}
    rows = [row._asdict() | {"mission": logs[row.mission].name} for row in left_out]
    noise_levels = dict(calibration.vehicle.noise)
    return {
        "estimates": estimates,
        "leave_one_out": rows,
        "noise": noise_levels,
        "band": dict(calibration.vehicle.band),
    }


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
