"""Seeds that digest, nonce and recipe choose, and nobody else."""

from dataclasses import replace
from itertools import combinations, pairwise

import pytest

from auv_fault_env.errors import InputError
from training.benchmark.suites import LARGEST_SEED
from training.benchmark.trials import PARTS
from training.seeds import PURPOSES, SPAN, purpose_of
from training.submissions.draw import SEEDS_OF_A_PART, Draw, Recipe

RECIPE = Recipe("thesis", 4, 0.1, 0.05)
DRAW = Draw(RECIPE, "a" * 64, "nonce")


def test_digest_nonce_and_every_field_of_the_recipe_change_all_seeds():
    draws = [
        DRAW,
        replace(DRAW, submission="a" * 63 + "b"),
        replace(DRAW, nonce="nonces"),
        *(
            replace(DRAW, recipe=replace(RECIPE, **{name: value}))
            for name, value in {
                "suite": "ideal",
                "lanes": 5,
                "hours": 0.2,
                "counting_hours": 0.06,
            }.items()
        ),
    ]
    for first, second in combinations(draws, 2):
        for part in PARTS:
            assert first.first_seeds[part] != second.first_seeds[part]


def test_no_seed_belongs_to_a_purpose_or_to_two_parts():
    for k in range(1000):
        ranges = []
        for first in replace(DRAW, nonce=str(k)).first_seeds.values():
            ranges.append(range(first, first + SEEDS_OF_A_PART))
            assert first >= SPAN * (1 + len(PURPOSES)) and purpose_of(first) is None
            assert ranges[-1][-1] <= LARGEST_SEED
        ordered = sorted(ranges, key=lambda one: one[0])
        assert all(a[-1] < b[0] for a, b in pairwise(ordered))


def test_the_suite_has_the_seeds_and_only_them():
    suite = DRAW.suite
    first = DRAW.first_seeds
    assert [episode.seed for episode in suite.episodes] == list(
        range(first["faulty"], first["faulty"] + 4)
    )
    assert suite.healthy == {part: first[part] for part in ("threshold", "counting")}
    assert suite.content_hash == replace(DRAW).suite.content_hash
    assert suite.content_hash != replace(DRAW, nonce="other").suite.content_hash


def test_faults_are_those_of_the_frozen_suite_in_an_order_of_their_own():
    whole = replace(DRAW, recipe=replace(RECIPE, lanes=256))
    orders = [
        [episode.schedule[0].fault for episode in replace(whole, nonce=nonce).suite.episodes]
        for nonce in ("one", "two")
    ]
    assert orders[0] != orders[1] and sorted(orders[0]) == sorted(orders[1])
    assert {orders[0].count(fault) for fault in set(orders[0])} == {32}


@pytest.mark.parametrize(
    "fields",
    [
        {"suite": "thesys"},
        {"lanes": 257},
        {"lanes": 0},
        {"hours": 0.0},
        {"counting_hours": float("nan")},
    ],
)
def test_a_recipe_that_cannot_be_is_refused(fields):
    with pytest.raises(InputError, match=r"; allowed is .*; "):
        replace(RECIPE, **fields)


@pytest.mark.parametrize("nonce", ["", "a\nb", 201 * "x", 3, None])
def test_a_nonce_is_a_short_text(nonce):
    with pytest.raises(InputError, match="printable characters"):
        replace(DRAW, nonce=nonce)
