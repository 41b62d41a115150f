"""Every column of any log is used, left out with a reason, or unknown."""

import tomllib

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.training.field.proposal.missions import N_ROWS, SIGNALS
from training.field.logs.table import Table
from training.field.proposal.proposal import propose
from training.field.proposal.text import text_of
from training.field.proposal.words import JOINED, OTHERS, QUANTITIES, ROLES, SYMBOLS

WORDS = [
    word
    for table in (QUANTITIES, ROLES, OTHERS)
    for words in table.values()
    for word in words.replace('"', " ").replace("|", " ").split()
]
MARKS = ["[V]", "(A)", "[uM]", "kn", "mA", "0", "1", "[0]", "[1]", "p", "s", "l", "r", "L", "R"]
VALUES = SIGNALS | {
    "infinite": np.where(np.arange(N_ROWS) % 7 == 0, np.inf, SIGNALS["V"]),
    "huge": 1e308 * SIGNALS["fraction"],
    "gaps": np.where(np.arange(N_ROWS) % 3 == 0, np.nan, SIGNALS["rpm"]),
    "negative": -SIGNALS["A"],
}
NAMES = st.lists(st.sampled_from([*WORDS, *MARKS, *SYMBOLS, *JOINED]), min_size=1, max_size=3)
HEADERS = st.dictionaries(
    st.builds(str.join, st.sampled_from(["_", " ", "/", ""]), NAMES),
    st.sampled_from(sorted(VALUES)),
    min_size=1,
    max_size=8,
)


@settings(max_examples=300, derandomize=True, deadline=None)
@given(header=HEADERS)
def test_every_column_is_named_and_the_text_is_toml(header):
    table = Table({name: VALUES[signal] for name, signal in header.items()}, ())
    proposal = propose(table, "any")
    lines = (*proposal.used, *proposal.left_out)
    for name in header:
        assert name in proposal.unknown or any(repr(name) in line for line in lines)
    assert tomllib.loads(text_of(proposal))["vehicle"]["name"] == "any"
