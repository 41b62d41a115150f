"""``auv-fault haizhe``: faults of a real vehicle classified, beside the controls that show what the sessions betray."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest
from tqdm import tqdm

from auv_fault_env.errors import refusal
from training.arguments import Haizhe
from training.datasets.forests import cross_decide, forest, shuffled_folds
from training.datasets.haizhe_page import page
from training.datasets.haizhe_runs import CLASSES, INPUTS, Run, is_evening, load, time_blocks
from training.metrics import confusion, macro_f1
from training.metrics.intervals import f1_interval
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

FOLDS = 5
OFFICIAL = "official test split"


class Decisions(NamedTuple):
    """What a forest that saw these `inputs` of other runs said of the runs that a `protocol` held out, (n_runs,)."""

    protocol: str
    inputs: str
    label: np.ndarray
    decision: np.ndarray


def main(arguments: Haizhe) -> None:
    """Classify under every protocol with every input; the official test split too where it is there."""
    splits = {"train": checked(load(arguments.folder, "train"))}
    if (arguments.folder / "test").is_dir():
        splits["test"] = load(arguments.folder, "test")
    with run_folder(arguments.output, "haizhe", arguments) as folder:
        scores = [score(decisions, arguments.seed) for decisions in decide(splits, arguments.seed)]
        counts = {
            split: np.bincount(labels(runs), minlength=len(CLASSES)).tolist()
            for split, runs in splits.items()
        }
        command = f"auv-fault haizhe {arguments.folder} --seed {arguments.seed}"
        results = page(command, counts, scores, halves_told_apart(splits["train"], arguments.seed))
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"])
    print(f"\nReport: {arguments.output / 'index.html'}")


def checked(runs: list[Run]) -> list[Run]:
    """The runs, if there are enough of each class for the folds, and some of each half of the day; else a refusal."""
    fewest = int(np.bincount(labels(runs), minlength=len(CLASSES)).min())
    if fewest < FOLDS:
        raise refusal(
            "runs of a class in train", fewest, f"from {FOLDS}, one per fold", "get the whole split"
        )
    if len(set(is_evening(runs))) < 2:
        raise refusal(
            "runs in train",
            "one half of the day",
            "some before, some after 18:00",
            "get the whole split",
        )
    return runs


def labels(runs: Sequence[Run]) -> np.ndarray:
    """The class of each run, (n_runs,)."""
    return np.array([run.label for run in runs])


def held_out(runs: Sequence[Run], seed: int) -> dict[str, np.ndarray]:
    """By protocol the fold of each run, (n_runs,).

    `stratified` draws the folds at random, so that a run's neighbours in time are among those
    learnt from; `time blocks` holds out a fifth of each class' recording time, `half of the day`
    all runs before or after 18:00.
    """
    return {
        "stratified": shuffled_folds(labels(runs), FOLDS, seed),
        "time blocks": time_blocks(runs, FOLDS),
        "half of the day": is_evening(runs).astype(np.int64),
    }


def decide(splits: dict[str, list[Run]], seed: int) -> list[Decisions]:
    """Every input under every protocol; the official one first, if there is a test split."""
    runs = splits["train"]
    tests = splits.get("test", [])
    label = labels(runs)
    protocols = held_out(runs, seed)
    decisions = []
    for name, seen in tqdm(INPUTS.items(), desc="classifiers", unit="input"):
        inputs = np.array([seen(run) for run in runs])
        if tests:
            asked = np.array([seen(run) for run in tests])
            decision = forest(seed).fit(inputs, label).predict(asked)
            decisions.append(Decisions(OFFICIAL, name, labels(tests), decision))
        for protocol, folds in protocols.items():
            decisions.append(
                Decisions(protocol, name, label, cross_decide(inputs, label, folds, seed))
            )
    order = [OFFICIAL, *protocols]
    return sorted(decisions, key=lambda one: order.index(one.protocol))


def score(decisions: Decisions, seed: int) -> dict[str, Any]:
    """Accuracy (Wilson's interval), macro-F1 (runs resampled), and the confusion matrix as shares of each true class.

    The intervals take runs as independent; those of a session are not, and the truth lies further
    out.
    """
    label = decisions.label
    decision = decisions.decision
    counts = confusion(label, decision, len(CLASSES))
    hits = binomtest(int(np.trace(counts)), len(label))
    return {
        "protocol": decisions.protocol,
        "inputs": decisions.inputs,
        "accuracy": hits.statistic,
        "accuracy_interval": list(hits.proportion_ci(method="wilson")),
        "macro_f1": float(macro_f1(counts)),
        "f1_interval": f1_interval(label, decision, len(CLASSES), seed),
        "confusion": (counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)).tolist(),
    }


def halves_told_apart(runs: Sequence[Run], seed: int) -> dict[str, dict[str, Any]]:
    """By class: runs before and after 18:00, and how well the first sample, at rest, tells the two apart.

    As balanced accuracy of stratified cross-validation, chance 0.5; None where a half has fewer
    runs than folds.
    """
    told = {}
    for k, name in enumerate(CLASSES):
        members = [run for run in runs if run.label == k]
        evening = is_evening(members).astype(np.int64)
        counts = np.bincount(evening, minlength=2)
        told[name] = {"runs": counts.tolist(), "balanced_accuracy": None}
        if counts.min() >= FOLDS:
            rest = np.array([INPUTS["rest only"](run) for run in members])
            matrix = confusion(
                evening, cross_decide(rest, evening, shuffled_folds(evening, FOLDS, seed), seed), 2
            )
            told[name]["balanced_accuracy"] = float(np.mean(np.diag(matrix) / counts))
    return told
