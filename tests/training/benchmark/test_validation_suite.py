import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from training.arguments import LAST_OFFSET, MOST_HOURS
from training.benchmark.plan import SEED_BLOCK
from training.benchmark.suites import load
from training.benchmark.validation_suite import FIRST_SEED, validation_suite
from training.seeds import purpose_of
from training.stimuli import STIMULI


def test_the_suite_is_as_it_says():
    suite = validation_suite(200, 0)
    assert suite.conditions == load("standard").conditions
    events = [event for episode in suite.episodes for event in episode.schedule]
    assert len(events) == len(suite.episodes) == 200
    diagnoses = {CATALOGUE[event.fault].diagnosis for event in events}
    assert len(diagnoses) > 14 and diagnoses < set(classes())
    assert all(0.2 <= event.severity <= 1.0 for event in events)
    assert all(5.0 <= event.onset <= 30.0 and event.end == np.inf for event in events)
    assert {event.ramp > 0.0 for event in events} == {True, False}


def test_all_seeds_are_those_of_validation():
    suite = validation_suite(5, LAST_OFFSET)
    seeds = [episode.seed for episode in suite.episodes]
    assert {purpose_of(seed) for seed in [*seeds, *suite.healthy.values()]} == {"validation"}


def test_parts_share_no_seed():
    n_healthy = MOST_HOURS * 3600.0 / 65.0 + SEED_BLOCK * len(STIMULI)
    longest = max(1_000_000, n_healthy)
    assert np.diff(list(FIRST_SEED.values())).min() >= LAST_OFFSET + longest


def test_the_hash_is_that_of_the_content():
    assert validation_suite(5, 0).hash == validation_suite(5, 0).hash
    assert validation_suite(5, 0).hash != validation_suite(5, 1).hash
