"""The page of `auv-fault calibrate`: parameters, why some are not identified, and errors."""

from collections.abc import Sequence
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
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.section import mistakes_section
from training.field.calibration.robust_fit import LARGEST_STD
from training.field.calibration.samples import BLOCK, Samples
from training.field.logs.log import Log
from training.field.logs.remarks import remark_rows
from training.report.cells import counted
from training.report.lines import rounded
from training.report.sections import Section, figure_section, table_section

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
    findings: Sequence[Finding],
) -> dict[str, Any]:
    """The report as plain data."""
    parameters = [calibration.parameter(name) for name in NAMES]
    sections = [
        mistakes_section(findings),
        fitted_section([parameter for parameter in parameters if np.isfinite(parameter.std)]),
        unidentified_section([parameter for parameter in parameters if parameter.why]),
        left_out_section(logs, left_out),
        readings_section(logs[0].name, samples, calibration),
        missions_section(calibration) if len(logs) > 1 else None,
        sides_section(calibration),
        noise_section(samples, calibration),
        remarks_section(logs),
    ]
    intro = (
        "Surge is fitted by predictions of the speed one sample ahead, which model the "
        "disturbance; the motors are fitted by the relation of voltage, current and shaft speed. "
        f"Intervals are 95 %, from leaving out each block of {BLOCK:g} s in turn. The calibrated "
        "vehicle is vehicle.toml."
    )
    return {
        "title": f"Calibration of {calibration.vehicle.vehicle.name}",
        "summary": summary(logs, samples, parameters, findings),
        "intro": [intro],
        "sections": [section for section in sections if section],
    }


def summary(
    logs: Sequence[Log],
    samples: Samples,
    parameters: Sequence[ParameterFit],
    findings: Sequence[Finding],
) -> list[str]:
    """What was fitted, how well, and whether a mistake is likely."""
    duration = len(samples.starts) * SAMPLE_TIME
    fitted = {one.name: _half_width(one) for one in parameters if np.isfinite(one.std)}
    missing = [one.name for one in parameters if one.why]
    sentences = [
        f"{counted(len(logs), 'healthy log')}, {duration:.0f} s in all: "
        f"{counted(len(fitted), 'parameter')} fitted."
    ]
    if missing:
        sentences.append(f"Not identified, they keep the file's value: {', '.join(missing)}.")
    if fitted:
        best = min(fitted, key=fitted.__getitem__)
        worst = max(fitted, key=fitted.__getitem__)
        sentences.append(
            f"{best} is known best, to ± {fitted[best]:.1f} % (95 %), {worst} least, to "
            f"± {fitted[worst]:.1f} %."
        )
    if findings:
        doubts = ", ".join(dict.fromkeys(one.subject for one in findings))
        sentences.append(f"Mistakes are likely, settle them first: {doubts}.")
    return sentences


def _half_width(parameter: ParameterFit) -> float:
    """Half of the interval, per cent of the value."""
    return 50 * (parameter.high - parameter.low) / abs(parameter.value)


def fitted_section(parameters: Sequence[ParameterFit]) -> Section:
    """The fitted parameters with their intervals."""
    columns = ["parameter", "value", "95 % interval", "half-width", "in the file"]
    columns += ["healthy band", "unit"]
    text = (
        "Intervals hold with the other parameters as in the file. The healthy band says how far a "
        "healthy mission may be from the value: the variation between missions beyond the errors "
        f"of their estimates, averaged with the file's band, which counts as {PRIOR_UNITS:g} "
        "missions, and the error of the value itself. propeller_torque is a factor on C1 and C2; "
        "beta is that of all shafts together."
    )
    rows = [_fitted_row(parameter) for parameter in parameters]
    return table_section("Fitted parameters", columns, rows, text)


def _fitted_row(parameter: ParameterFit) -> list[str]:
    return [
        parameter.name,
        f"{parameter.value:.4g}",
        f"{parameter.low:.4g} to {parameter.high:.4g}",
        f"± {_half_width(parameter):.1f} %",
        f"{parameter.before:.4g}",
        f"± {100 * parameter.band:.1f} %" if parameter.band else "",
        parameter.unit,
    ]


def unidentified_section(parameters: Sequence[ParameterFit]) -> Section | None:
    """The parameters that the logs do not identify, with reasons."""
    if not parameters:
        return None
    text = (
        "These keep the file's value: fitted with the others, their standard deviation would be "
        f"above {100 * LARGEST_STD:.0f} %, or the readings for it were not logged. The fitted "
        "parameters depend on them."
    )
    columns = ["parameter", "file's value", "why", "what would help"]
    rows = [[fit.name, f"{fit.value:.4g}", fit.why, fit.remedy] for fit in parameters]
    return table_section("Not identified", columns, rows, text)


def left_out_section(logs: Sequence[Log], left_out: Sequence[LeftOut]) -> Section:
    """Each mission predicted by the fit to the others; a sentence for a single one."""
    heading = "Leaving one mission out"
    if not left_out:
        text = (
            "There is one mission only, so that none can be left out, and nothing shows how well "
            "the fit predicts another: name more logs."
        )
        return {"heading": heading, "text": [text]}
    kinds = [kind for kind in KINDS if any(kind in row.error for row in left_out)]
    text = (
        "Root mean square of reading minus simulation on a mission, by the fit to all missions / "
        "by the fit to the others. The speed is simulated from the shaft speeds over the whole "
        "mission, so the disturbance is in its error; shaft speed and current are simulated from "
        "the voltage."
    )
    units = [f"{kind} [{UNITS[kind]}]" for kind in kinds]
    rows = [_left_out_row(logs[row.mission].name, row, kinds) for row in left_out]
    columns = ["mission", *units, "largest change"]
    return table_section(heading, columns, rows, text)


def _left_out_row(mission: str, row: LeftOut, kinds: Sequence[str]) -> list[str]:
    name, change = max(row.changes.items(), key=lambda item: abs(item[1]))
    errors = [
        f"{row.error[kind]:.4g} / {row.error_without[kind]:.4g}" if kind in row.error else ""
        for kind in kinds
    ]
    return [mission, *errors, f"{name} {100 * change:+.1f} %"]


def readings_section(log: str, samples: Samples, calibration: Calibration) -> Section | None:
    """Measured and simulated readings of the first mission, whose log has this name."""
    mission = samples.where(samples.mission == 0)
    simulated = simulated_readings(mission, calibration.vehicle)
    if not simulated:
        return None
    shown = _shown_samples(mission)
    panels = {}
    for name, values in simulated.items():
        label = f"{name.replace('_', ' ')} [{CHANNELS[name].unit}]"
        measured = mission.channel(name)
        panels[label] = {
            "measured": rounded(measured[shown]),
            "simulated": rounded(values[shown]),
        }
    caption = f"{log}: readings, the calibrated model, and the difference."
    data = {"time": rounded(SAMPLE_TIME * shown), "panels": panels}
    return figure_section("Fit", "measured_and_simulated", "fit", caption, data)


def _shown_samples(mission: Samples) -> np.ndarray:
    """Indices of at most `POINTS` samples; of a slow log those with a reading."""
    n_samples = len(mission.starts)
    shown = np.arange(0, n_samples, -(-n_samples // POINTS))
    has_value = np.isfinite(mission.reading).any(axis=1)
    if has_value[shown].mean() >= 0.5:
        return shown
    readings = mission.reading[:, -len(READINGS) :]
    return np.flatnonzero(np.isfinite(readings).any(axis=1))[:POINTS]


def missions_section(calibration: Calibration) -> Section | None:
    """Estimates by mission."""
    panels = {}
    for name in NAMES:
        band = calibration.parameter(name).band
        if calibration.is_fitted(name) and band:
            panels[name] = {
                "band": band,
                "sides": _estimates_by_side(calibration, name),
            }
    if not panels:
        return None
    heading = "How much the missions differ"
    caption = "Each mission's own estimate against the common one, and the healthy band."
    section = figure_section(heading, "mission_estimates", "missions", caption, {"panels": panels})
    text = "Missions whose readings do not identify a parameter are left out."
    return section | {"text": [text]}


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
                "value": rounded(value[is_shown]),
                "std": rounded(std[is_shown]),
            }
    return by_side


def sides_section(calibration: Calibration) -> Section | None:
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
    return table_section("Port against starboard", columns, rows, text)


def noise_section(samples: Samples, calibration: Calibration) -> Section:
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
    columns = [
        "reading",
        "noise",
        "in the file",
        "residual",
        "means by mission",
        "unit",
    ]
    return table_section("Noise and residuals", columns, rows, text)


def _residual_cells(errors: np.ndarray | None, mission: np.ndarray) -> list[str]:
    if errors is None or not np.isfinite(errors).any():
        return ["", ""]
    is_known = np.isfinite(errors)
    known = errors[is_known]
    mission = mission[is_known]
    means = [known[mission == number].mean() for number in np.unique(mission)]
    ends = f"{min(means):+.2g} to {max(means):+.2g}" if len(means) > 1 else f"{means[0]:+.2g}"
    return [f"{np.sqrt(np.mean(known**2)):.3g}", ends]


def remarks_section(logs: Sequence[Log]) -> Section | None:
    """What was repaired in the logs."""
    rows = remark_rows((log.name, remark) for log in logs for remark in log.remarks)
    text = "What was repaired in the logs before the fit."
    return table_section(REPAIRS, ["repair", "logs"], rows, text) if rows else None


def plain(
    calibration: Calibration, left_out: Sequence[LeftOut], logs: Sequence[Log]
) -> dict[str, Any]:
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
