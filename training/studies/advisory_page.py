"""The page of ``python -m training.studies.advisory``: how the missions ended, made from its results alone."""

from collections.abc import Mapping
from typing import Any

from training.report.cells import number, percent, with_interval
from training.studies.mission_runs import ARMS, OUTCOMES

Results = Mapping[str, Any]
QUANTITIES = {
    "completed": ("completed [%]", 100.0),
    "stranded": ("stranded [%]", 100.0),
    "energy": ("energy [kJ]", 1.0),
    "duration": ("duration [min]", 1.0),
}


def page(results: Results) -> dict[str, Any]:
    """Title, introduction and sections."""
    return {
        "title": "What it saves to follow the advice",
        "command": results["command"],
        "intro": _intro(results),
        "sections": [_ends(results), _differences(results), _classes(results), _limits()],
    }


def _intro(results: Results) -> list[str]:
    drawn = {name: f"{low:g} to {high:g}" for name, (low, high) in results["drawn"].items()}
    return [
        f"{results['missions']} missions with a fault of hull or propulsion, as many with one of a sensor, and as many "
        "without; every class equally likely, severity 0.2 to 1, abrupt or ramped; default noise, disturbance and "
        f"spread of vehicles, seeds of tests only. Mission speed {drawn['speed']} m/s, whole way {drawn['length']} m, "
        f"of which the share {drawn['gone']} is gone when the simulation begins, at most half a minute before the "
        f"fault; the battery holds {drawn['reserve']} times what a healthy vehicle needs for the rest; hotel load "
        f"{results['hotel_load']:g} W; current against the way {drawn['current']} m/s.",
        "Each mission is sailed to its end on the plant three times, with the same vehicle, fault and noise: the "
        f"advice ignored; followed, by the belief of {results['diagnoser']}, which watches until a minute after the "
        "latest onset and whose belief is kept from then on; and given by one who is told class and severity. Advice "
        "comes once a second while the diagnoser watches, once a minute later. A guidance holds the speed asked for.",
    ]


def _ends(results: Results) -> dict[str, Any]:
    rows = [
        [
            part,
            arm,
            *(
                with_interval(*_scaled(so[name], factor), 1)
                for name, (_, factor) in QUANTITIES.items()
            ),
            *(percent(so["outcomes"][name]) for name in ("came home", "aborted")),
            number(so["energy_by_completed"], 1, "none completed"),
            f"{so['changes']:.2f}",
        ]
        for part, arms in results["parts"].items()
        for arm, so in arms.items()
    ]
    columns = ["missions", "advice", *(label for label, _ in QUANTITIES.values())]
    columns += ["came home", "aborted", "energy by completed mission [kJ]", "changes of the action"]
    panels = {
        part: {arm: so["outcomes"] for arm, so in arms.items()}
        for part, arms in results["parts"].items()
    }
    caption = "How the missions ended: with the advice ignored, followed, and with the truth told."
    return {
        "heading": "How the missions ended",
        "text": [
            "Completed: the goal was reached. Came home: it turned and got back. Aborted: it stopped where it was, "
            "with energy left, to be picked up. Stranded: its battery ran out on the way; all others are recovered. "
            "Energy is that of motors and hotel load. Means with 95 % bootstrap intervals over missions; an interval "
            f"of nothing means none of {results['missions']}, which a true share of up to "
            f"{300.0 / results['missions']:.1f} % can give."
        ],
        "table": {"columns": columns, "rows": rows},
        "figures": [
            {
                "plot": "outcome_shares",
                "name": "outcomes",
                "caption": caption,
                "data": {"panels": panels, "names": OUTCOMES},
            }
        ],
    }


def _scaled(value: list[float], factor: float) -> tuple[float, list[float]]:
    return factor * value[0], [factor * end for end in value[1:]]


def _differences(results: Results) -> dict[str, Any]:
    rows = [
        [
            part,
            against,
            *(
                with_interval(*_scaled(so[name], factor), 1, "+")
                for name, (_, factor) in QUANTITIES.items()
            ),
        ]
        for part, differences in results["differences"].items()
        for against, so in differences.items()
    ]
    return {
        "heading": "What following it changes",
        "text": [
            "On the same missions, with 95 % paired bootstrap intervals. Energy falls where missions are broken off, "
            "too: read it beside the missions completed. On healthy vehicles any loss is the price of false or "
            "overcautious advice."
        ],
        "table": {
            "columns": ["missions", "advice", *(label for label, _ in QUANTITIES.values())],
            "rows": rows,
        },
    }


def _classes(results: Results) -> dict[str, Any]:
    rows = [
        [name, str(results["counts"][name])]
        + [percent(by_arm[arm][end]) for end in ("reached the goal", "stranded") for arm in ARMS]
        for name, by_arm in results["kinds"].items()
    ]
    columns = [
        "fault",
        "missions",
        *(f"{end}, {arm}" for end in ("completed", "stranded") for arm in ARMS),
    ]
    return {
        "heading": "By fault",
        "text": [
            "Few missions stand behind each row: read them for the pattern, not for the figure."
        ],
        "table": {"columns": columns, "rows": rows},
    }


def _limits() -> dict[str, Any]:
    return {
        "heading": "What this does not show",
        "text": [
            "The figures hang on the reserve: with a battery three times too large hardly any fault matters, with "
            "none to spare nothing helps. A fault strikes once and stays. The diagnoser watches 60 s after the latest "
            "onset, not the whole mission, so false alarms of a long mission are not in the healthy vehicles' figures. "
            "The current is steady and known, the way is straight, and a vehicle that stops is found.",
        ],
    }
