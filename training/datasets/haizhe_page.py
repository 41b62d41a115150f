"""The page of `auv-fault haizhe`: scores by protocol and input, controls, confusion matrices."""

from collections.abc import Mapping, Sequence
from typing import Any

from training.datasets.forests import CLASSIFIERS, ROUNDS, TREES
from training.datasets.haizhe_runs import CLASSES, SOURCE
from training.report.cells import number, percent, with_interval
from training.report.sections import Section, figure_section, table_section

Scores = Sequence[Mapping[str, Any]]  # by protocol, classifier and input
NAMES = ("held out", "classifier", "input")

MEANING = (
    "The whole run: figures of each reading over the run (level, variation, quantiles, extremes, "
    "first and last value, trend, mean and largest step, power in bands). Time and the thrusters' "
    "command are not among the inputs.",
    "Rest only is the first sample of the run, all motors idle. A damaged propeller that does not "
    "turn cannot be seen: what this control gets right there comes from the session (trim, "
    "battery, water), not from the fault. An added weight or an offset of the depth reading may "
    "show at rest.",
    "Rest removed is the whole run less its first sample, reading by reading. That removes a "
    "session's offset, and also what a fault does at rest; the session's effect on the motion "
    "remains.",
    "Command only is the pulse width of the thrusters. It is set before the vehicle can have "
    "answered, so it cannot depend on the fault. But on the days of different classes it was set "
    "differently, and its effect on the motion is in the whole run and in the run with rest "
    "removed.",
    "Stratified folds are random: the run made a minute earlier is among the training runs. Time "
    "blocks hold out a fifth of each class' recording time, half of the day everything before or "
    "after 18:00. These two halves are the only sessions that are certainly different, because the "
    "data have no date. What falls from the first protocol to the last depended on the session, "
    "and on the number of training runs (last table). On another day expect no more than the last.",
    "Intervals (95 %; accuracy Wilson, macro-F1 runs resampled) take runs as independent. Those of "
    "a session are not, so that the true uncertainty is wider. The classifiers are a random forest "
    f"of {TREES} trees and gradient boosting on histograms in {ROUNDS} rounds, both with balanced "
    "classes and otherwise with the default settings of scikit-learn: nothing is tuned.",
)
PUBLISHED_ACCURACY = 0.9796  # SeqCNN on the official test split; Data in Brief 39 (2021) 107477
PUBLISHED = (
    f"Published on the official test split: SeqCNN {100 * PUBLISHED_ACCURACY:.2f} % (Data in Brief "
    "39 (2021) 107477), without the controls below."
)


def page(
    command: str,
    counts: Mapping[str, Sequence[int]],
    scores: Scores,
    sessions: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    """The report as plain data: runs by split and class, scores, and the sessions by class."""
    runs = "; ".join(_runs_of_split(split, counts[split]) for split in counts)
    return {
        "title": "Haizhe: faults of a real vehicle, and the influence of the session",
        "command": command,
        "summary": [f"Runs: {runs}. Data: {SOURCE}.", outcome(scores), PUBLISHED],
        "intro": [],
        "scores": list(scores),
        "sections": [
            accuracy_section(scores),
            controls_section(scores, sessions),
            class_section(scores),
            confusion_section(scores),
            sessions_section(sessions),
        ],
    }


def outcome(scores: Scores) -> str:
    """What the best classifier of the whole run achieves, and what of it is the session."""
    accuracy = {tuple(names(score)): score["accuracy"] for score in scores}
    best = max(CLASSIFIERS, key=lambda name: accuracy["stratified", name, "whole run"])

    def shares(inputs: str) -> str:
        protocols = ("stratified", "half of the day")
        return " and ".join(f"{100 * accuracy[one, best, inputs]:.1f} %" for one in protocols)

    return (
        f"The best classifier, {best}, names {shares('whole run')} of the runs right: the first "
        "with random folds, the second on the other half of the day. From the readings at rest "
        f"alone it names {shares('rest only')}: so much can come from the session and is no "
        "knowledge of the fault."
    )


def _runs_of_split(split: str, counts: Sequence[int]) -> str:
    by_class = [f"{count} {name}" for count, name in zip(counts, CLASSES, strict=True)]
    return f"{sum(counts)} in {split} ({', '.join(by_class)})"


def accuracy_section(scores: Scores) -> Section:
    """Accuracy and macro-F1 by protocol, classifier and input, and their meaning."""
    rows = []
    for score in scores:
        interval = [100 * end for end in score["accuracy_interval"]]
        accuracy = with_interval(100 * score["accuracy"], interval, 1)
        macro_f1 = with_interval(score["macro_f1"], score["f1_interval"], 3)
        rows.append([*names(score), accuracy, macro_f1])
    columns = [*NAMES, "accuracy [%] (95 %)", "macro-F1 (95 %)"]
    return table_section("Accuracy and controls", columns, rows, *MEANING)


def names(score: Mapping[str, Any]) -> list[str]:
    """What was held out, the classifier, and its inputs."""
    return [score["protocol"], score["classifier"], score["inputs"]]


def controls_section(scores: Scores, sessions: Mapping[str, Mapping[str, Any]]) -> Section:
    """What the controls say of each classifier's result, in per cent, and in words."""
    by_name = {tuple(names(score)): score for score in scores}
    rows = []
    for protocol in dict.fromkeys(score["protocol"] for score in scores):
        for classifier in CLASSIFIERS:
            whole, moved, rest = (
                by_name[protocol, classifier, inputs]["accuracy"]
                for inputs in ("whole run", "rest removed", "rest only")
            )
            cells = [f"{100 * (whole - other):+.1f}" for other in (rest, moved)]
            rows.append([protocol, classifier, f"{100 * whole:.1f}", *cells])
    text = [damage_at_rest(by_name, classifier) for classifier in CLASSIFIERS]
    columns = ["held out", "classifier", "whole run [%]", "over rest only", "over rest removed"]
    return table_section("What the controls say", columns, rows, *text, normal_text(sessions))


def damage_at_rest(by_name: Mapping[tuple[str, ...], Mapping[str, Any]], classifier: str) -> str:
    """How often a classifier recognises damaged propellers that do not turn."""
    confusion = by_name["stratified", classifier, "rest only"]["confusion"]
    shares = [
        f"{percent(confusion[k][k])} of {name}"
        for k, name in enumerate(CLASSES)
        if name.startswith("PropellerDamage")
    ]
    return (
        f"At rest, with stratified folds, {classifier} recognises {' and '.join(shares)}, although "
        "a damaged propeller that does not turn cannot be seen: it recognises the session."
    )


def normal_text(sessions: Mapping[str, Mapping[str, Any]]) -> str:
    """How few runs of Normal half of the day leaves, and how different its halves are."""
    before, after = sessions["Normal"]["runs"]
    accuracy = number(sessions["Normal"]["balanced_accuracy"], 2, "unknown, for too few runs")
    return (
        f"Of the {before + after} runs of Normal {before} were made before 18:00: half of the day "
        "has these alone to learn from, or to be judged by. The balanced accuracy with which they "
        f"are distinguished at rest from the later ones is {accuracy} (other classes: last table)."
    )


def class_section(scores: Scores) -> Section:
    """Share of each class that was classified correctly."""
    rows = []
    for score in scores:
        shares = [percent(row[k]) for k, row in enumerate(score["confusion"])]
        rows.append([*names(score), *shares])
    chance = f"Chance is {percent(1 / len(CLASSES))}."
    return table_section("Recognised, by class", [*NAMES, *CLASSES], rows, chance)


def confusion_section(scores: Scores) -> Section:
    """Confusion matrices, a row per protocol and classifier."""
    shares: dict[str, dict[str, Any]] = {}
    for score in scores:
        row = f"{score['protocol']}, {score['classifier']}"
        shares.setdefault(row, {})[score["inputs"]] = score["confusion"]
    caption = (
        "Per cent of each true class (row) that were decided as each class (column); a row of "
        "panels per protocol and classifier, a panel per input."
    )
    data = {"classes": list(CLASSES), "shares": shares}
    return figure_section("Confusion", "confusion_grid", "confusion", caption, data)


def sessions_section(sessions: Mapping[str, Mapping[str, Any]]) -> Section:
    """How well the sample at rest distinguishes the sessions of one class."""
    rows = []
    for name, session in sessions.items():
        accuracy = number(session["balanced_accuracy"], 3, "too few runs")
        rows.append([name, *map(str, session["runs"]), accuracy])
    text = (
        "Within one class the fault is the same, so that only the session distinguishes its runs "
        "before 18:00 from those after. Balanced accuracy of a forest on the first sample, at "
        "rest; 0.5 is chance."
    )
    columns = ["class", "runs before 18:00", "from 18:00", "balanced accuracy"]
    return table_section("Sessions distinguished at rest", columns, rows, text)
