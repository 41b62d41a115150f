"""The history of speeds: runs are added, read again, and drawn by machine."""

import json

import pytest

from auv_fault_env.errors import InputError
from training.report.figures.registry import draw
from training.studies.speed import Size, Speed, report
from training.studies.speed_history import (
    KEYS,
    SHOWN,
    SpeedHistory,
    append,
    figure_data,
    main,
    read,
)

MACHINE = {"processor": "a processor", "cores": 2, "versions": {"python": "3.11.0"}}
OTHER = MACHINE | {"processor": "another one"}
RATIOS = {"single": 0.7, "serial": 31.0, "parallel": 43.0, "gem": 33.0}


@pytest.fixture
def history(tmp_path):
    path = tmp_path / "history.jsonl"
    append(path, MACHINE, RATIOS)
    append(path, OTHER, RATIOS | {"single": 0.5})
    append(path, MACHINE, RATIOS | {"single": 0.8})
    return path


def test_runs_are_read_as_they_were_added(history):
    entries = read(history)
    assert [entry["ratios"]["single"] for entry in entries] == [0.7, 0.5, 0.8]
    assert entries[1]["machine"] == OTHER and set(entries[0]) == KEYS


def test_the_figure_shows_each_machine_for_itself(history, tmp_path):
    data = figure_data(read(history))["machines"]
    assert [len(of_machine["date"]) for of_machine in data.values()] == [2, 1]
    first = data["a processor, 2 cores"]["ratios"]
    assert first[SHOWN["single"]] == [0.7, 0.8] and first[SHOWN["parallel"]] == [43.0, 43.0]
    (axis,) = draw("speed_history", {"machines": data}).axes
    assert len(axis.lines) == 2 * len(SHOWN)
    assert axis.lines[0].get_ydata().tolist() == [0.7, 0.8]
    main(SpeedHistory(history, tmp_path / "history.png"))
    assert (tmp_path / "history.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("line", ["no JSON", "[1]", json.dumps({"date": "2026-01-01"})])
def test_a_line_of_another_form_is_refused_before_anything_is_measured(tmp_path, line):
    path = tmp_path / "history.jsonl"
    append(path, MACHINE, RATIOS)
    with path.open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InputError, match=r"line 2 of .*remove the line"):
        report(Speed(history=path, output=tmp_path / "run"), Size(5, 70, 3, 0.0))
    assert not (tmp_path / "run").exists()
