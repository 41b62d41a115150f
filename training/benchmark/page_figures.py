"""The sections with figures of the benchmark's page."""

import textwrap
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from training.benchmark.leaderboard import Scores, in_order
from training.benchmark.scores import RANKED_AT, Score
from training.report.cells import file_name, number, row_name
from training.report.sections import figure, figure_section

N_EPISODES_SHOWN = 3  # of each diagnoser
N_CONFUSIONS_SHOWN = 2  # diagnosers
N_SCATTERS_SHOWN = 4  # diagnosers
BOUND_COLUMNS = {"detection": "bound", "isolation": "bound at 1 % confused"}
BOUND_NOTES = {
    "detection": " Left of the line: the bound for abrupt faults; its interval is in the table of "
    "bounds.",
    "isolation": " Left of the line: the bound for abrupt faults, if the most similar class is "
    "named wrongly in at most one of a hundred cases. A diagnoser that confuses the two more often "
    "can be below it, and so can the oracle, which knows the severities.",
}
TITLE_WIDTH = 44  # characters of a line above an episode


class BenchmarkView(NamedTuple):
    """Results as the page reads them."""

    results: Mapping[str, Any]  # all of results.json
    scores: Mapping[str, Scores]  # by stimulus and diagnoser
    references: frozenset[str]  # diagnosers that are not ranked
    names: list[str]  # by mean isolation time over the stimuli, references last

    @classmethod
    def of(cls, results: Mapping[str, Any]) -> "BenchmarkView":
        """The view of results."""
        scores = results["scores"]
        references = frozenset(results["references"])
        mean_time = {}
        for name in in_order(next(iter(scores.values())), references):
            times = [by_name[name]["isolation"]["restricted_mean"] for by_name in scores.values()]
            mean_time[name] = np.mean(times)
        names = sorted(mean_time, key=lambda name: (name in references, mean_time[name]))
        return cls(results, scores, references, names)

    @property
    def bounds(self) -> Mapping[str, Any]:
        """Bounds by stimulus, if there are any."""
        return self.results.get("bounds") or {}

    @property
    def horizon(self) -> float:
        """Time after onset at which delays are censored [s]."""
        return self.results["settings"]["horizon"]

    @property
    def ranked(self) -> list[str]:
        """Names of the diagnosers that compete."""
        return [name for name in self.names if name not in self.references]

    def best_stimulus(self, name: str) -> str:
        """The stimulus under which a diagnoser isolates soonest."""
        isolation = {stimulus: of[name]["isolation"] for stimulus, of in self.scores.items()}
        return min(isolation, key=lambda stimulus: isolation[stimulus]["restricted_mean"])

    def lines(self, line: Callable[[Score], tuple[Any, Any]]) -> dict[str, dict[str, Any]]:
        """By stimulus and diagnoser the line {x, y} from a function of the score."""
        panels: dict[str, dict[str, Any]] = {}
        for stimulus, scores in self.scores.items():
            panels[stimulus] = {}
            for name in self.names:
                x, y = line(scores[name])
                panels[stimulus][name] = {"x": x, "y": y}
        return panels


def isolation_over_time(view: BenchmarkView) -> dict[str, Any]:
    """Share isolated against time since onset."""

    def line(score: Score) -> tuple[Any, Any]:
        curve = score["isolation_over_time"]
        return curve["time"], curve["share"]

    data = {
        "panels": view.lines(line),
        "references": list(view.references),
        "labels": ("time since onset [s]", "share of the faults isolated"),
        "top": 1.0,
    }
    caption = (
        "Share of the faults isolated for good by a time since onset, at one false alarm per hour; "
        "the area above a line is its restricted mean."
    )
    return figure_section("How soon are faults isolated?", "curves", "isolation", caption, data)


def alarms_against_delay(view: BenchmarkView) -> dict[str, Any]:
    """AMOC curves: delay, and share detected, against the rate of false alarms."""

    def delay_line(score: Score) -> tuple[Any, Any]:
        return score["amoc"]["false_alarms_per_hour"], score["amoc"]["delay"]

    def share_line(score: Score) -> tuple[Any, Any]:
        return score["amoc"]["false_alarms_per_hour"], score["amoc"]["probability"]

    shared = {
        "references": list(view.references),
        "logarithmic": True,
        "marks": [0.1, 1.0],
    }
    x_label = "false alarms per hour, as set"
    bounds = {}
    for stimulus, bound in view.bounds.items():
        amoc = bound["amoc"]
        bounds[stimulus] = {"x": amoc["false_alarms_per_hour"], "y": amoc["delay"]}
    delay = {
        "panels": view.lines(delay_line),
        "labels": (x_label, "detection delay, restricted mean [s]"),
        "top": view.horizon,
        "bounds": bounds,
    }
    detected = {
        "panels": view.lines(share_line),
        "labels": (x_label, f"share detected within {view.horizon:g} s"),
        "top": 1.0,
    }
    caption = (
        "Detection delay against the rate of false alarms that a threshold is set for, under the "
        "standard conditions and all stimuli together. The rate counted here may differ: see False "
        "alarms. Dotted lines: one in 10 h and one per hour."
    )
    if view.bounds:
        caption += (
            " Dotted black: the bound at the counted rate. No diagnoser can be below it, even if "
            "it knows the vehicle and the severity. It is that of abrupt faults; ramped faults "
            "take longer."
        )
    second_caption = "Share of the faults detected against the same rate."
    figures = [
        figure("curves", "amoc-delay", caption, delay | shared),
        figure("curves", "amoc-detected", second_caption, detected | shared),
    ]
    return {"heading": "Delay against false alarms", "text": [], "figures": figures}


def f1_over_time(view: BenchmarkView) -> dict[str, Any]:
    """Macro-F1 at the times of decision."""
    times = view.results["settings"]["decided_at"]
    listed = ", ".join(f"{time:g}" for time in times)
    data = {
        "panels": view.lines(lambda score: (times, score["macro_f1_over_time"])),
        "references": list(view.references),
        "labels": ("time since onset [s]", "macro-F1"),
        "top": 1.0,
    }
    heading = "How good are the decisions, and when?"
    caption = f"Macro-F1 over the classes and normal {listed} s after onset."
    return figure_section(heading, "curves", "macro-f1", caption, data)


def by_class(view: BenchmarkView) -> Iterable[dict[str, Any]]:
    """Isolation time and detection delay by class, with the bounds on the left."""
    for kind, words in (
        ("isolation", "Isolation time"),
        ("detection", "Detection delay"),
    ):
        figures = []
        for stimulus in view.scores:
            caption = f"{words} under {stimulus}, restricted mean [s]; {view.horizon:g} means "
            caption += "never within the horizon."
            if stimulus in view.bounds:
                caption += BOUND_NOTES[kind]
            name = f"{kind}-by-class-{file_name(stimulus)}"
            data = _class_delays(view, kind, stimulus)
            figures.append(figure("class_delays", name, caption, data))
        yield {"heading": f"{words} by class", "text": [], "figures": figures}


def _class_delays(view: BenchmarkView, kind: str, stimulus: str) -> dict[str, Any]:
    scores = view.scores[stimulus]
    classes = list(scores[view.names[0]][f"{kind}_by_class"])
    columns: dict[str, list[float | None]] = {}
    if stimulus in view.bounds:
        of_classes = view.bounds[stimulus]["classes"]
        bounds = {name: _bound(of_class, kind) for name, of_class in of_classes.items()}
        columns[BOUND_COLUMNS[kind]] = [bounds.get(name) for name in classes]
    for name in view.names:
        delays = scores[name][f"{kind}_by_class"]
        columns[row_name(name, view.references)] = [delays[of_class] for of_class in classes]
    return {"classes": classes, "delays": columns, "horizon": view.horizon}


def _bound(of_class: Mapping[str, Any], kind: str) -> float:
    """The bound of a class, of detection at the rate that diagnosers are ranked at."""
    if kind == "detection":
        return of_class["detection_delay"][RANKED_AT][0]
    return of_class["isolation_delay"][0]


def confusions(view: BenchmarkView) -> dict[str, Any]:
    """Confusion of the best diagnosers, each under its best stimulus."""
    figures = []
    for name in (view.ranked or view.names)[:N_CONFUSIONS_SHOWN]:
        stimulus = view.best_stimulus(name)
        counts = np.array(view.scores[stimulus][name]["confusion"], float)
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
        caption = (
            f"Decisions of {name} under {stimulus} 10 s after onset, in per cent of each true "
            "class (row); normal means that no alarm stands. Shares below 0.5 % are left empty."
        )
        data = {
            "classes": view.results["classes"],
            "shares": np.round(shares, 4).tolist(),
        }
        file = f"confusion-{file_name(name)}"
        figures.append(figure("confusion_matrix", file, caption, data))
    return {"heading": "Which classes are confused?", "text": [], "figures": figures}


def costs(view: BenchmarkView) -> dict[str, Any]:
    """What the stimuli cost, and how much sooner faults are isolated."""
    points: dict[str, dict[str, Any]] = {name: {} for name in view.names}
    for stimulus, scores in view.scores.items():
        for name in view.names:
            cost = scores[name]["cost"]
            delay = scores[name]["isolation"]["restricted_mean"]
            paid = {key: cost[key] for key in ("speed_rms", "energy")}
            points[name][stimulus] = paid | {"delay": delay}
    axes = {
        "speed_rms": "RMS deviation from the mission's speed [m/s]",
        "energy": "energy [J per episode]",
    }
    data = {"points": points, "references": list(view.references), "costs": axes}
    caption = (
        "Isolation time against what the stimulus costs: deviation of the true speed from the "
        "mission's, and electrical energy. Each line is a diagnoser, each marker a stimulus; down "
        "and left is better."
    )
    section = figure_section("Cost and delay", "cost_delay", "cost-delay", caption, data)
    section["table"] = {
        "columns": [
            "stimulus",
            "speed RMS [m/s]",
            "× cruise",
            "energy [J]",
            "× cruise",
        ],
        "rows": [_cost_cells(stimulus, scores) for stimulus, scores in view.scores.items()],
    }
    return section


def _cost_cells(stimulus: str, scores: Scores) -> list[str]:
    """Means over the diagnosers; an open-loop stimulus costs the same with each."""
    mean: dict[str, float | None] = {}
    for key in next(iter(scores.values()))["cost"]:
        costs = [score["cost"][key] for score in scores.values()]
        mean[key] = None if None in costs else float(np.mean(costs))
    return [
        stimulus,
        f"{mean['speed_rms']:.4f}",
        number(mean["speed_rms_ratio"], 2, "–"),
        f"{mean['energy']:.0f}",
        number(mean["energy_ratio"], 3, "–"),
    ]


def calibration(view: BenchmarkView) -> dict[str, Any]:
    """Reliability diagrams."""
    figures = []
    for stimulus, scores in view.scores.items():
        diagrams = {name: scores[name]["reliability"] for name in view.names}
        caption = (
            "Share of beliefs that were right against their confidence, at random instants under "
            f"{stimulus}. The area of a point is the share of the beliefs in its bin. Below the "
            "diagonal the diagnoser is overconfident."
        )
        name = f"reliability-{file_name(stimulus)}"
        figures.append(figure("reliability_diagrams", name, caption, {"diagrams": diagrams}))
    return {"heading": "Are beliefs calibrated?", "text": [], "figures": figures}


def severity(view: BenchmarkView) -> dict[str, Any]:
    """Estimated against true severity for the best diagnosers, under one stimulus."""
    stimulus = view.best_stimulus(view.names[0])
    shown = view.names[:N_SCATTERS_SHOWN]
    scatters = {name: view.scores[stimulus][name]["severity_scatter"] for name in shown}
    truth = scatters[shown[0]]["truth"]
    estimates = {name: scatter["estimate"] for name, scatter in scatters.items()}
    caption = (
        f"Severity estimated {view.results['settings']['severity_at']:g} s after onset under "
        f"{stimulus}, given the true class, of {len(truth)} episodes."
    )
    data = {"truth": truth, "estimates": estimates}
    return figure_section("Severity", "severities", "severity", caption, data)


def worst(view: BenchmarkView) -> dict[str, Any]:
    """The episodes that each diagnoser isolated last."""
    figures = []
    for name in view.names:
        episodes = [
            (stimulus, episode)
            for stimulus, scores in view.scores.items()
            for episode in scores[name]["worst"]
        ]
        episodes.sort(key=lambda item: -_isolation_time(item[1]))
        shown = [_episode(view, *item) for item in episodes[:N_EPISODES_SHOWN]]
        caption = f"{name}: the episodes that it isolated last, of all stimuli."
        figures.append(figure("episodes", f"worst-{file_name(name)}", caption, {"drawn": shown}))
    text = [
        "Three of each diagnoser; equal ones in the order of the stimuli and then of the episodes. "
        "The strip below each episode shows whether an alarm stands and whether the most probable "
        "fault is the true one; before the onset no fault is true."
    ]
    return {"heading": "Worst episodes", "text": text, "figures": figures}


def _isolation_time(episode: Mapping[str, Any]) -> float:
    time = episode["isolation"]
    return np.inf if time is None else time


def _episode(view: BenchmarkView, stimulus: str, episode: Mapping[str, Any]) -> dict[str, Any]:
    fault = view.results["classes"][episode["class"]]
    title = f"{stimulus}, seed {episode['seed']}\n{fault}, severity {episode['severity']:.2f}\n"
    title += textwrap.fill(episode["why"], TITLE_WIDTH)
    keys = ("onset", "time", "log_normal", "threshold", "alarm", "readings")
    right = [fault == episode["class"] for fault in episode["fault"]]
    return {key: episode[key] for key in keys} | {"title": title, "right": right}
