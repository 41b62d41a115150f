"""Submissions from the command line to the row."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from training import cli
from training.benchmark import timing, workers
from training.submissions import page, row, scoring

TINY = [
    *("--suite", "thesis", "--lanes", "3", "--hours", "0.05", "--counting-hours", "0.05"),
    *("--workers", "1"),
]
MINE = """
from pathlib import Path

import numpy as np
from diagnosers import Belief, Recursive

BIAS = float((Path(__file__).parent / "bias.txt").read_text())


class Mine(Recursive):
    name = "mine"

    def initial(self, n_lanes):
        return ()

    def step(self, state, observation):
        score = np.zeros((len(observation), len(self.classes)))
        score[:, 0] = BIAS + 0.01 * observation[:, 8]
        log_probability = score - np.logaddexp.reduce(score, axis=1, keepdims=True)
        return state, Belief(log_probability, 0 * score, 0 * score)


class Told(Mine):
    def set_truth(self, healthy, severity):
        pass


class Late(Mine):
    def step(self, state, observation):
        if len(observation) == 3:
            raise RuntimeError("three\\nlanes")
        return super().step(state, observation)


class Mixed(Mine):
    def step(self, state, observation):
        return super().step(state, observation - observation.mean(axis=0))


class NoDiagnoser:
    pass
"""


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "bias.txt").write_text("3.0")
    return tmp_path


@pytest.fixture
def here(monkeypatch):
    """Run the code of submissions in this process, which is quicker, and does not end it."""

    def called(function, *arguments, limit):
        answer = function(*arguments)
        is_arrays = all(isinstance(value, np.ndarray) for value in answer.values())
        return answer if is_arrays else json.loads(json.dumps(answer))

    for module in (scoring, workers):
        monkeypatch.setattr(module, "call_in_own_process", called)
    for name in ("WARM_UP", "ONE_BY_ONE", "MANY_LANES", "MANY_SAMPLES", "DIFFERENT"):
        monkeypatch.setattr(timing, name, 2)
    monkeypatch.chdir(os.getcwd())
    monkeypatch.setattr(sys, "path", list(sys.path))


def submit(folder, *more, target="mine.py:Mine", output="row.json"):
    path = folder / output
    target = f"{folder}/{target}"
    files = ["--files", f"{folder}/bias.txt"] if ".py:" in target else []
    words = ["submit", target, *files, *TINY, "--output", str(path), *more]
    return cli.main(words), path


def test_a_score_is_that_of_the_row_s_nonce_again(mine, here, capfd):
    code, path = submit(mine)
    assert code == 0
    first = row.read(path)
    assert first.name == "mine" and first.nonce_from is None
    assert first.seeds["faulty"]["count"] == 3 and set(first.files) == {"mine.py", "bias.txt"}
    code, path = submit(
        mine, "--nonce", first.nonce, "--nonce-from", "round 7", output="again.json"
    )
    again = row.read(path)
    assert code == 0 and again.nonce_from == "round 7"
    assert (again.figures, again.seeds, again.episodes) == (
        first.figures,
        first.seeds,
        first.episodes,
    )
    (mine / "bias.txt").write_text("3.1")
    code, path = submit(mine, "--nonce", first.nonce, output="changed.json")
    changed = row.read(path)
    assert code == 0 and changed.episodes != first.episodes
    assert all(changed.seeds[part] != first.seeds[part] for part in first.seeds)
    assert first.digest in capfd.readouterr().out
    rows = page.tables({mine / "row.json": first}, mine)
    assert f"--nonce {first.nonce}" in rows and page.UNVERIFIED in rows


def test_code_of_a_submission_runs_in_processes_of_its_own(mine):
    """And among its own files only: it does not find a file that is not named."""
    before = os.getcwd(), list(sys.path), set(sys.modules)
    code, path = submit(mine)
    assert code == 0 and row.read(path).name == "mine"
    after = os.getcwd(), list(sys.path), set(sys.modules)
    assert before[:2] == after[:2]
    assert not any(name.startswith("third_party_") for name in after[2] - before[2])


def test_an_onnx_network_is_scored(mine, here):
    networks = pytest.importorskip("tests.training.submissions.networks")
    pytest.importorskip("onnxruntime")
    (mine / "net.onnx").write_bytes(networks.counting_network())
    code, path = submit(mine, target="net.onnx")
    found = row.read(path)
    assert code == 0 and found.name == "net" and set(found.files) == {"net.onnx"}
    assert found.figures["declared_wrong"].value == 0.0


@pytest.mark.parametrize(
    ("target", "more", "words"),
    [
        ("absent.py:Mine", (), "check the path"),
        ("mine.py:Absent", (), "mine.py: got 'Absent'; allowed is one of "),
        ("mine.py", (), "mine.py:Class"),
        ("mine.py:NoDiagnoser", (), "reset and update"),
        ("mine.py:Told", (), "set_truth"),
        ("mine.py:Mixed", (), "keep lanes apart"),
        ("mine.py:Late", (), "RuntimeError: three lanes"),
        ("damaged.onnx", (), "an ONNX network"),
        ("mine.py:Mine", ("--nonce-from", "x"), "give the nonce too"),
        ("mine.py:Mine", ("--nonce", ""), "printable characters"),
        ("mine.py:Mine", ("--lanes", "257"), "take fewer"),
        ("mine.py:Mine", ("--suite", "thesys"), "did you mean 'thesis'"),
        ("mine.py:Mine", ("--hours", "0"), "hours"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(mine, here, capfd, target, more, words):
    pytest.importorskip("onnxruntime")
    (mine / "damaged.onnx").write_bytes(b"\x08\x07" + 100 * b"\xff")
    before = set(mine.iterdir())
    code, _ = submit(mine, *more, target=target)
    assert code == 2
    lines = capfd.readouterr().err.replace("\r", "\n").strip().splitlines()
    assert lines[-1].startswith("auv-fault submit: ") and words in lines[-1]
    assert set(mine.iterdir()) - {mine / "__pycache__"} == before


def test_an_existing_row_is_not_replaced(mine, capfd):
    (mine / "row.json").write_text("mine")
    code, path = submit(mine)
    assert code == 2 and path.read_text() == "mine"
    assert "a new file" in capfd.readouterr().err


def test_the_digest_is_printed_without_running_anything(mine, capfd):
    (mine / "mine.py").write_text("raise SystemExit(9)")
    code, path = submit(mine, "--digest")
    assert code == 0 and not path.exists()
    submission, recipe = capfd.readouterr().out.splitlines()
    assert len(submission.split()[1].strip(",")) == 64
    assert recipe.startswith("recipe: thesis, 3 faulty episodes, thresholds on 0.05 h")


def test_the_page_is_written_from_rows(mine, here, capfd, monkeypatch):
    monkeypatch.setattr(row, "LEAST_LANES", 1)
    monkeypatch.setattr(row, "LEAST_HOURS", 0.01)
    (mine / "rows").mkdir()
    assert submit(mine, output="rows/row.json")[0] == 0
    (mine / "page.md").write_text(f"before\n{page.BEGIN}{page.END}after\n")
    words = ["leaderboard", "--rows", f"{mine}/rows", "--page", f"{mine}/page.md"]
    assert cli.main(words) == 0
    text = (mine / "page.md").read_text(encoding="utf-8")
    assert "| mine |" in text and "(rows/row.json)" in text
    (mine / "rows" / "row.json").write_text("{}")
    assert cli.main(words) == 2
    assert (mine / "page.md").read_text(encoding="utf-8") == text
    shown = capfd.readouterr().err.replace("\r", "\n").strip().splitlines()
    assert shown[-1].startswith("auv-fault leaderboard: row ")
    assert {path.name for path in Path(mine).iterdir()} >= {"rows", "page.md"}
