"""The page of `auv-fault calibrate`: parameters, why some are not identified, and errors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.parameters import SAMPLE_TIME, SIDES
from training.field.calibration import motor_fit
from training.field.calibration.calibration import (
    NAMES,
    Calibration,
    ParameterFit,
    side_differences,
)
from training.field.calibration.checks import (
    KINDS,
    LeftOut,
    prediction_errors,
    simulated_readings,
)
from training.field.calibration.healthy_band import PRIOR_UNITS
from training.field.calibration.robust_fit import LARGEST_STD
from training.field.calibration.samples import BLOCK, Samples
from training.field.logs.log import Log

POINTS = 1500  # of a figure's line
REPAIRS = "Repairs"
UNITS = {"speed": "m/s", "rpm": "rpm", "current": "A"}
# relative standard deviation of a mission's own estimate; poorer ones are not shown
LARGEST_MISSION_STD = 0.5


def page(
    logs: Sequence[Log],
    samples: Samples,
    calibration: Calibration,
    left_out: Sequence[LeftOut],
) -> dict[str, Any]:
    """The report as plain data."""
    parameters = [calibration.parameter(name) for name in NAMES]
    sections = [
        fitted_section([parameter for parameter in parameters if np.isfinite(parameter.std)]),
        unidentified_section([parameter for parameter in parameters if parameter.why]),
        left_out_section(logs, left_out),
        readings_section(logs, samples, calibration),
        missions_section(calibration),
        sides_section(calibration),
        noise_section(samples, calibration),
        remarks_section(logs),
    ]
    duration = len(samples.starts) * SAMPLE_TIME
    intro = (
        f"{len(logs)} healthy logs, {duration:.0f} s. Surge is fitted by predictions of the speed "
        "one sample ahead, which model the disturbance; the motors are fitted by the relation of "
        "voltage, current and shaft speed. Intervals are 95 %, from leaving out each block of "
        f"{BLOCK:g} s in turn. The calibrated vehicle is vehicle.toml."
    )
    return {
        "title": f"Calibration of {calibration.vehicle.vehicle.name}",
        "intro": [intro],
        "sections": [section for section in sections if section],
    }


def fitted_section(parameters: Sequence[ParameterFit]) -> dict[str, Any]:
    """The fitted parameters with their intervals."""
    columns = ["parameter", "value", "95 % interval", "half-width", "in the file"]
    text = (
        "Intervals hold with the other parameters as in the file. The healthy band says how far a "
        "healthy mission may be from the value: the variation between missions beyond the errors "
        f"of their estimates, averaged with the file's band, which counts as {PRIOR_UNITS:g} "
        "missions, and the error of the value itself. propeller_torque is a factor on C1 and C2; "
        "beta is that of all shafts together."
    )
    table = {
        "columns": [*columns, "healthy band", "unit"],
        "rows": [_fitted_row(parameter) for parameter in parameters],
    }
    return {"heading": "Fitted parameters", "text": [text], "table": table}


def _fitted_row(parameter: ParameterFit) -> list[str]:
    half_width = 50 * (parameter.high - parameter.low) / abs(parameter.value)
    return [
        parameter.name,
        f"{parameter.value:.4g}",
        f"{parameter.low:.4g} to {parameter.high:.4g}",
        f"± {half_width:.1f} %",
        f"{parameter.before:.4g}",
        f"± {100 * parameter.band:.1f} %" if parameter.band else "",
        parameter.unit,
    ]


def unidentified_section(parameters: Sequence[ParameterFit]) -> dict[str, Any] | None:
    """The parameters that the logs do not identify, with reasons."""
    if not parameters:
        return None
    rows = [
        [parameter.name, f"{parameter.value:.4g}", parameter.why, parameter.remedy]
        for parameter in parameters
    ]
    text = (
        "These keep the file's value: fitted with the others, their standard deviation would be "
        f"above {100 * LARGEST_STD:.0f} %, or the readings for it were not logged. The fitted "
        "parameters depend on them."
    )
    columns = ["parameter", "file's value", "why", "what would help"]
    table = {"columns": columns, "rows": rows}
    return {"heading": "Not identified", "text": [text], "table": table}


def left_out_section(logs: Sequence[Log], left_out: Sequence[LeftOut]) -> dict[str, Any]:
    """Each mission predicted by the fit to the others."""
    kinds = [kind for kind in KINDS if any(kind in row.error for row in left_out)]
    text = (
        "Root mean square of reading minus simulation on a mission, by the fit to all missions / "
        "by the fit to the others. The speed is simulated from the shaft speeds over the whole "
        "mission, so the disturbance is in its error; shaft speed and current are simulated from "
        "the voltage."
    )
    if not left_out:
        text = "There is one mission only, so that none can be left out: name more logs."
    units = [f"{kind} [{UNITS[kind]}]" for kind in kinds]
    rows = [_left_out_row(logs[row.mission].name, row, kinds) for row in left_out]
    return {
        "heading": "Leaving one mission out",
        "text": [text],
        "table": {"columns": ["mission", *units, "largest change"], "rows": rows},
    }


def _left_out_row(
    mission: str,
    row: LeftOut,
    kinds: Sequence[str],
) -> list[str]:
    name, change = max(row.changes.items(), key=lambda item: abs(item[1]))
    errors = [
        f"{row.error[kind]:.4g} / {row.error_without[kind]:.4g}" if kind in row.error else ""
        for kind in kinds
    ]
    return [mission, *errors, f"{name} {100 * change:+.1f} %"]


def readings_section(
    logs: Sequence[Log],
    samples: Samples,
    calibration: Calibration,
) -> dict[str, Any] | None:
    """Measured and simulated readings of the first mission."""
    mission = samples.where(samples.mission == 0)
    simulated = simulated_readings(mission, calibration.vehicle)
    if not simulated:
        return None
    shown = _shown_samples(mission)
    panels = {}
    for name, values in simulated.items():
        label = f"{name.replace('_', ' ')} [{CHANNELS[name].unit}]"
        measured = mission.channel(name)
        panels[label] = {"measured": _series(measured[shown]), "simulated": _series(values[shown])}
    figure = {
        "plot": "measured_and_simulated",
        "name": "fit",
        "caption": f"{logs[0].name}: readings, the calibrated model, and the difference.",
        "data": {"time": _series(SAMPLE_TIME * shown), "panels": panels},
    }
    return {"heading": "Fit", "text": [], "figures": [figure]}


def _shown_samples(mission: Samples) -> np.ndarray:
    """Indices of at most `POINTS` samples; of a slow log those with a reading."""
    n_samples = len(mission.starts)
    shown = np.arange(0, n_samples, -(-n_samples // POINTS))
    has_value = np.isfinite(mission.reading).any(axis=1)
    if has_value[shown].mean() >= 0.5:
        return shown
    readings = mission.reading[:, -len(READINGS) :]
    return np.flatnonzero(np.isfinite(readings).any(axis=1))[:POINTS]


def _series(values: np.ndarray) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]


def missions_section(calibration: Calibration) -> dict[str, Any] | None:
    """Estimates by mission."""
    panels = {}
    for name in NAMES:
        band = calibration.parameter(name).band
        if calibration.is_fitted(name) and band:
            panels[name] = {"band": band, "sides": _estimates_by_side(calibration, name)}
    if not panels:
        return None
    figure = {
        "plot": "mission_estimates",
        "name": "missions",
        "caption": "Each mission's own estimate against the common one, and the healthy band.",
        "data": {"panels": panels},
    }
    text = "Missions whose readings do not identify a parameter are left out."
    return {"heading": "How much the missions differ", "text": [text], "figures": [figure]}


def _estimates_by_side(calibration: Calibration, name: str) -> dict[str, dict[str, list]]:
    fit = calibration.model_fit(name).fit
    k = fit.names.index(name)
    value = fit.unit_estimates[:, k] / fit.estimate[k] - 1.0
    std = np.sqrt(fit.unit_variances[:, k]) / abs(fit.estimate[k])
    if name in motor_fit.PARAMETERS:
        mission = fit.units // len(SIDES)
        members = {side: fit.units % len(SIDES) == k for k, side in enumerate(SIDES)}
    else:
        mission = fit.units
        members = {"all shafts": np.full(value.size, True)}
    by_side = {}
    for side, is_member in members.items():
        is_shown = is_member & (std < LARGEST_MISSION_STD)
        if is_shown.any():
            by_side[side] = {
                "mission": (mission[is_shown] + 1).tolist(),
                "value": _series(value[is_shown]),
                "std": _series(std[is_shown]),
            }
    return by_side


def sides_section(calibration: Calibration) -> dict[str, Any] | None:
    """Port against starboard."""
    differences = side_differences(calibration)
    if not differences:
        return None
    rows = [
        [name, f"{100 * difference:+.1f} %", f"{100 * std:.1f} %"]
        for name, (difference, std) in differences.items()
    ]
    columns = ["parameter", "port minus starboard", "standard deviation"]
    text = "Both shafts are fitted as one; their difference is part of the healthy band."
    return {
        "heading": "Port against starboard",
        "text": [text],
        "table": {"columns": columns, "rows": rows},
    }


def noise_section(samples: Samples, calibration: Calibration) -> dict[str, Any]:
    """Noise of the sensors, and residuals by channel."""
    errors = prediction_errors(samples, calibration.vehicle)
    rows = []
    for name in filter(samples.has, calibration.vehicle.noise):
        after = f"{calibration.vehicle.noise[name]:.3g}"
        before = f"{calibration.before.noise[name]:.3g}"
        residual = _residual_cells(errors.get(name), samples.mission)
        rows.append([name, after, before, *residual, CHANNELS[name].unit])
    text = (
        "Noise is the standard deviation of a reading, from second differences. The residual is "
        "reading minus simulation as above: its root mean square, and the range of its mean over "
        "the missions."
    )
    columns = ["reading", "noise", "in the file", "residual", "means by mission", "unit"]
    table = {"columns": columns, "rows": rows}
    return {"heading": "Noise and residuals", "text": [text], "table": table}


def _residual_cells(errors: np.ndarray | None, mission: np.ndarray) -> list[str]:
    if errors is None or not np.isfinite(errors).any():
        return ["", ""]
    is_known = np.isfinite(errors)
    means = [
        errors[is_known & (mission == number)].mean() for number in np.unique(mission[is_known])
    ]
    rms = np.sqrt(np.mean(errors[is_known] ** 2))
    return [f"{rms:.3g}", f"{min(means):+.2g} to {max(means):+.2g}"]


def remarks_section(logs: Sequence[Log]) -> dict[str, Any] | None:
    """What was repaired in the logs."""
    rows = [[log.name, remark] for log in logs for remark in log.remarks]
    if not rows:
        return None
    return {
        "heading": REPAIRS,
        "text": ["What was repaired in the logs before the fit."],
        "table": {"columns": ["log", "repair"], "rows": rows},
    }


def plain(
    calibration: Calibration,
    left_out: Sequence[LeftOut],
    logs: Sequence[Log],
) -> Mapping[str, Any]:
    """All results by name, for results.json; None for unknown numbers."""
    estimates = {}
    for name in NAMES:
        values = calibration.parameter(name)._asdict()
        del values["name"]
        estimates[name] = {key: _finite_or_none(value) for key, value in values.items()}
    return {
        "estimates": estimates,
        "leave_one_out": [row._asdict() | {"mission": logs[row.mission].name} for row in left_out],
        "noise": dict(calibration.vehicle.noise),
        "band": dict(calibration.vehicle.band),
    }


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
