"""docs/real_data.md holds what the two commands write, word for word but for the data's figures."""

import re
from pathlib import Path

import numpy as np
import pytest

from training.commands import esso_osaka, haizhe
from training.datasets import esso_osaka_page, haizhe_page
from training.datasets.esso_osaka_runs import Inputs, ShipRun
from training.datasets.haizhe_runs import CLASSES, INPUTS
from training.datasets.surge_fit import acceleration
from training.report.markdown import markdown

DOCUMENT = (Path(__file__).parents[3] / "docs" / "real_data.md").read_text(encoding="utf-8")
TRUTH = (-0.03, 1e-8, -0.1, 1.0, -4e-4)


def skeletons(text):
    """The paragraphs without their figures, of tables the head."""
    found = []
    for paragraph in text.strip().split("\n\n"):
        head = re.sub(r"\n\|(?!---).*", "", paragraph) if paragraph[0] == "|" else paragraph
        files = re.sub(r"--score .* --seed", "--score FILES --seed", head)
        runs = re.sub(r"\b\d\d-\w{3}-\d{4}\w*", "RUN", files)
        target = re.sub(r"\((met|missed by [\d.]+ mm/s)\)", "(target)", runs)
        found.append(re.sub(r"[-+]?\d+(\.\d+)?(e[-+]\d+)?", "#", " ".join(target.split())))
    return found


def haizhe_report():
    random = np.random.default_rng(0)
    label = np.arange(50) % len(CLASSES)
    scores = [
        haizhe.score(
            haizhe.Decisions(protocol, classifier, name, label, random.permutation(label)), 0
        )
        for protocol in ("stratified", "time blocks", "half of the day")
        for classifier in ("forest", "boosting")
        for name in INPUTS
    ]
    sessions = {name: {"runs": [5, 5], "balanced_accuracy": 0.5} for name in CLASSES}
    command = "auv-fault haizhe FOLDER --seed 0"
    return markdown(haizhe_page.page(command, {"train": [10] * len(CLASSES)}, scores, sessions))


def ship_run(seed):
    random = np.random.default_rng(seed)
    signals = np.repeat(random.normal(size=(5, 10)), 100, axis=1)
    inputs = Inputs(0.1 * signals[0], 0.1 * signals[1], 300 * signals[2], signals[3], signals[4])
    speed = np.full(1000, 0.1)
    for k in range(999):
        rate = acceleration(esso_osaka.MODEL, TRUTH, speed[k], inputs.at(k))
        speed[k + 1] = speed[k] + 0.1 * rate
    return ShipRun(f"0{seed}-Aug-2020_00_00_00", speed, inputs)


def ship_report(scored):
    findings = esso_osaka.study([ship_run(k) for k in (1, 2, 3)], scored, 0)
    words = "--score FOLDER/random/a.csv " if scored else ""
    command = f"auv-fault esso-osaka FOLDER {words}--seed 0"
    return markdown(esso_osaka_page.page(command, findings))


@pytest.fixture(scope="module")
def written():
    """The paragraphs that the commands write: of haizhe, of esso-osaka, and of scored runs."""
    whole = skeletons(ship_report([]))
    scored = skeletons(ship_report([ship_run(k) for k in (4, 5, 6)]))
    return {"haizhe": skeletons(haizhe_report()), "ships": whole, "scored": scored}


@pytest.mark.parametrize("name", ["haizhe", "ships"])
def test_the_document_holds_all_that_a_command_writes(written, name):
    missing = [text for text in written[name] if text not in skeletons(DOCUMENT)]
    assert missing == []


def test_the_document_holds_the_scores_of_runs_that_enter_no_fit(written):
    only_scored = [text for text in written["scored"] if text not in written["ships"]]
    assert len(only_scored) >= 3  # command, words and table
    assert [text for text in only_scored if text not in skeletons(DOCUMENT)] == []


def test_a_figure_of_the_document_is_one_that_a_command_wrote(written):
    body = DOCUMENT[DOCUMENT.index("\n## ") :]
    known = {text for texts in written.values() for text in texts}
    with_figures = [text for text in skeletons(body) if "#" in text.lstrip("#")]
    assert [text for text in with_figures if text not in known] == []
