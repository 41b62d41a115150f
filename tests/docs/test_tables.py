"""The tables of the documents that list a registry list all of it."""

import re
from pathlib import Path

from auv_fault_env import CATALOGUE
from auv_fault_env.wrappers.signal_faults import KINDS
from diagnosers import NAMES
from training.stimuli import STIMULI

DOCS = Path(__file__).parents[2] / "docs"


def first_cells(page):
    """The code in the first cell of each row of the tables of a page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", text, re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


def test_every_fault_is_listed():
    assert first_cells("faults.md") == list(dict.fromkeys(n.partition(":")[0] for n in CATALOGUE))


def test_every_kind_of_a_signal_fault_is_listed():
    kinds = {kind for of_target in KINDS.values() for kind in of_target}
    assert set(first_cells("fault_injection.md")) == kinds


def test_every_diagnoser_is_listed():
    assert sorted(first_cells("diagnosers.md")) == sorted(NAMES)


def test_every_stimulus_is_listed():
    named = {*first_cells("active.md"), "learned_2", "learned_3"}  # `learned_1` to `learned_4`
    assert named == set(STIMULI)
