"""The page of ``python -m training.studies.advisory``, made from its results alone."""

from collections.abc import Mapping
from typing import Any

from training.report.cells import number, percent, with_interval
from training.report.sections import figure, table_section
from training.studies.mission_runs import ARMS, FOLLOWED, IGNORED, OUTCOMES, TRUTH_KNOWN

Results = Mapping[str, Any]
# column and factor from the unit of the results
QUANTITIES = {
    "completed": ("completed [%]", 100.0),
    "stranded": ("stranded [%]", 100.0),
    "energy": ("energy [kJ]", 1.0),
    "duration": ("duration [min]", 1.0),
}
QUANTITY_COLUMNS = [column for column, _ in QUANTITIES.values()]


def page(results: Results) -> dict[str, Any]:
    """Title, command, introduction and sections."""
    return {
        "title": "What following the advice saves",
        "command": results["command"],
        "summary": _summary(results),
        "intro": _intro(results),
        "sections": [
            _ends(results),
            _differences(results),
            _classes(results),
            _limits(),
        ],
    }


def _summary(results: Results) -> list[str]:
    """What following the advice changes for each kind of mission."""
    sentences = [
        f"{results['missions']} missions each with a fault of hull or propulsion, with a sensor "
        "fault and without fault were flown with the advice ignored and followed."
    ]
    for part, arms in results["parts"].items():
        ends = [
            f"{100 * arms[arm]['completed'][0]:.0f} % completed, "
            f"{100 * arms[arm]['stranded'][0]:.0f} % stranded"
            for arm in (IGNORED, FOLLOWED)
        ]
        sentences.append(
            f"{part[0].upper()}{part[1:]}: {ends[0]} when ignored; {ends[1]} when followed."
        )
    return [*sentences, "Advice is good where fewer are stranded and as many completed."]


def _intro(results: Results) -> list[str]:
    ranges = {name: f"{low:g} to {high:g}" for name, (low, high) in results["drawn"].items()}
    missions = (
        f"{results['missions']} missions with a fault of hull or propulsion, as many with a sensor "
        "fault, and as many without fault. Every class is equally likely; severity is 0.2 to 1, "
        "abrupt or ramped. Noise, disturbance and healthy band are the defaults; all seeds are "
        f"those of tests. The mission speed is {ranges['speed']} m/s and the length "
        f"{ranges['length']} m; the share {ranges['gone']} of it lies behind the vehicle when the "
        "simulation begins, at most half a minute before the fault. The battery holds "
        f"{ranges['reserve']} times what a healthy vehicle needs for the rest. The hotel load is "
        f"{results['hotel_load']:g} W, the opposing current {ranges['current']} m/s."
    )
    arms = (
        "Each mission is simulated to its end three times with the same vehicle, fault and noise: "
        "with the advice ignored; with the advice followed, from the belief of "
        f"{results['diagnoser']}, which runs until a minute after the latest onset and whose last "
        "belief counts from then on; and with advice from the true class and severity. Advice "
        "comes once a second while the diagnoser runs, and once a minute later. A guidance holds "
        "the advised speed."
    )
    return [missions, arms]


def _shown(name: str) -> str:
    """The name of an arm, or of a difference of arms, in the words of the page."""
    return name.replace(TRUTH_KNOWN, "truth known")


def _ends(results: Results) -> dict[str, Any]:
    rows = [
        [
            part,
            _shown(arm),
            *_quantity_cells(figures),
            *(percent(figures["outcomes"][name]) for name in ("came home", "aborted")),
            number(figures["energy_by_completed"], 1, "none completed"),
            f"{figures['changes']:.2f}",
        ]
        for part, arms in results["parts"].items()
        for arm, figures in arms.items()
    ]
    columns = ["missions", "advice", *QUANTITY_COLUMNS, "came home", "aborted"]
    columns += ["energy by completed mission [kJ]", "changes of the action"]
    panels = {
        part: {_shown(arm): figures["outcomes"] for arm, figures in arms.items()}
        for part, arms in results["parts"].items()
    }
    caption = "Ends of the missions: advice ignored, followed, and from the truth."
    data = {"panels": panels, "names": OUTCOMES}
    missions = results["missions"]
    text = (
        "Completed: the vehicle reached the goal. Came home: it turned and got back. Aborted: it "
        "stopped with energy left, to be picked up. Stranded: its battery ran out on the way; all "
        "other vehicles are recovered. Energy is that of motors and hotel load. Means have 95 % "
        f"bootstrap intervals over missions; an interval of 0 means none of {missions} missions, "
        f"which is possible up to a true share of {300.0 / missions:.1f} %."
    )
    section = table_section("How the missions ended", columns, rows, text)
    return section | {"figures": [figure("outcome_shares", "outcomes", caption, data)]}


def _quantity_cells(triples: Mapping[str, list[float]], sign: str = "") -> list[str]:
    cells = []
    for name, (_, factor) in QUANTITIES.items():
        value, *ends = (factor * element for element in triples[name])
        cells.append(with_interval(value, ends, 1, sign))
    return cells


def _differences(results: Results) -> dict[str, Any]:
    rows = [
        [part, _shown(arms), *_quantity_cells(triples, "+")]
        for part, differences in results["differences"].items()
        for arms, triples in differences.items()
    ]
    text = (
        "On the same missions, with 95 % paired bootstrap intervals. Energy also falls where "
        "missions are broken off: compare it with the completed missions. On healthy vehicles any "
        "loss is the cost of false or overcautious advice."
    )
    columns = ["missions", "advice", *QUANTITY_COLUMNS]
    return table_section("What following the advice changes", columns, rows, text)


def _classes(results: Results) -> dict[str, Any]:
    ends = {"completed": "reached the goal", "stranded": "stranded"}
    columns = ["fault", "missions"]
    columns += [f"{end}, {_shown(arm)}" for end in ends for arm in ARMS]
    rows = []
    for name, arms in results["kinds"].items():
        shares = [percent(arms[arm][outcome]) for outcome in ends.values() for arm in ARMS]
        rows.append([name, str(results["counts"][name]), *shares])
    text = "Each row rests on few missions: single figures are uncertain."
    return table_section("By fault", columns, rows, text)


def _limits() -> dict[str, Any]:
    text = (
        "The figures depend on the reserve: with a battery three times too large hardly any fault "
        "matters, without reserve no advice helps. Each mission has one lasting fault. The "
        "diagnoser runs until 60 s after the latest onset, not during the whole mission; the "
        "figures of healthy vehicles therefore lack the false alarms of a long mission. The "
        "current is constant and known, the way is straight, and a vehicle that stops is found."
    )
    return {"heading": "What this does not show", "text": [text]}
