"""``auv-fault haizhe``: faults of a real vehicle classified, with controls for the session."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest
from tqdm import tqdm

from auv_fault_env.errors import refusal
from training.arguments import Haizhe
from training.datasets.forests import CLASSIFIERS, cross_decide, forest, shuffled_folds
from training.datasets.haizhe_page import page
from training.datasets.haizhe_runs import (
    CLASSES,
    INPUTS,
    Run,
    is_evening,
    load,
    time_blocks,
)
from training.metrics import confusion, macro_f1
from training.metrics.intervals import f1_interval
from training.report.markdown import write_markdown
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

FOLDS = 5
OFFICIAL = "official test split"


class Decisions(NamedTuple):
    """Decisions of a classifier on the runs that a protocol holds out.

    `protocol`, `classifier` and `inputs` are names; `label` and `decision` true and decided class,
    (n_runs,).
    """

    protocol: str
    classifier: str
    inputs: str
    label: np.ndarray
    decision: np.ndarray


def main(arguments: Haizhe) -> None:
    """Classify with every input under every protocol, and on the official test split if present."""
    splits = {"train": checked(load(arguments.folder, "train"))}
    if (arguments.folder / "test").is_dir():
        splits["test"] = load(arguments.folder, "test")
    with run_folder(arguments.output, "haizhe", arguments) as folder:
        seed = arguments.seed
        scores = [score(decisions, seed) for decisions in decide(splits, seed)]
        counts = {split: class_counts(runs).tolist() for split, runs in splits.items()}
        sessions = session_accuracy(splits["train"], seed)
        command = f"auv-fault haizhe {arguments.folder} --seed {seed}"
        results = page(command, counts, scores, sessions)
        write_json(folder / "results.json", results)
        write_report(results, folder)
        write_markdown(results, folder)
    print_tables(results["sections"], whole=True)
    print(f"\nReport: {arguments.output / 'index.html'}")


def checked(runs: list[Run]) -> list[Run]:
    """The runs, if every class has one for each fold and both halves of the day have runs."""
    fewest = int(class_counts(runs).min())
    remedy = "get the whole split"
    if fewest < FOLDS:
        allowed = f"from {FOLDS}, one per fold"
        raise refusal("runs of a class in train", fewest, allowed, remedy)
    if len(set(is_evening(runs))) < 2:
        allowed = "some before, some after 18:00"
        raise refusal("runs in train", "one half of the day", allowed, remedy)
    return runs


def class_counts(runs: Sequence[Run]) -> np.ndarray:
    """Number of runs of each class, (n_classes,)."""
    return np.bincount(labels(runs), minlength=len(CLASSES))


def labels(runs: Sequence[Run]) -> np.ndarray:
    """The class of each run, (n_runs,)."""
    return np.array([run.label for run in runs])


def held_out(runs: Sequence[Run], seed: int) -> dict[str, np.ndarray]:
    """By protocol the fold of each run, (n_runs,).

    `stratified` samples the folds at random, so that a run's neighbours in time are among the
    training runs; `time blocks` holds out a fifth of each class' recording time, `half of the day`
    all runs before or after 18:00.
    """
    return {
        "stratified": shuffled_folds(labels(runs), FOLDS, seed),
        "time blocks": time_blocks(runs, FOLDS),
        "half of the day": is_evening(runs).astype(np.int64),
    }


def decide(splits: dict[str, list[Run]], seed: int) -> list[Decisions]:
    """Decisions by every classifier with every input under every protocol.

    The official split is first, if present.
    """
    runs = splits["train"]
    tests = splits.get("test", [])
    label = labels(runs)
    protocols = held_out(runs, seed)
    decisions = []
    cases = list(product(CLASSIFIERS.items(), INPUTS.items()))
    for (classifier, new), (name, inputs_of) in tqdm(cases, desc="classifiers", unit="input"):
        inputs = np.array([inputs_of(run) for run in runs])
        if tests:
            test_inputs = np.array([inputs_of(run) for run in tests])
            decision = new(seed).fit(inputs, label).predict(test_inputs)
            decisions.append(Decisions(OFFICIAL, classifier, name, labels(tests), decision))
        for protocol, folds in protocols.items():
            decision = cross_decide(new(seed), inputs, label, folds)
            decisions.append(Decisions(protocol, classifier, name, label, decision))
    order = [OFFICIAL, *protocols]
    return sorted(decisions, key=lambda entry: order.index(entry.protocol))


def score(decisions: Decisions, seed: int) -> dict[str, Any]:
    """Accuracy (Wilson's interval), macro-F1 (runs resampled), and the confusion matrix.

    The confusion matrix holds shares of each true class. Misleads: the intervals take runs as
    independent, but those of a session are not, so that they are too narrow.
    """
    label = decisions.label
    decision = decisions.decision
    counts = confusion(label, decision, len(CLASSES))
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    correct = binomtest(int(np.trace(counts)), len(label))
    return {
        "protocol": decisions.protocol,
        "classifier": decisions.classifier,
        "inputs": decisions.inputs,
        "accuracy": correct.statistic,
        "accuracy_interval": list(correct.proportion_ci(method="wilson")),
        "macro_f1": float(macro_f1(counts)),
        "f1_interval": f1_interval(label, decision, len(CLASSES), seed),
        "confusion": shares.tolist(),
    }


def session_accuracy(runs: Sequence[Run], seed: int) -> dict[str, dict[str, Any]]:
    """By class: runs before and after 18:00, and how well their samples at rest are distinguished.

    The accuracy is a forest's balanced accuracy by stratified cross-validation on the first sample,
    chance 0.5; None where a half has fewer runs than folds.
    """
    sessions = {}
    for k, name in enumerate(CLASSES):
        members = [run for run in runs if run.label == k]
        evening = is_evening(members).astype(np.int64)
        counts = np.bincount(evening, minlength=2)
        accuracy = None
        if counts.min() >= FOLDS:
            rest = np.array([INPUTS["rest only"](run) for run in members])
            folds = shuffled_folds(evening, FOLDS, seed)
            matrix = confusion(evening, cross_decide(forest(seed), rest, evening, folds), 2)
            accuracy = float(np.mean(np.diag(matrix) / counts))
        sessions[name] = {"runs": counts.tolist(), "balanced_accuracy": accuracy}
    return sessions
