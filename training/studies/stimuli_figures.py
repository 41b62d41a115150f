"""The sections with figures of the page of ``python -m training.studies.stimuli``."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

from training.benchmark.leaderboard import figure_section
from training.report.figures.scores import COLOURS
from training.stimuli.open_loop import Cruise
from training.studies.stimulus_comparisons import AGENT, LEARNED, REFERENCES, front, shown, speed_up

Results = Mapping[str, Any]
PLANE = {
    "speed_rms": "RMS deviation from the mission's speed [m/s]",
    "energy": "energy [J per episode]",
}
KINDS = {"mean": "mean offset [m/s]", "absolute": "mean size of the offset [m/s]"}


def colours(results: Results) -> dict[str, str]:
    """A colour for every stimulus of the figures, the agent's seeds and their mean having the same."""
    figures = [one["figures"][results["diagnoser"]]["all"] for one in results["budgets"].values()]
    names = dict.fromkeys(name for one in figures for name in one)
    found = dict(zip(shown(names), cycle(COLOURS), strict=False))
    return found | {name: found[AGENT] for name in names if LEARNED.fullmatch(name)}


def _figures(heading: str, text: Sequence[str], drawn: Iterable[dict[str, Any]]) -> dict[str, Any]:
    return {"heading": heading, "text": list(text), "figures": list(drawn)}


def by_class(results: Results) -> dict[str, Any]:
    """How many times sooner each class is isolated."""
    of_colour = colours(results)
    text = [
        f"Restricted mean under the reference over that under the stimulus, with {results['diagnoser']}."
    ]
    return _figures(
        "Speed-up by class",
        text,
        (_by_class(results, budget, of_colour) for budget in results["budgets"]),
    )


def _by_class(results: Results, budget: str, of_colour: Mapping[str, str]) -> dict[str, Any]:
    figures = results["budgets"][budget]["figures"][results["diagnoser"]]
    names = results["classes"]
    panels = {
        reference: {
            stimulus: [speed_up(figures[name][stimulus]["ratio"][reference]) for name in names]
            for stimulus in shown(figures["all"])
            if stimulus != Cruise.name and stimulus != reference
        }
        for reference in reversed(REFERENCES)
    }
    return {
        "plot": "speed_ups",
        "name": f"speed-ups-{budget}",
        "caption": f"How many times sooner each class is isolated within {budget} m/s; right of the dashed line is "
        "sooner.",
        "data": {"classes": names, "panels": panels, "colours": dict(of_colour)},
    }


def plane(results: Results) -> dict[str, Any]:
    """What the isolation time costs."""
    points = list(_points(results))
    fronts = {
        cost: [points[k] for k in front([(point[cost], point["delay"][0]) for point in points])]
        for cost in PLANE
    }
    named = {cost: ", ".join(_point(point) for point in chosen) for cost, chosen in fronts.items()}
    return figure_section(
        "Delay and cost",
        "delay_cost_plane",
        "delay-cost",
        f"Isolation time with {results['diagnoser']} against what a stimulus costs on the same episodes. Down and left "
        f"is better; nothing beats the dotted ones in both. By speed: {named['speed_rms']}. By energy: "
        f"{named['energy']}.",
        {
            "points": points,
            "fronts": {
                cost: [[one[cost], one["delay"][0]] for one in chosen]
                for cost, chosen in fronts.items()
            },
            "costs": PLANE,
            "colours": colours(results),
        },
    )


def _points(results: Results) -> Iterator[dict[str, Any]]:
    """Stimuli within every budget; cruise, which spends nothing, once."""
    for k, (budget, one) in enumerate(results["budgets"].items()):
        figures, cost = (one[key][results["diagnoser"]] for key in ("figures", "costs"))
        for name in shown(figures["all"]):
            if name != Cruise.name or k == 0:
                costs = {key: cost[name][key] for key in PLANE}
                yield {
                    "stimulus": name,
                    "budget": f"{budget} m/s",
                    "delay": figures["all"][name]["mean"],
                    **costs,
                }


def _point(point: Mapping[str, Any]) -> str:
    return (
        point["stimulus"]
        if point["stimulus"] == Cruise.name
        else f"{point['stimulus']} ({point['budget']})"
    )


def onset(results: Results) -> dict[str, Any]:
    """What stimuli do around the onset of each class."""
    of_colour = colours(results)
    text = [
        f"Speed offsets with {results['diagnoser']} in the loop, averaged over {results['lanes']} vehicles of each "
        "class, every fault abrupt and lasting, severity 0.2 to 1. A mean near zero with a large size means that some "
        "go faster and others slower, or by turns."
    ]
    drawn = (
        {
            "plot": "around_onset",
            "name": f"onset-{kind}-{budget}",
            "caption": f"{label.partition(' [')[0].capitalize()} around the onset, budget {budget} m/s.",
            "data": {
                "time": one["behaviour"]["around_onset"]["time"],
                "panels": one["behaviour"]["around_onset"][kind],
                "label": label,
                "colours": of_colour,
            },
        }
        for budget, one in results["budgets"].items()
        for kind, label in KINDS.items()
    )
    return _figures("What they do around the onset", text, drawn)


def episodes(results: Results) -> dict[str, Any]:
    """Single episodes."""
    drawn = (
        {
            "plot": "active_episodes",
            "name": f"episodes-{budget}",
            "caption": f"{one['behaviour']['episodes']['stimulus']} within {budget} m/s: of each class the episode of "
            "median isolation time.",
            "data": {
                "drawn": [_episode(episode) for episode in one["behaviour"]["episodes"]["drawn"]]
            },
        }
        for budget, one in results["budgets"].items()
    )
    return _figures("Six episodes", [], drawn)


def _episode(episode: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in episode.items() if key != "class"}
    time = episode["isolation"]
    said = "not isolated" if time is None else f"isolated after {time:.1f} s"
    return kept | {
        "title": f"{episode['class']}, {said}",
        "isolation": None if time is None else episode["onset"] + time,
    }
