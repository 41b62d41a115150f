"""The sections with figures of the page of ``python -m training.studies.stimuli``."""

from collections.abc import Iterator, Mapping
from itertools import cycle
from typing import Any

from training.report.colours import COLOURS
from training.report.sections import figure, figure_section
from training.stimuli.open_loop import Cruise
from training.studies.stimulus_comparisons import (
    AGENT,
    LEARNED,
    REFERENCES,
    pareto_front,
    speed_up,
    without_single_seeds,
)

Results = Mapping[str, Any]
COST_LABELS = {
    "speed_rms": "RMS deviation from the mission speed [m/s]",
    "energy": "energy [J per episode]",
}
# label and beginning of the caption
OFFSET_KINDS = {
    "mean": ("mean offset [m/s]", "Mean offset"),
    "absolute": ("mean absolute offset [m/s]", "Mean absolute offset"),
}


def colours(results: Results) -> dict[str, str]:
    """A colour for every stimulus, the same for all seeds of the agent and their mean."""
    names: dict[str, None] = {}
    for of_budget in results["budgets"].values():
        names |= dict.fromkeys(of_budget["figures"][results["diagnoser"]]["all"])
    assigned = dict(zip(without_single_seeds(names), cycle(COLOURS), strict=False))
    return assigned | {name: assigned[AGENT] for name in names if LEARNED.fullmatch(name)}


def by_class(results: Results) -> dict[str, Any]:
    """How many times sooner each class is isolated."""
    text = (
        "Restricted mean under the reference divided by that under the stimulus, with "
        f"{results['diagnoser']}."
    )
    classes = results["classes"]
    figures = []
    for budget, of_budget in results["budgets"].items():
        measured = of_budget["figures"][results["diagnoser"]]
        panels: dict[str, Any] = {}
        for reference in reversed(REFERENCES):
            panels[reference] = {
                stimulus: [
                    speed_up(measured[name][stimulus]["ratio"][reference]) for name in classes
                ]
                for stimulus in without_single_seeds(measured["all"])
                if stimulus not in (Cruise.name, reference)
            }
        caption = (
            f"How many times sooner each class is isolated within {budget} m/s; right of the "
            "dashed line is sooner."
        )
        data = {"classes": classes, "panels": panels, "colours": colours(results)}
        figures.append(figure("speed_ups", f"speed-ups-{budget}", caption, data))
    return {"heading": "Speed-up by class", "text": [text], "figures": figures}


def delay_cost_plane(results: Results) -> dict[str, Any]:
    """Isolation time against cost."""
    points = list(_points(results))
    names = {}
    fronts = {}
    for cost in COST_LABELS:
        places = [(point[cost], point["delay"][0]) for point in points]
        front = pareto_front(places)
        names[cost] = ", ".join(_point_name(points[k]) for k in front)
        fronts[cost] = [list(places[k]) for k in front]
    caption = (
        f"Isolation time with {results['diagnoser']} against the cost of a stimulus on the same "
        "episodes. Down and left is better; no stimulus is better in both than the dotted ones. By "
        f"speed: {names['speed_rms']}. By energy: {names['energy']}."
    )
    data = {
        "points": points,
        "fronts": fronts,
        "costs": COST_LABELS,
        "colours": colours(results),
    }
    return figure_section("Delay and cost", "delay_cost_plane", "delay-cost", caption, data)


def _points(results: Results) -> Iterator[dict[str, Any]]:
    """Stimuli within every budget; cruise, which has no offsets, once."""
    for k, (budget, of_budget) in enumerate(results["budgets"].items()):
        figures = of_budget["figures"][results["diagnoser"]]["all"]
        costs = of_budget["costs"][results["diagnoser"]]
        for name in without_single_seeds(figures):
            if name != Cruise.name or k == 0:
                yield {
                    "stimulus": name,
                    "budget": f"{budget} m/s",
                    "delay": figures[name]["mean"],
                    **{key: costs[name][key] for key in COST_LABELS},
                }


def _point_name(point: Mapping[str, Any]) -> str:
    stimulus = point["stimulus"]
    return stimulus if stimulus == Cruise.name else f"{stimulus} ({point['budget']})"


def around_onset(results: Results) -> dict[str, Any]:
    """What stimuli do around the onset of each class."""
    text = (
        f"Speed offsets with {results['diagnoser']}, averaged over {results['lanes']} vehicles of "
        "each class; every fault is abrupt and lasting with severity 0.2 to 1. A mean near zero "
        "with a large absolute value means that some vehicles go faster and others slower, or "
        "alternate."
    )
    figures = []
    for budget, of_budget in results["budgets"].items():
        offsets = of_budget["behaviour"]["around_onset"]
        common = {"time": offsets["time"], "colours": colours(results)}
        for kind, (label, beginning) in OFFSET_KINDS.items():
            caption = f"{beginning} around the onset, budget {budget} m/s."
            data = common | {"panels": offsets[kind], "label": label}
            figures.append(figure("around_onset", f"onset-{kind}-{budget}", caption, data))
    return {
        "heading": "What they do around the onset",
        "text": [text],
        "figures": figures,
    }


def episodes(results: Results) -> dict[str, Any]:
    """Single episodes."""
    figures = []
    for budget, of_budget in results["budgets"].items():
        recorded = of_budget["behaviour"]["episodes"]
        caption = (
            f"{recorded['stimulus']} within {budget} m/s: of each class the episode of median "
            "isolation time."
        )
        data = {"drawn": [_episode(episode) for episode in recorded["drawn"]]}
        figures.append(figure("active_episodes", f"episodes-{budget}", caption, data))
    return {"heading": "Six episodes", "text": [], "figures": figures}


def _episode(episode: Mapping[str, Any]) -> dict[str, Any]:
    series = {key: value for key, value in episode.items() if key != "class"}
    time = episode["isolation"]
    if time is None:
        return series | {"title": f"{episode['class']}, not isolated"}
    title = f"{episode['class']}, isolated after {time:.1f} s"
    return series | {"title": title, "isolation": episode["onset"] + time}
