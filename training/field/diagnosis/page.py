"""The page of ``auv-fault diagnose``: a row per log, and figures of some logs."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from diagnosers.relations.names import name_of
from diagnosers.relations.windows import DURATION, PUSH
from diagnosers.residuals import LASTING, PERSISTENT, PERSISTENT_PUSH, Residuals
from training.field.diagnosis.diagnosis import FAULT, HEALTHY, THRESHOLDS, UNUSABLE, Verdict
from training.field.logs.remarks import remark_rows
from training.field.vehicle_file import VehicleFile
from training.report.cells import counted, distinct_names, probability, signed_percent
from training.report.sections import Section, table_section

LEAST_PROBABILITY = 1e-3  # of a class in the table
N_FAULTS = 2  # faults in the summary
POOR_FIT = "the fit of this vehicle is poor, alarms on healthy logs are likely"
DRAG = name_of(PUSH)
VERDICTS = "Verdicts"
DETAILS = "Logs in detail"
REPAIRS = "Repairs"


class Setting(NamedTuple):
    """With what the logs were diagnosed."""

    command: str
    diagnoser: str
    why: str  # this diagnoser
    threshold: float  # of log p(normal)
    vehicle: VehicleFile
    has_load_limits: bool = False
    weights: Path | None = None  # file of the diagnoser's own ones


def page(
    setting: Setting, verdicts: Sequence[Verdict], figures: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """The report as plain data; figures are those of `log_figure`."""
    names = distinct_names([verdict.log for verdict in verdicts])
    named = list(zip(names, verdicts, strict=True))
    sections = [verdicts_section(named)]
    alarmed = [(name, verdict) for name, verdict in named if verdict.alarms]
    if alarmed:
        sections += [alarms_section(setting, alarmed), last_alarm_section(alarmed)]
    sections += [details_section(setting, figures), repairs_section(named)]
    return {
        "title": "Diagnosis",
        "command": setting.command,
        "summary": summary(setting, named),
        "intro": intro(setting),
        "sections": sections,
    }


def summary(setting: Setting, named: Sequence[tuple[str, Verdict]]) -> list[str]:
    """How many logs have a fault, which, and what to think of the others."""
    counts = Counter(verdict.verdict for _, verdict in named)
    parts = [f"{counts[FAULT]} with a fault", f"{counts[HEALTHY]} healthy"]
    if counts[UNUSABLE]:
        parts.append(f"{counts[UNUSABLE]} unusable")
    minutes = sum(verdict.duration or 0.0 for _, verdict in named) / 60.0
    sentences = [
        f"{counted(len(named), 'log')}, {minutes:.1f} minutes in all, diagnosed by "
        f"`{setting.diagnoser}`, {setting.why}: {', '.join(parts)}."
    ]
    faulty = [(name, verdict) for name, verdict in named if verdict.alarms]
    sentences += [_fault_sentence(name, verdict) for name, verdict in faulty[:N_FAULTS]]
    if len(faulty) > N_FAULTS:
        sentences.append("The table of the verdicts has the other logs with a fault.")
    if setting.vehicle.poor_fit:
        sentences.append(f"Do not trust a verdict: {POOR_FIT}: {setting.vehicle.poor_fit}.")
    if counts[HEALTHY]:
        sentences.append(
            "Healthy means that no alarm was raised; small faults, and those of parts at rest, "
            "raise none."
        )
    return sentences


def _fault_sentence(name: str, verdict: Verdict) -> str:
    """The fault of a log in one sentence."""
    severity = _severity(verdict)
    of_severity = f", severity {severity} of 0 to 1" if severity else ""
    n_alarms = len(verdict.alarms)
    more = f"; {n_alarms} alarms in all" if n_alarms > 1 else ""
    return f"{name}: `{verdict.fault}` from {verdict.alarm_time:.1f} s on{of_severity}{more}."


def intro(setting: Setting) -> list[str]:
    """What an alarm is, and when the class misleads."""
    of_shafts = "the load of the shafts says"
    if setting.vehicle.relations is not None:
        of_shafts = "the indicators (drag, loads, voltages) say"
    warning = (
        "A fault outside the catalogue is `unknown`, or gets the class with the most similar "
        f"readings. Then {of_shafts} more than the class: independent of the catalogue."
    )
    return [meaning_of_alarm(setting), warning]


def meaning_of_alarm(setting: Setting) -> str:
    """What raises an alarm, and where its threshold comes from."""
    if setting.diagnoser == Residuals.name:
        relations = setting.vehicle.relations
        has_drag = relations is not None and PUSH in relations.layout.residuals
        of_drag = f" (the drag: for {PERSISTENT_PUSH})" if has_drag else ""
        return (
            f"An alarm is a residual of the vehicle's own relations that stays beyond its limit "
            f"for {PERSISTENT} windows of {DURATION:g} s, a second apart{of_drag}, or the median "
            f"of {LASTING} windows beyond its limit (`lasting`), or more zeros or repeated values "
            "of a reading than in healthy logs. Limits are beyond all that the healthy logs "
            "reached, by a margin."
        )
    usual = THRESHOLDS[setting.diagnoser]
    origin = "at which simulated healthy vehicles raise one false alarm per hour"
    if setting.weights is not None:
        origin += " with the weights of the package"
    if setting.threshold < usual:
        without = probability(math.exp(usual))
        origin = f"the lowest on the healthy logs (without them it is {without})"
    loads = ""
    if setting.has_load_limits:
        loads = " So is a load of a shaft beyond those of the healthy logs (`load limit`)."
    return (
        f"An alarm is a probability of `normal` below {probability(math.exp(setting.threshold))} "
        f"for three readings in a row, {origin}.{loads}"
    )


def verdicts_section(named: Sequence[tuple[str, Verdict]]) -> Section:
    """A row per log; a column without an entry is left out."""
    columns: dict[str, Callable[[Verdict], str]] = {
        "verdict": lambda verdict: verdict.verdict,
        "alarm at [s]": _alarm_time,
        "fault": lambda verdict: verdict.fault or "",
        "severity (95 %)": _severity,
        "raised by": lambda verdict: verdict.raised_by[-1].text if verdict.raised_by else "",
        "beyond its limit": _beyond_limit,
        "load of the shaft": _loads,
    }
    cells = {title: [cell(verdict) for _, verdict in named] for title, cell in columns.items()}
    shown = {title: column for title, column in cells.items() if any(column)}
    rows = zip((name for name, _ in named), *shown.values(), strict=True)
    text = (
        "`alarm at` is when the first alarm began, from the log's start; the columns after it are "
        "of the last alarm."
    )
    return table_section(VERDICTS, ["log", *shown], [list(row) for row in rows], text)


def _alarm_time(verdict: Verdict) -> str:
    return "" if verdict.alarm_time is None else f"{verdict.alarm_time:.1f}"


def _severity(verdict: Verdict) -> str:
    if verdict.severity is None:
        return ""
    return f"{verdict.severity:.2f} ({verdict.severity_low:.2f}–{verdict.severity_high:.2f})"


def _beyond_limit(verdict: Verdict) -> str:
    if verdict.raised_by and verdict.raised_by[-1].value is not None:
        return ""
    beyond = {
        name: one["value"]
        for name, one in (verdict.indicators or {}).items()
        if abs(one["value"]) > one["limit"]
    }
    return ", ".join(f"{name} {signed_percent(value)}" for name, value in beyond.items())


def _loads(verdict: Verdict) -> str:
    if verdict.indicators is not None:
        return ""
    return ", ".join(f"{side} {load:+.0%}" for side, load in (verdict.load or {}).items())


def alarms_section(setting: Setting, alarmed: Sequence[tuple[str, Verdict]]) -> Section:
    """A row per alarm."""
    rows = [
        [name, f"{cause.begin:.1f}", f"{cause.end:.1f}", cause.fault, cause.text]
        for name, verdict in alarmed
        for cause in verdict.raised_by
    ]
    columns = ["log", "from [s]", "to [s]", "fault", "raised by"]
    text = ["The fault is the most probable one at the end of the alarm."]
    if setting.diagnoser == Residuals.name:
        text.append(
            "`raised by` is what was farthest beyond its limit when the alarm began; its value is "
            "the median over the part of the alarm in which it was beyond."
        )
    return table_section("Alarms", columns, rows, *text)


def last_alarm_section(alarmed: Sequence[tuple[str, Verdict]]) -> Section:
    """The indicators in the last alarm of each log, and its most probable faults."""
    indicators = dict.fromkeys(name for _, one in alarmed for name in one.indicators or {})
    rows = [
        [name, *(_indicator(verdict, of) for of in indicators), _most_probable(verdict)]
        for name, verdict in alarmed
    ]
    columns = ["log", *indicators, "most probable faults"]
    text = []
    if indicators:
        text.append(
            "Indicators are relative to what the relations of the vehicle predict: median ± std of "
            "a healthy vehicle (healthy band), of one window; the limit of a lasting change is "
            "narrower."
        )
        if DRAG in indicators:
            text.append(f"{DRAG.capitalize()}: the force that lacks; lost thrust looks the same.")
    return table_section("In the last alarm", columns, rows, *text)


def _indicator(verdict: Verdict, name: str) -> str:
    """Value, std and limit of an indicator."""
    one = (verdict.indicators or {}).get(name)
    if one is None:
        return ""
    std = 100.0 * one["std"]
    limit = 100.0 * one["limit"]
    value = signed_percent(one["value"]).removesuffix(" %")
    return f"{value} ± {std:.0f} % (±{limit:.0f} %)"


def _most_probable(verdict: Verdict) -> str:
    return ", ".join(
        f"{name} {share:.2g}" for name, share in verdict.top if share > LEAST_PROBABILITY
    )


def repairs_section(named: Sequence[tuple[str, Verdict]]) -> Section:
    """What was repaired in the logs, and why some are unusable."""
    rows = remark_rows((name, remark) for name, verdict in named for remark in verdict.remarks)
    if not rows:
        return {"heading": REPAIRS, "text": ["No log had to be repaired."]}
    text = "What was repaired or is odd in a log, or why it is unusable."
    return table_section(REPAIRS, ["remark", "logs"], rows, text)


def details_section(setting: Setting, figures: Sequence[dict[str, Any]]) -> Section:
    """The figures of some logs."""
    text = ["Faulty logs first. Dotted: currents of healthy motors by the model of the vehicle."]
    if setting.vehicle.relations is None:
        text.append("Estimates: ± 1 std.")
    else:
        text.append(
            "Drag, loads and voltages are relative to what the relations predict from the other "
            "readings, in windows of "
            f"{DURATION:g} s while the vehicle is under way: ± 1 std of a healthy "
            "vehicle, with the healthy band in grey."
        )
    return {"heading": DETAILS, "text": [" ".join(text)], "figures": list(figures)}
