"""The examples of docs/formats.md that read a data set run on one."""

import re
from pathlib import Path

import numpy as np
import pytest

from training import cli
from training.commands import simulate

DOCUMENT = Path(__file__).parents[2] / "docs" / "formats.md"
BLOCKS = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
COMMAND = "simulate --vehicles 20 --output runs/faults"


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    """The folder in which the command of the document has run."""
    assert f"    auv-fault {COMMAND}\n" in DOCUMENT.read_text(encoding="utf-8")
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(simulate, "write_report", lambda *_: None)
        assert cli.main(COMMAND.split()) == 0
    return folder


def run(data_set, monkeypatch, library):
    """The names that the example with this library leaves."""
    pytest.importorskip(library)
    block = next(block for block in BLOCKS if f"import {library}" in block)
    monkeypatch.chdir(data_set)
    names = {}
    exec(block, names)
    return names


def test_the_example_with_pandas(data_set, monkeypatch):
    names = run(data_set, monkeypatch, "pandas")
    assert len(names["readings"]) == 20 * 600
    assert names["shares"].sum() == pytest.approx(1.0) and "normal" in names["shares"].index
    after = names["after_onset"]
    assert len(after) > 1000 and (after["time"] > after["onset"]).all()
    # an onset within the episode is in the worst class of the sample after it
    first = names["faulty"].query("time > onset and time <= onset + 0.2")
    assert (first["truth_label"] != "normal").mean() > 0.5
    assert names["units"]["episodes", "port_rpm"] == "rpm"


def test_the_example_with_pyarrow(data_set, monkeypatch):
    names = run(data_set, monkeypatch, "pyarrow")
    assert names["speed"].shape == (600,) and names["speed"].dtype == np.float32
    assert names["unit"] == "m/s"


def test_the_example_with_the_expressions_of_polars(data_set, monkeypatch):
    names = run(data_set, monkeypatch, "narwhals")
    energy = names["energy"].to_native()
    assert energy["vehicle"].to_pylist() == list(range(20))
    assert min(energy["truth_energy"].to_pylist()) > 0.0
