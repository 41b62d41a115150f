"""The sections of the benchmark's page on what a diagnoser does where it should not be sure."""

from collections.abc import Iterator, Mapping
from typing import Any

from training.benchmark.page_figures import BenchmarkView
from training.benchmark.scores import RANKED_AT, Score
from training.report.cells import number, percent, row_name, with_interval
from training.report.sections import figure_section, table_section

ONSETS = ("abrupt", "ramped")


def scored(view: BenchmarkView) -> Iterator[tuple[list[str], Score]]:
    """Diagnoser and stimulus as the first cells of a row, with their score."""
    for name in view.names:
        for stimulus, scores in view.scores.items():
            yield [row_name(name, view.references), stimulus], scores[name]


def alarms_by_age(view: BenchmarkView) -> dict[str, Any]:
    """False alarms per hour by age and by quarter of the mission."""
    ages: dict[str, None] = {}
    for _, score in scored(view):
        ages |= dict.fromkeys(_age_names(score["false_alarms_by_age"]))
    rows = []
    for start, score in scored(view):
        by_age = score["false_alarms_by_age"]
        cells = dict(zip(_age_names(by_age), _age_cells(by_age), strict=True))
        quarters = score["false_alarms_by_quarter"]["alarms"]
        rows.append(
            [
                *start,
                percent(score["time_in_alarm"]),
                *(cells.get(age, "–") for age in ages),
                ", ".join(map(str, quarters)),
            ]
        )
    headings = [f"per hour, {age} min" for age in ages]
    return table_section(
        "Do false alarms grow with the age of the mission?",
        ["diagnoser", "stimulus", "time in alarm", *headings, "alarms by quarter"],
        rows,
        "On the healthy vehicles on which false alarms are counted, at one false alarm per hour: "
        "the share of the time during which an alarm stands, the false alarms per hour by the "
        "minutes since the start of the mission, with Poisson intervals, and their numbers in "
        "the four quarters of the missions. A rate that grows with age means that a diagnoser "
        "becomes too certain of the vehicle.",
    )


def _age_names(by_age: Mapping[str, Any]) -> list[str]:
    return [
        f"from {first:g}" if last is None else f"{first:g}–{last:g}"
        for first, last in zip(by_age["from"], by_age["to"], strict=True)
    ]


def _age_cells(by_age: Mapping[str, Any]) -> list[str]:
    columns = by_age["alarms"], by_age["hours"], by_age["per_hour_interval"]
    return [
        with_interval(alarms / hours, interval, 2)
        for alarms, hours, interval in zip(*columns, strict=True)
    ]


def abrupt_and_ramped(view: BenchmarkView) -> dict[str, Any]:
    """Times of abrupt and of ramped faults apart."""
    rows = []
    for start, score in scored(view):
        cells = []
        for times in (score["isolation_by_onset"], score["detection_by_onset"]):
            cells += [_time_cell(times[kind]) for kind in ONSETS]
        rows.append(start + cells)
    columns = [f"{what}, {kind} [s]" for what in ("isolation", "detection") for kind in ONSETS]
    return table_section(
        "Abrupt and ramped faults",
        ["diagnoser", "stimulus", *columns],
        rows,
        "Restricted means from the onset. A ramped fault begins with severity 0, so that there "
        "is nothing to see at its onset.",
    )


def _time_cell(times: Mapping[str, Any] | None) -> str:
    return "–" if times is None else with_interval(times["restricted_mean"], times["interval"], 2)


def declared(view: BenchmarkView) -> dict[str, Any]:
    """What is declared of the faulty vehicles."""
    rows = []
    for start, score in scored(view):
        shares = score["declared"]
        cells = [percent(shares[key]) for key in ("right", "wrong", "unknown", "never")]
        time = with_interval(shares["time_to_right"], shares["time_to_right_interval"], 2)
        rows.append([*start, *cells, time])
    return table_section(
        "What is declared?",
        ["diagnoser", "stimulus", "right", "wrong", "unknown", "never", "time to right [s]"],
        rows,
        "A fault is declared when one class first has a probability of 0.9 or more for one "
        "second; the first declaration of a vehicle stands. One before the onset is wrong, and "
        "one after the horizon is none. Unknown: that no known fault explains the readings was "
        "declared of a known fault. No alarm is needed. The time counts from the onset, all that "
        "is not right with the horizon.",
    )


def abstention(view: BenchmarkView) -> dict[str, Any]:
    """Risk against coverage."""

    def line(score: Score) -> tuple[Any, Any]:
        curve = score["abstention"]
        return curve["coverage"], curve["risk_at"]

    data = {
        "panels": view.lines(line),
        "references": list(view.references),
        "labels": ("share of the beliefs that name a class", "share of these that are wrong"),
        "top": 1.0,
    }
    caption = (
        "Share of wrong classes if only the surest beliefs at random instants name one. A "
        "diagnoser that knows when it is wrong has a low line on the left."
    )
    heading = "Does a diagnoser know when it is wrong?"
    section = figure_section(heading, "curves", "risk-coverage", caption, data)
    rows = []
    for start, score in scored(view):
        curve = score["abstention"]
        rows.append([*start, f"{curve['area']:.4f}", percent(curve["risk"])])
    columns = ["diagnoser", "stimulus", "area under the line", "wrong of all"]
    section["table"] = {"columns": columns, "rows": rows}
    return section


def naming(view: BenchmarkView) -> dict[str, Any] | None:
    """What faults outside the catalogue, and double faults, are called; None if there are none."""
    rows = []
    for start, score in scored(view):
        named = score["naming"]
        if named is None:
            return None
        shares = [number(named[key], 3, "–") for key in ("right", "unknown", "surely_wrong")]
        rows.append([*start, str(named["lanes"]), percent(named["alarmed"]), *shares])
    columns = ["unknown or right component", "unknown", "wrong with p > 0.9"]
    return table_section(
        "What are faults called that no class describes?",
        ["diagnoser", "stimulus", "vehicles", "with an alarm", *columns],
        rows,
        "Faults outside the catalogue, and two faults at once. The last three columns are shares "
        "of the vehicles with an alarm, at the horizon: the most probable fault is `unknown` or "
        "belongs to a component that fails; it is `unknown`; it belongs to another component and "
        f"has a probability above 0.9. Alarms at a threshold for one false alarm in {RANKED_AT}.",
    )
