"""The sections with figures of the benchmark's page."""

import textwrap
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from training.benchmark.leaderboard import Scores, figure_section, in_order
from training.report.cells import file_name, number, row_name

DRAWN = 3  # episodes drawn of each diagnoser
TOP = 2  # diagnosers whose confusion is drawn
SCATTERED = 4  # diagnosers whose severities are drawn
BOUND = {"detection": "bound", "isolation": "bound at 1 % misnamed"}
LEFT = {
    "detection": " Left of the line the bound, of abrupt faults; it has an interval of its own, see below.",
    "isolation": " Left of the line the least for abrupt faults if the most similar class is given this name in one of "
    "a hundred cases at most: who confuses the two more often can be below it, and so can the oracle, which is told "
    "severities.",
}
WIDTH = 44  # characters of a line above a drawn episode


class BenchmarkView(NamedTuple):
    """Results, their scores by stimulus and diagnoser, and names in the order of every figure, references last."""

    results: Mapping[str, Any]
    scores: Mapping[str, Scores]
    references: frozenset[str]
    names: list[str]

    @classmethod
    def of(cls, results: Mapping[str, Any]) -> "BenchmarkView":
        """Names are in the order of their mean isolation time over the stimuli."""
        scores = results["scores"]
        references = frozenset(results["references"])
        names = in_order(next(iter(scores.values())), references)
        mean = {
            name: np.mean([by[name]["isolation"]["restricted_mean"] for by in scores.values()])
            for name in names
        }
        return cls(
            results,
            scores,
            references,
            sorted(names, key=lambda name: (name in references, mean[name])),
        )

    @property
    def bounds(self) -> Mapping[str, Any]:
        """Bounds by stimulus, if there are any."""
        return self.results.get("bounds") or {}

    @property
    def horizon(self) -> float:
        """When watching ends [s]."""
        return self.results["settings"]["horizon"]

    def best_under(self, name: str) -> str:
        """The stimulus under which a diagnoser isolates soonest."""
        return min(
            self.scores,
            key=lambda stimulus: self.scores[stimulus][name]["isolation"]["restricted_mean"],
        )

    def lines(self, of: Any) -> dict[str, dict[str, Any]]:
        """By stimulus and diagnoser the line {x, y} that a function makes of a score."""
        return {
            stimulus: {name: dict(zip("xy", of(scores[name]), strict=True)) for name in self.names}
            for stimulus, scores in self.scores.items()
        }


def isolation_over_time(view: BenchmarkView) -> dict[str, Any]:
    """Share isolated against time since onset."""
    panels = view.lines(
        lambda score: (score["isolation_over_time"]["time"], score["isolation_over_time"]["share"])
    )
    return figure_section(
        "How soon are faults isolated?",
        "curves",
        "isolation",
        "Share of the faults isolated for good by a time since onset, at one false alarm per hour; the area above a "
        "line is its restricted mean.",
        {
            "panels": panels,
            "references": list(view.references),
            "labels": ("time since onset [s]", "share of the faults isolated"),
            "top": 1.0,
        },
    )


def alarms_against_delay(view: BenchmarkView) -> dict[str, Any]:
    """AMOC curves: delay, and share detected, against the rate of false alarms."""
    shared = {"references": list(view.references), "logarithmic": True, "marks": [0.1, 1.0]}
    x_label = "false alarms per hour, as set"
    delay = {
        "panels": view.lines(
            lambda score: (score["amoc"]["false_alarms_per_hour"], score["amoc"]["delay"])
        ),
        "labels": (x_label, "detection delay, restricted mean [s]"),
        "top": view.horizon,
        "bounds": {
            stimulus: {"x": bound["amoc"]["false_alarms_per_hour"], "y": bound["amoc"]["delay"]}
            for stimulus, bound in view.bounds.items()
        },
    }
    detected = {
        "panels": view.lines(
            lambda score: (score["amoc"]["false_alarms_per_hour"], score["amoc"]["probability"])
        ),
        "labels": (x_label, f"share detected within {view.horizon:g} s"),
        "top": 1.0,
    }
    bound = (
        " Dotted black: the bound at the rate that is really had, which no diagnoser can be below, even told the "
        "vehicle and the severity of the fault; it is that of abrupt faults, and ramps only take longer."
        if view.bounds
        else ""
    )
    section = figure_section(
        "Delay against false alarms",
        "curves",
        "amoc-delay",
        "Detection delay against the rate of false alarms that a threshold is set for, under the standard conditions "
        "and all stimuli together; what is really had here may differ, see False alarms. Dotted lines: one in 10 h and "
        f"one per hour.{bound}",
        delay | shared,
    )
    caption = "Share of the faults detected, likewise."
    section["figures"].append(
        {"plot": "curves", "name": "amoc-detected", "caption": caption, "data": detected | shared}
    )
    return section


def f1_over_time(view: BenchmarkView) -> dict[str, Any]:
    """Macro-F1 at the instants of decision."""
    instants = view.results["settings"]["decided_at"]
    return figure_section(
        "How good is the naming, and when?",
        "curves",
        "macro-f1",
        f"Macro-F1 over the classes and normal {', '.join(f'{t:g}' for t in instants)} s after onset.",
        {
            "panels": view.lines(lambda score: (instants, score["macro_f1_over_time"])),
            "references": list(view.references),
            "labels": ("time since onset [s]", "macro-F1"),
            "top": 1.0,
        },
    )


def by_class(view: BenchmarkView) -> Iterable[dict[str, Any]]:
    """Isolation time and detection delay by class, with the bounds on the left."""
    for kind, words in (("isolation", "Isolation time"), ("detection", "Detection delay")):
        drawn = [
            {
                "plot": "class_delays",
                "name": f"{kind}-by-class-{file_name(stimulus)}",
                "caption": f"{words} under {stimulus}, restricted mean [s]; {view.horizon:g} is never within the "
                "horizon." + (LEFT[kind] if stimulus in view.bounds else ""),
                "data": _class_delays(view, kind, stimulus),
            }
            for stimulus in view.scores
        ]
        yield {"heading": f"{words} by class", "text": [], "figures": drawn}


def _class_delays(view: BenchmarkView, kind: str, stimulus: str) -> dict[str, Any]:
    scores = view.scores[stimulus]
    classes = list(scores[view.names[0]][f"{kind}_by_class"])
    columns = {}
    if stimulus in view.bounds:
        bounds = view.bounds[stimulus]["classes"]
        columns[BOUND[kind]] = [
            _bound(bounds[name], kind) if name in bounds else None for name in classes
        ]
    columns |= {
        row_name(name, view.references): [
            scores[name][f"{kind}_by_class"][of_class] for of_class in classes
        ]
        for name in view.names
    }
    return {"classes": classes, "delays": columns, "horizon": view.horizon}


def _bound(of_class: Mapping[str, Any], kind: str) -> float:
    """The bound of a class at one false alarm per hour."""
    return (
        of_class["detection_delay"]["1 h"][0]
        if kind == "detection"
        else of_class["isolation_delay"][0]
    )


def confusions(view: BenchmarkView) -> dict[str, Any]:
    """Who is taken for what by the best diagnosers, each under the stimulus that suits it best."""
    drawn = []
    for name in [name for name in view.names if name not in view.references][:TOP] or view.names[
        :TOP
    ]:
        stimulus = view.best_under(name)
        counts = np.array(view.scores[stimulus][name]["confusion"], float)
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
        drawn.append(
            {
                "plot": "confusion_matrix",
                "name": f"confusion-{file_name(name)}",
                "caption": f"Decisions of {name} under {stimulus} 10 s after onset, per cent of each true class (row); "
                "normal means that no alarm stands. Shares below 0.5 % are not written.",
                "data": {
                    "classes": view.results["classes"],
                    "shares": np.round(shares, 4).tolist(),
                },
            }
        )
    return {"heading": "What is taken for what?", "text": [], "figures": drawn}


def costs(view: BenchmarkView) -> dict[str, Any]:
    """What the stimuli cost, and what they buy."""
    points = {
        name: {
            stimulus: {
                "speed_rms": scores[name]["cost"]["speed_rms"],
                "energy": scores[name]["cost"]["energy"],
                "delay": scores[name]["isolation"]["restricted_mean"],
            }
            for stimulus, scores in view.scores.items()
        }
        for name in view.names
    }
    axes = {
        "speed_rms": "RMS deviation from the mission's speed [m/s]",
        "energy": "energy [J per episode]",
    }
    section = figure_section(
        "Cost and delay",
        "cost_delay",
        "cost-delay",
        "Isolation time against what the stimulus costs: deviation of the true speed from the mission's, and "
        "electrical energy. Each line is a diagnoser, each marker a stimulus; down and left is better.",
        {"points": points, "references": list(view.references), "costs": axes},
    )
    section["table"] = {
        "columns": ["stimulus", "speed RMS [m/s]", "× cruise", "energy [J]", "× cruise"],
        "rows": [_cost_cells(stimulus, scores) for stimulus, scores in view.scores.items()],
    }
    return section


def _cost_cells(stimulus: str, scores: Scores) -> list[str]:
    """Means over the diagnosers; an open-loop stimulus costs the same with each."""
    cost = {
        key: [score["cost"][key] for score in scores.values()]
        for key in next(iter(scores.values()))["cost"]
    }
    mean = {key: None if None in values else float(np.mean(values)) for key, values in cost.items()}
    return [
        stimulus,
        f"{mean['speed_rms']:.4f}",
        number(mean["speed_rms_ratio"], 2, "–"),
        f"{mean['energy']:.0f}",
        number(mean["energy_ratio"], 3, "–"),
    ]


def calibration(view: BenchmarkView) -> dict[str, Any]:
    """Reliability diagrams."""
    drawn = [
        {
            "plot": "reliability_diagrams",
            "name": f"reliability-{file_name(stimulus)}",
            "caption": f"Share of beliefs that were right against confidence, at random instants under {stimulus}. "
            "A point's area is the share of the beliefs in its bin. Below the diagonal: too sure of itself.",
            "data": {"diagrams": {name: scores[name]["reliability"] for name in view.names}},
        }
        for stimulus, scores in view.scores.items()
    ]
    return {"heading": "Are beliefs to be believed?", "text": [], "figures": drawn}


def severity(view: BenchmarkView) -> dict[str, Any]:
    """Estimated against true severity for the best diagnosers, under the stimulus that suits the first of them."""
    stimulus = view.best_under(view.names[0])
    scatters = {
        name: view.scores[stimulus][name]["severity_scatter"] for name in view.names[:SCATTERED]
    }
    truth = scatters[view.names[0]]["truth"]
    caption = (
        f"Severity estimated {view.results['settings']['severity_at']:g} s after onset under {stimulus}, given the "
        f"true class, of {len(truth)} episodes."
    )
    estimates = {name: scatter["estimate"] for name, scatter in scatters.items()}
    return figure_section(
        "Severity", "severities", "severity", caption, {"truth": truth, "estimates": estimates}
    )


def worst(view: BenchmarkView) -> dict[str, Any]:
    """The episodes that each diagnoser isolated last."""
    drawn = []
    for name in view.names:
        found = [
            (stimulus, episode)
            for stimulus, scores in view.scores.items()
            for episode in scores[name]["worst"]
        ]
        found.sort(key=lambda item: -_isolated(item[1]))
        drawn.append(
            {
                "plot": "episodes",
                "name": f"worst-{file_name(name)}",
                "caption": f"{name}: the episodes that it isolated last, of all stimuli.",
                "data": {"drawn": [_episode(view, *item) for item in found[:DRAWN]]},
            }
        )
    text = [
        "Three of each diagnoser; ties by the order of the stimuli and then of the episodes. The strip below shows "
        "whether an alarm stands and whether the most probable fault is the right one; before the onset none is."
    ]
    return {"heading": "Worst episodes", "text": text, "figures": drawn}


def _isolated(episode: Mapping[str, Any]) -> float:
    return np.inf if episode["isolation"] is None else episode["isolation"]


def _episode(view: BenchmarkView, stimulus: str, episode: Mapping[str, Any]) -> dict[str, Any]:
    fault = view.results["classes"][episode["class"]]
    head = f"{stimulus}, seed {episode['seed']}\n{fault}, severity {episode['severity']:.2f}\n"
    kept = {
        key: episode[key]
        for key in ("onset", "time", "log_normal", "threshold", "alarm", "readings")
    }
    right = [top == episode["class"] for top in episode["fault"]]
    return kept | {"title": head + textwrap.fill(episode["why"], WIDTH), "right": right}
