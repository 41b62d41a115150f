"""The page of `auv-fault haizhe`: figures by protocol and input, what the controls mean, confusion matrices."""

from collections.abc import Mapping, Sequence
from typing import Any

from training.datasets.forests import TREES
from training.datasets.haizhe_runs import CLASSES, SOURCE
from training.report.cells import number, percent, with_interval

MEANING = (
    "The whole run: ten figures of each reading over the run (level, spread, trend, roughness, power in four bands). "
    "Time and the thrusters' command are kept from the classifier.",
    "Rest only is the first sample of the run, all motors idle. A damaged propeller that does not turn cannot be seen: "
    "whatever this control gets right there, it knows from the session (trim, battery, water), not from the fault. An "
    "added weight or an offset of the depth reading, though, may rightly show at rest.",
    "Rest removed is the whole run less its first sample, reading by reading: a session's offset is gone, but so is "
    "what a fault honestly does at rest; what the session does to the motion is still there.",
    "Command only is the pulse width sent to the thrusters. It stands from the first driven sample, before the vehicle "
    "can have answered: it does not know of the fault, but it was set differently on the days of different classes, "
    "and what it changes in the motion is in the whole run and in what is left without the rest.",
    "Stratified folds are drawn at random: the run made a minute earlier is among those learnt from. Time blocks hold "
    "out a fifth of each class' recording time, half of the day everything before or after 18:00, the only sessions "
    "that can be told apart for sure, for the data give no date. What falls from the first to the last had "
    "leant on the session, and on the number of runs to learn from (last table). For another day expect no more than "
    "the last.",
    "Intervals (95 %; accuracy Wilson, macro-F1 runs resampled) take runs as independent. Those of a session are not: "
    f"the true uncertainty is wider. The classifier is a random forest of {TREES} trees, not tuned.",
)
MARKS = (
    "Published on the official test split: SeqCNN 97.96 % (Data in Brief 39 (2021) 107477). A forest that sees the "
    "first sample only was measured there with 82 %."
)


def page(
    command: str,
    counts: Mapping[str, Sequence[int]],
    scores: Sequence[Mapping[str, Any]],
    halves: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    """The report as plain data; `counts` are the runs by split and class, the others those of `training.commands.haizhe`."""
    runs = "; ".join(
        f"{sum(of_class)} in {split} ({', '.join(map(' '.join, zip(map(str, of_class), CLASSES, strict=True)))})"
        for split, of_class in counts.items()
    )
    return {
        "title": "Haizhe: faults of a real vehicle, and what the sessions betray",
        "command": command,
        "intro": [f"Runs: {runs}. Data: {SOURCE}.", MARKS],
        "scores": list(scores),
        "sections": [figures(scores), by_class(scores), matrices(scores), sessions(halves)],
    }


def figures(scores: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Accuracy and macro-F1 by protocol and input, and what they mean."""
    rows = [
        [
            one["protocol"],
            one["inputs"],
            with_interval(
                100 * one["accuracy"], [100 * end for end in one["accuracy_interval"]], 1
            ),
            with_interval(one["macro_f1"], one["f1_interval"], 3),
        ]
        for one in scores
    ]
    columns = ["held out", "input", "accuracy [%] (95 %)", "macro-F1 (95 %)"]
    return {
        "heading": "Accuracy and controls",
        "text": list(MEANING),
        "table": {"columns": columns, "rows": rows},
    }


def by_class(scores: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Share of each class that was recognised."""
    rows = [
        [
            one["protocol"],
            one["inputs"],
            *(percent(shares[k]) for k, shares in enumerate(one["confusion"])),
        ]
        for one in scores
    ]
    return {
        "heading": "Recognised, by class",
        "text": ["Chance is about 20 %."],
        "table": {"columns": ["held out", "input", *CLASSES], "rows": rows},
    }


def matrices(scores: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Confusion matrices, a row per protocol."""
    shown: dict[str, dict[str, Any]] = {}
    for one in scores:
        shown.setdefault(one["protocol"], {})[one["inputs"]] = one["confusion"]
    caption = "Per cent of each true class (row) that were given each class (column); a panel per protocol and input."
    figure = {
        "plot": "confusion_grid",
        "name": "confusion",
        "caption": caption,
        "data": {"classes": list(CLASSES), "shares": shown},
    }
    return {"heading": "Confusion", "text": [], "figures": [figure]}


def sessions(halves: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """How well the sample at rest tells the sessions of one class apart."""
    rows = [
        [name, *map(str, told["runs"]), number(told["balanced_accuracy"], 3, "too few runs")]
        for name, told in halves.items()
    ]
    text = (
        "Within one class the fault is the same; whatever tells its runs before 18:00 from those after is the session. "
        "Balanced accuracy of a forest that sees the first sample, at rest; 0.5 is chance."
    )
    columns = ["class", "runs before 18:00", "from 18:00", "balanced accuracy"]
    return {
        "heading": "Sessions told apart at rest",
        "text": [text],
        "table": {"columns": columns, "rows": rows},
    }
