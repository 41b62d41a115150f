import json
import shutil
import sys
from itertools import product

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training import cli
from training.commands import haizhe
from training.datasets import forests, haizhe_runs
from training.datasets.haizhe_runs import CLASSES, READINGS

HEADER = (
    "time,pwm1,pwm2,pwm3,pwm4,depth,press,voltage,roll,pitch,yaw,a_x,a_y,a_z,w_row,w_pitch,w_yaw"
)
ROWS = 40
WIDE = 1000  # characters of a terminal in which no cell is broken
RUNS = 10  # of a class: half before 18:00, half after


def write_run(path, clock, seed, session=0.0, fault=0.0):
    """A run whose yaw rate oscillates the faster the larger `fault`, and whose readings the session
    offsets.
    """
    random = np.random.default_rng(seed)
    readings = 0.1 * random.normal(size=(ROWS, len(READINGS)))
    moving = np.arange(ROWS) > 2
    readings[:, READINGS.index("w_yaw")] += moving * 10.0 * np.sin((1.0 + fault) * np.arange(ROWS))
    readings += session
    readings[:, READINGS.index("yaw")] = (170.0 + np.arange(ROWS)) % 360.0 - 180.0
    rows = [
        ",".join([str(clock), *[str(1196 if on else 1100)] * 4, *(f"{value:.3f}" for value in row)])
        for on, row in zip(moving, readings, strict=True)
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([HEADER, *rows]) + "\n")


def write_split(folder, session=lambda label, evening: 0.0, fault=lambda label: 0.0, runs=RUNS):
    for label, name in enumerate(CLASSES):
        for k in range(runs):
            evening = k % 2
            clock = (190000 if evening else 150000) + 100 * k
            path = folder / name / f"{name}_{k}.csv"
            write_run(path, clock, 100 * label + k, session(label, evening), fault(label))


@pytest.fixture
def few_trees(monkeypatch):
    monkeypatch.setattr(forests, "TREES", 12)
    monkeypatch.setattr(forests, "ROUNDS", 2)


def scores(folder):
    runs = haizhe_runs.load(folder, "train")
    found = [haizhe.score(one, 0) for one in haizhe.decide({"train": runs}, 0)]
    of_forest = [one for one in found if one["classifier"] == "forest"]
    return {(one["protocol"], one["inputs"]): one["accuracy"] for one in of_forest}


def test_a_run_is_read_with_its_class_its_hour_and_an_unwrapped_yaw(tmp_path):
    write_run(tmp_path / "AddWeight" / "AddWeight_3.csv", 20128, 0)
    run = haizhe_runs.read_run(tmp_path / "AddWeight" / "AddWeight_3.csv")
    assert CLASSES[run.label] == "AddWeight"
    assert run.time == 2 * 3600 + 60 + 28
    assert run.readings.shape == (ROWS, len(READINGS))
    np.testing.assert_allclose(np.diff(run.readings[:, READINGS.index("yaw")]), 1.0, atol=1e-9)
    assert run.command[0] == 1100 and run.command[-1] == 1196


def test_features_of_a_known_signal():
    time = np.arange(197) / haizhe_runs.RATE
    found = haizhe_runs.features((3.0 + np.sin(2 * np.pi * time))[:, None])
    assert found[0] == pytest.approx(3.0, abs=0.01)  # mean
    assert found[1] == pytest.approx(0.5**0.5, abs=0.01)  # standard deviation
    assert found[2:4] == pytest.approx([2.0, 4.0], abs=0.02)  # least and largest
    assert found[-3] > 0.95  # 1 Hz lies between 0.5 and 2 Hz
    assert found[-4:].sum() == pytest.approx(1.0)


def test_features_of_a_signal_by_hand():
    signal = np.array([4.0] * 10 + [6.0] + [5.0] * 9 + [2.0])
    found = haizhe_runs.features(signal[:, None])
    assert found[4] == -2.0  # last less first
    assert found[5] == pytest.approx((2.0 + 1.0 + 3.0) / 20)  # mean step
    assert found[6:9].tolist() == [3.0, 4.0, 2.0]  # largest step, first, last
    # in order: 2, ten of 4, nine of 5, 6; the quantiles are elements 1, 5, 10, 15 and 19
    assert found[9:14].tolist() == [4.0, 4.0, 4.0, 5.0, 5.0]
    two = haizhe_runs.features(np.column_stack([signal, 10.0 * signal]))
    assert two[12:14].tolist() == [3.0, 30.0]  # a figure of all signals, then the next figure


def test_a_reading_that_stands_still_has_features_too():
    assert np.isfinite(haizhe_runs.features(np.full((20, 2), 7.0))).all()


def test_time_blocks_are_consecutive_within_each_class(tmp_path):
    write_split(tmp_path / "train")
    runs = haizhe_runs.load(tmp_path, "train")
    block = haizhe_runs.time_blocks(runs, 5)
    for label in range(len(CLASSES)):
        members = sorted((run.time, block[k]) for k, run in enumerate(runs) if run.label == label)
        assert [b for _, b in members] == sorted(b for _, b in members)
        assert np.bincount(block[[run.label == label for run in runs]]).tolist() == [2] * 5


def test_a_fault_in_the_motion_is_found_and_no_control_finds_it(tmp_path, few_trees):
    write_split(tmp_path / "train", fault=lambda label: 0.4 * label)
    found = scores(tmp_path)
    for protocol in ("stratified", "time blocks", "half of the day"):
        assert found[protocol, "whole run"] > 0.9
        assert found[protocol, "rest removed"] > 0.9
        assert found[protocol, "rest only"] < 0.5
        assert found[protocol, "command only"] < 0.5


def test_a_session_is_betrayed_by_the_rest_and_lost_with_it(tmp_path, few_trees):
    write_split(tmp_path / "train", session=lambda label, evening: 3.0 * (label + 5 * evening))
    found = scores(tmp_path)
    assert found["stratified", "rest only"] > 0.9
    assert found["stratified", "rest removed"] < 0.5
    assert found["half of the day", "rest only"] < 0.5  # other sessions, other offsets
    sessions = haizhe.session_accuracy(haizhe_runs.load(tmp_path, "train"), 0)
    assert sessions["Normal"] == {"runs": [5, 5], "balanced_accuracy": 1.0}


def test_the_command_reports_the_official_split_where_it_is_there(tmp_path, few_trees, capsys):
    write_split(tmp_path / "data" / "train", fault=lambda label: 0.4 * label)
    write_split(tmp_path / "data" / "test", fault=lambda label: 0.4 * label, runs=3)
    output = tmp_path / "out"
    assert cli.main(["haizhe", str(tmp_path / "data"), "--output", str(output)]) == 0
    assert "official test split" in capsys.readouterr().out
    results = json.loads((output / "results.json").read_text())
    first = results["scores"][0]
    assert (first["protocol"], first["inputs"]) == ("official test split", "whole run")
    assert first["accuracy"] > 0.9
    low, high = first["accuracy_interval"]
    assert low < first["accuracy"] <= high <= 1.0
    assert np.sum(first["confusion"]) == pytest.approx(len(CLASSES))
    assert {"manifest.json", "results.json", "index.html"} <= {
        path.name for path in output.iterdir()
    }


def test_the_same_seed_gives_the_same_decisions_and_another_seed_others(few_trees):
    random = np.random.default_rng(0)
    inputs = random.normal(size=(60, 4))
    label = np.arange(60) % 5
    folds = forests.shuffled_folds(label, 5, 0)
    first, again, other = (
        forests.cross_decide(forests.forest(seed), inputs, label, folds) for seed in (0, 0, 1)
    )
    assert (first == again).all()
    assert (first != other).any()


def test_boosting_finds_a_rule_of_two_inputs_and_nothing_where_there_is_none():
    random = np.random.default_rng(0)
    inputs = random.normal(size=(400, 4))
    label = 2 * (inputs[:, 0] > 0) + (inputs[:, 1] > 0)
    folds = forests.shuffled_folds(label, 5, 0)
    found = forests.cross_decide(forests.boosting(0), inputs, label, folds)
    assert np.mean(found == label) > 0.9
    other = forests.cross_decide(forests.boosting(0), inputs, random.permutation(label), folds)
    assert np.mean(other == label) < 0.4


def test_every_classifier_decides_every_run_that_is_held_out(tmp_path, few_trees):
    write_split(tmp_path / "train")
    runs = haizhe_runs.load(tmp_path, "train")
    decided = haizhe.decide({"train": runs}, 0)
    found = {(one.protocol, one.classifier, one.inputs) for one in decided}
    protocols = ("stratified", "time blocks", "half of the day")
    assert len(decided) == len(found) == 3 * 2 * len(haizhe_runs.INPUTS)
    assert found == set(product(protocols, ("forest", "boosting"), haizhe_runs.INPUTS))
    assert all(len(one.decision) == len(runs) for one in decided)


def test_the_page_says_what_was_measured_and_prints_every_column(
    tmp_path, few_trees, capsys, monkeypatch
):
    monkeypatch.setattr("training.report.page.PRINTED_WIDTH", WIDE)
    write_split(tmp_path / "data" / "train", fault=lambda label: 0.4 * label)
    output = tmp_path / "out"
    assert cli.main(["haizhe", str(tmp_path / "data"), "--output", str(output)]) == 0
    printed = capsys.readouterr().out
    results = json.loads((output / "results.json").read_text())
    tables = {section["heading"]: section.get("table") for section in results["sections"]}
    by_class = tables["Recognised, by class"]
    assert by_class["columns"] == ["held out", "classifier", "input", *CLASSES]
    for words in (by_class["columns"], *by_class["rows"]):
        assert any(line.split() == " ".join(words).split() for line in printed.splitlines()), words
    score = {(one["protocol"], one["classifier"], one["inputs"]): one for one in results["scores"]}
    text = " ".join(results["sections"][1]["text"])
    for classifier in ("forest", "boosting"):
        confusion = score["stratified", classifier, "rest only"]["confusion"]
        slight, bad = (f"{100 * confusion[k][k]:.0f} % of {CLASSES[k]}" for k in (3, 4))
        assert f"{classifier} recognises {slight} and {bad}" in text
    assert "Of the 10 runs of Normal 5 were made before 18:00" in text
    whole = score["time blocks", "boosting", "whole run"]["accuracy"]
    rest = score["time blocks", "boosting", "rest only"]["accuracy"]
    (row,) = [
        row
        for row in tables["What the controls say"]["rows"]
        if row[:2] == ["time blocks", "boosting"]
    ]
    assert row[2:4] == [f"{100 * whole:.1f}", f"{100 * (whole - rest):+.1f}"]


def refused(capsys, *arguments):
    assert cli.main(["haizhe", *map(str, arguments)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def test_a_missing_folder_says_where_to_get_the_data(tmp_path, capsys):
    assert "10.17632/7rp2pmr6mx.1" in refused(capsys, tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "mpty CSV"),
        (HEADER, "mpty CSV"),
        ("time,depth\n1,2\n", "pwm1"),
        (HEADER + "\n" + ",".join(["x"] * 17) + "\n", "conversion error"),
        (
            "\n".join([HEADER] + [",".join(["1"] * 16 + [""])] * ROWS) + "\n",
            f"{ROWS} cells without a number",
        ),
    ],
    ids=["empty", "header only", "other columns", "words", "gaps"],
)
def test_a_broken_file_is_named(tmp_path, capsys, text, said):
    write_split(tmp_path / "train")
    (tmp_path / "train" / "Normal" / "Normal_0.csv").write_text(text)
    error = refused(capsys, tmp_path, "--output", tmp_path / "out")
    assert "Normal_0.csv" in error and said in error
    assert not (tmp_path / "out").exists()


def test_an_unknown_class_and_too_few_runs_are_refused(tmp_path, capsys):
    write_split(tmp_path / "train", runs=4)
    assert "from 5" in refused(capsys, tmp_path)
    shutil.move(tmp_path / "train" / "AddWeight", tmp_path / "train" / "AddWait")
    assert "did you mean 'AddWeight'?" in refused(capsys, tmp_path)


def test_without_scikit_learn_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    with pytest.raises(InputError, match=r"auv-fault\[data\]"):
        forests.forest(0)
