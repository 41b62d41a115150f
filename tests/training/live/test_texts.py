import re

import numpy as np
import pytest

from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.parameters import PARAMETERS, PRESETS
from diagnosers import Belief
from diagnosers.advisory import Situation, advise
from training.live.history import History
from training.live.session import HOTEL_LOAD, Truth
from training.live.texts import advice_text, belief_text, likelihood, truth_text

POWER = re.compile(r"\d[eE][-+]?\d|10\^|inf|nan")
PROBABILITIES = [0.0, 1e-300, 1e-99, 1e-20, 1e-4, 9e-4, 1e-3, 0.04, 0.5, 0.9989, 1.0 - 1e-9, 1.0]


def belief_of(probability):
    """The belief (1, n_classes) in which port propeller loss has this probability."""
    left = (1.0 - probability) / (len(classes()) - 1)
    log_probability = np.full((1, len(classes())), np.log(max(left, 1e-320)))
    log_probability[0, classes().index("propeller_loss:port")] = np.log(max(probability, 1e-320))
    shape = log_probability.shape
    return Belief(log_probability, np.full(shape, 1e-7), np.full(shape, 1e-9))


@pytest.mark.parametrize("probability", PROBABILITIES)
def test_no_probability_is_shown_as_a_power(probability):
    belief = belief_of(probability)
    empty = np.zeros(1)
    history = History(empty, empty, belief, empty.astype(bool), empty, ())
    assert not POWER.search(belief_text(history))
    assert not POWER.search(likelihood(probability))


@pytest.mark.parametrize("energy_left", [0.0, 1e-9, 36e3])
@pytest.mark.parametrize("current", [0.0, 9.0])
def test_no_quantity_of_the_advice_is_a_power_or_infinite(energy_left, current):
    situation = Situation(0.3, 2000.0, 0.0, energy_left, HOTEL_LOAD, current)
    advice = advise(belief_of(0.9), situation, PRESETS["thesis1992"])
    text = advice_text(advice)
    assert not POWER.search(text)
    assert ("unlimited J/m" in text) == (current > 0.0)


def test_a_fault_that_is_not_likely_is_not_named():
    empty = np.zeros(1)
    belief = belief_of(0.02)
    belief.log_probability[:] -= 5.0
    belief.log_probability[0, 0] = np.log(0.97)
    history = History(empty, empty, belief, empty.astype(bool), empty, ())
    assert belief_text(history) == "healthy: 97.0 % · no fault is likely"


@pytest.mark.parametrize("healthy", [0.0, 5.24e-8, 1.0, -0.08])
@pytest.mark.parametrize("factor", [0.0, 0.5, 1e-6, 3.0])
def test_changed_parameters_are_words_and_small_numbers(healthy, factor):
    changed = (healthy, factor * (healthy or 1.0))
    truth = Truth("increased_drag", {"increased_drag": 0.5}, dict.fromkeys(PARAMETERS, changed))
    first, *lines = truth_text(truth).splitlines()
    assert first == "increased_drag, severity 0.50"
    for name, line in zip(PARAMETERS, lines, strict=True):
        assert line.startswith(f"{name}: ") and not POWER.search(line)


def test_a_healthy_vehicle_is_said_to_be_so():
    assert truth_text(Truth(NORMAL, {}, {})) == "The vehicle is healthy."
