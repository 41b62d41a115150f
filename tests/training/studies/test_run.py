"""The frame of a study: results, page and printed tables; exit codes and messages."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from auv_fault_env.errors import refusal
from training.report.run_folder import read_manifest
from training.studies.run import command_line, run_study


@dataclass(frozen=True)
class Arguments:
    output: Path
    first_seed: int = 3


def section(heading, **more):
    table = {"columns": ["a"], "rows": [["1"]]}
    return {"heading": heading, "text": [], "table": table} | more


def page(results):
    sections = [section("printed"), section("details", printed=False)]
    return {"title": "t", "intro": [], "command": results["command"], "sections": sections}


def test_a_study_leaves_results_page_and_manifest_and_prints_its_tables(tmp_path, capsys):
    output = tmp_path / "run"
    report = run_study("name", Arguments(output), lambda folder: {"a": 1}, page)
    assert report["title"] == "t"
    command = "python -m training.studies.name --first-seed 3"
    assert json.loads((output / "results.json").read_text()) == {"command": command, "a": 1}
    assert "details" in (output / "index.html").read_text()
    assert read_manifest(output)["command"] == "python -m training.studies.name"
    printed = capsys.readouterr().out
    assert "printed" in printed and "details" not in printed and str(output) in printed


def refuse():
    raise refusal("lanes", 0, "a whole number from 1", "give one")


def interrupt():
    raise KeyboardInterrupt


STUDY = """
from training.studies.run import command_line

def main(name: str = "–→\\x1b"):
    print(name, flush=True)

command_line(main)
"""


def run(**options):
    environment = os.environ | {"PYTHONIOENCODING": "latin-1"}
    command = [sys.executable, "-c", STUDY]
    return subprocess.run(command, env=environment, stderr=subprocess.PIPE, **options)


def test_what_the_terminal_lacks_or_obeys_is_replaced():
    done = run(stdout=subprocess.PIPE)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"??\\x1b\n", b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_device_is_one_line_and_a_reader_that_has_gone_is_none():
    with open("/dev/full", "wb") as full:
        done = run(stdout=full)
    assert done.returncode == 2 and done.stderr.count(b"\n") == 1
    assert b"standard output is lost: No space left on device" in done.stderr
    reading, writing = os.pipe()
    os.close(reading)
    done = run(stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(
    ("main", "code", "words"),
    [(lambda: None, 0, ""), (refuse, 2, "study: lanes: got 0"), (interrupt, 130, "stopped")],
)
def test_exit_codes_and_one_line_on_the_error_stream(main, code, words, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["training/studies/study.py"])
    with pytest.raises(SystemExit) as end:
        command_line(main)
    error = capsys.readouterr().err
    assert end.value.code == code
    assert words in error and error.count("\n") == (0 if code == 0 else 1)
