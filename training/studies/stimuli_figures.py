"""The sections with figures of the page of ``python -m training.studies.stimuli``."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

from training.benchmark.leaderboard import figure_section
from training.report.figures.style import COLOURS
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


def _section(heading: str, text: Sequence[str], figures: list[dict[str, Any]]) -> dict[str, Any]:
    return {"heading": heading, "text": list(text), "figures": figures}


def by_class(results: Results) -> dict[str, Any]:
    """How many times sooner each class is isolated."""
    stimulus_colours = colours(results)
    text = (
        "Restricted mean under the reference divided by that under the stimulus, with "
        f"{results['diagnoser']}."
    )
    figures = [_speed_up_figure(results, budget, stimulus_colours) for budget in results["budgets"]]
    return _section("Speed-up by class", [text], figures)


def _speed_up_figure(
    results: Results, budget: str, stimulus_colours: Mapping[str, str]
) -> dict[str, Any]:
    figures = results["budgets"][budget]["figures"][results["diagnoser"]]
    names = results["classes"]
    panels: dict[str, Any] = {}
    for reference in reversed(REFERENCES):
        panels[reference] = {
            stimulus: [speed_up(figures[name][stimulus]["ratio"][reference]) for name in names]
            for stimulus in without_single_seeds(figures["all"])
            if stimulus not in (Cruise.name, reference)
        }
    caption = (
        f"How many times sooner each class is isolated within {budget} m/s; right of the dashed "
        "line is sooner."
    )
    return {
        "plot": "speed_ups",
        "name": f"speed-ups-{budget}",
        "caption": caption,
        "data": {"classes": names, "panels": panels, "colours": dict(stimulus_colours)},
    }


def delay_cost_plane(results: Results) -> dict[str, Any]:
    """Isolation time against cost."""
    points = list(_points(results))
    fronts = {}
    for cost in COST_LABELS:
        front = pareto_front([(point[cost], point["delay"][0]) for point in points])
        fronts[cost] = [points[index] for index in front]
    names = {cost: ", ".join(map(_point_name, front)) for cost, front in fronts.items()}
    caption = (
        f"Isolation time with {results['diagnoser']} against the cost of a stimulus on the same "
        "episodes. Down and left is better; no stimulus is better in both than the dotted ones. By "
        f"speed: {names['speed_rms']}. By energy: {names['energy']}."
    )
    lines = {
        cost: [[point[cost], point["delay"][0]] for point in front]
        for cost, front in fronts.items()
    }
    data = {
        "points": points,
        "fronts": lines,
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
    stimulus_colours = colours(results)
    text = (
        f"Speed offsets with {results['diagnoser']}, averaged over {results['lanes']} vehicles of "
        "each class; every fault is abrupt and lasting with severity 0.2 to 1. A mean near zero "
        "with a large absolute value means that some vehicles go faster and others slower, or "
        "alternate."
    )
    figures = []
    for budget, of_budget in results["budgets"].items():
        offsets = of_budget["behaviour"]["around_onset"]
        for kind, (label, caption) in OFFSET_KINDS.items():
            data = {
                "time": offsets["time"],
                "panels": offsets[kind],
                "label": label,
                "colours": stimulus_colours,
            }
            figure = {
                "plot": "around_onset",
                "name": f"onset-{kind}-{budget}",
                "caption": f"{caption} around the onset, budget {budget} m/s.",
                "data": data,
            }
            figures.append(figure)
    return _section("What they do around the onset", [text], figures)


def episodes(results: Results) -> dict[str, Any]:
    """Single episodes."""
    figures = []
    for budget, of_budget in results["budgets"].items():
        recorded = of_budget["behaviour"]["episodes"]
        caption = (
            f"{recorded['stimulus']} within {budget} m/s: of each class the episode of median "
            "isolation time."
        )
        figure = {
            "plot": "active_episodes",
            "name": f"episodes-{budget}",
            "caption": caption,
            "data": {"drawn": [_episode(episode) for episode in recorded["drawn"]]},
        }
        figures.append(figure)
    return _section("Six episodes", [], figures)


def _episode(episode: Mapping[str, Any]) -> dict[str, Any]:
    series = {key: value for key, value in episode.items() if key != "class"}
    time = episode["isolation"]
    is_isolated = time is not None
    ending = f"isolated after {time:.1f} s" if is_isolated else "not isolated"
    return series | {
        "title": f"{episode['class']}, {ending}",
        "isolation": episode["onset"] + time if is_isolated else None,
    }
