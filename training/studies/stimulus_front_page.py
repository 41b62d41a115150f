"""The page of ``python -m training.studies.stimulus_front``, from its results alone."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

from training.report.cells import percent, with_interval
from training.report.colours import COLOURS
from training.report.sections import figure_section, table_section

Results = Mapping[str, Any]
KNOWN_ONSET = "known_onset"
NOT_ITS_COST = "–"
COST_LABELS = {
    "rms": "offset on healthy vehicles, RMS [m/s]",
    "energy": "energy added on healthy vehicles [J/m]",
}


def page(results: Results) -> dict[str, Any]:
    """Title, introduction, command and sections."""
    return {
        "title": "Stimuli at equal cost",
        "summary": summary(results),
        "intro": introduction(results),
        "command": results["command"],
        "sections": [
            front_table(results),
            front_figure(results),
            equal_cost_table(results),
            cost_table(results, "healthy"),
            cost_table(results, "faulty"),
            rate_table(results),
        ],
    }


def summary(results: Results) -> list[str]:
    """Which stimuli are on the front, and the soonest of them beside the thesis' stimulus."""
    rate = _rate(results)
    competing = [point for point in results["points"] if point["stimulus"] != KNOWN_ONSET]
    front = [point for point in competing if point["fronts"]["rms"]]
    names = ", ".join(dict.fromkeys(point["stimulus"] for point in front))
    best = min(front, key=lambda point: point["rates"][rate]["isolation"]["mean"][0])
    isolation = best["rates"][rate]["isolation"]
    return [
        f"{len(competing)} points, stimuli at several strengths, were compared by isolation time "
        "and by what they cost healthy vehicles.",
        f"No other point costs less and is sooner than those of {names}.",
        f"The soonest of them, {best['stimulus']} at {best['strength']:.3g} m/s, isolates in "
        f"{_triple(isolation['mean'])} s: {_triple(isolation['ratio'])} of the time under the "
        f"thesis' stimulus, for an offset of {best['healthy']['rms']:.3f} m/s on healthy vehicles.",
    ]


def introduction(results: Results) -> list[str]:
    """How to read the page."""
    lanes = results["lanes"]
    vehicles = (
        f"{lanes['faulty']} vehicles of the suite {results['suite']['name']} with a fault of "
        f"{', '.join(results['classes'])}; {lanes['counting']} healthy ones for cost and false "
        f"alarms; {lanes['threshold']} others, {results['hours']:g} h, for the thresholds, which "
        "each point has for itself. All run for as long as a faulty one. Isolation times are "
        "restricted means: faults that are not isolated in time count with the horizon."
    )
    costs = (
        "Costs are relative to the passive run, `cruise`, on the same vehicles. The root mean "
        "square of the offset on healthy vehicles is the cost that counts: faults are rare. "
        "Intervals are 95 % paired bootstrap intervals over vehicles. "
        f"`{KNOWN_ONSET}` knows the onset and does not compete."
    )
    return [vehicles, costs]


def _rate(results: Results) -> str:
    """The rate of false alarms at which points are ranked."""
    return next(iter(results["points"][0]["rates"]))


def _triple(triple: Sequence[float], sign: str = "") -> str:
    return with_interval(triple[0], triple[1:], 2, sign)


def _place(point: Mapping[str, Any], key: str = "rms") -> str:
    if point["stimulus"] == KNOWN_ONSET:
        return "does not compete"
    return "on the front" if point["fronts"][key] else "dominated"


def front_table(results: Results) -> dict[str, Any]:
    """Isolation and healthy cost of every point."""
    rate = _rate(results)
    rows = []
    for point in sorted(results["points"], key=lambda one: one["healthy"]["rms"]):
        at_rate = point["rates"][rate]
        isolation = at_rate["isolation"]
        rows.append(
            [
                point["stimulus"],
                f"{point['strength']:.3g}",
                f"{point['healthy']['rms']:.3f}",
                _triple(isolation["mean"]),
                _triple(isolation["ratio"]),
                _place(point),
                _triple(isolation["difference"], "+"),
                f"{at_rate['detection']:.2f}",
                percent(at_rate["isolated"]),
                _place(point, "energy"),
            ]
        )
    columns = ["stimulus", "budget [m/s]", "healthy RMS [m/s]", "isolation [s]", "× thesis"]
    columns += ["by RMS", "minus thesis [s]", "detection [s]", "isolated", "by energy"]
    text = (
        f"At one false alarm per {rate}. A point is dominated if another costs less and is sooner."
    )
    return table_section("Front", columns, rows, text)


def front_figure(results: Results) -> dict[str, Any]:
    """Isolation against healthy cost."""
    rate = _rate(results)
    points = [
        {
            "stimulus": point["stimulus"],
            "isolation": point["rates"][rate]["isolation"]["ratio"],
            "costs": [point["healthy"][key] for key in COST_LABELS],
            "on_front": [point["fronts"][key] for key in COST_LABELS],
        }
        for point in results["points"]
        if point["stimulus"] != KNOWN_ONSET
    ]
    with_onset = [point for point in results["points"] if point["stimulus"] == KNOWN_ONSET]
    best = min(point["rates"][rate]["isolation"]["ratio"][0] for point in with_onset)
    names = dict.fromkeys(point["stimulus"] for point in points)
    data = {
        "points": points,
        "labels": list(COST_LABELS.values()),
        "known_onset": best,
        "colours": dict(zip(names, cycle(COLOURS), strict=False)),
    }
    caption = (
        f"Isolation time at one false alarm per {rate} as a share of that under `thesis`, with its "
        "paired interval, against what a stimulus costs healthy vehicles; down and left is better. "
        "Filled points are on the front, hollow ones are dominated. A line joins the strengths of "
        "a stimulus. Dashed: onset known, its best."
    )
    return figure_section("Isolation against cost", "stimulus_front", "front", caption, data)


def equal_cost_table(results: Results) -> dict[str, Any]:
    """Isolation of every stimulus at the same healthy costs."""
    by_stimulus = results["equal_cost"]
    costs = list(next(iter(by_stimulus.values())))
    rows = []
    for name, of_cost in by_stimulus.items():
        ratios = [_triple(one["ratio"]) if one else NOT_ITS_COST for one in of_cost.values()]
        rows.append([name, *ratios])
    text = (
        "Isolation time at a healthy cost (root mean square of the offset) as a share of that of "
        "`thesis` at its strength, with its interval. Between two strengths it is that of a "
        "vehicle that takes one of both by chance for each mission."
    )
    columns = ["stimulus", *(f"{cost} m/s" for cost in costs)]
    return table_section("At equal healthy cost", columns, rows, text)


def cost_table(results: Results, part: str) -> dict[str, Any]:
    """What every point costs on healthy or on faulty vehicles."""
    rows = []
    for point in results["points"]:
        cost = point[part]
        rows.append(
            [
                point["stimulus"],
                f"{point['strength']:.3g}",
                f"{cost['rms']:.3f}",
                f"{cost['rms_without_mean']:.3f}",
                f"{cost['energy']:+.2f} ({100.0 * cost['energy_share']:+.1f} %)",
                f"{cost['time']:+.0f} ({100.0 * cost['time_share']:+.1f} %)",
            ]
        )
    columns = ["stimulus", "budget [m/s]", "RMS [m/s]", "without its mean", "energy [J/m]"]
    heading = f"What it costs {part} vehicles"
    return table_section(heading, [*columns, "time of arrival [s/km]"], rows)


def rate_table(results: Results) -> dict[str, Any]:
    """Isolation and the ratio to the known onset at every rate of false alarms."""
    rates = list(results["points"][0]["rates"])
    rows = []
    for point in results["points"]:
        row = [point["stimulus"], f"{point['strength']:.3g}"]
        for rate in rates:
            at_rate = point["rates"][rate]
            mark = " *" if at_rate["is_extrapolated"] else ""
            row += [
                f"{at_rate['isolation']['mean'][0]:.2f}{mark}",
                _triple(at_rate["of_known_onset"]),
            ]
        counted = point["rates"][rates[0]]["false_alarms"]
        row.append(" + ".join(str(one["count"]) for one in counted))
        rows.append(row)
    hours = results["points"][0]["rates"][rates[0]]["false_alarms"][0]["hours"]
    text = (
        f"Isolation time [s] and its ratio to that of `{KNOWN_ONSET}` at the same rate of false "
        "alarms. "
        "* The hours do not suffice to count so few alarms; the threshold is extrapolated with an "
        "exponential tail of the lowest log p(normal) of each vehicle. The last column: false "
        f"alarms on the {hours:.1f} h of healthy vehicles that set no threshold, at one per "
        f"{rates[0]}."
    )
    columns = ["stimulus", "budget [m/s]"]
    for rate in rates:
        columns += [f"one per {rate} [s]", f"× {KNOWN_ONSET}"]
    heading = "At fewer false alarms"
    return table_section(heading, [*columns, "false alarms"], rows, text)
