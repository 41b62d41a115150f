"""What all diagnosers share: missing readings are filled, nonsense is refused, a belief becomes a
decision.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from diagnosers import NAMES, UNKNOWN, Belief, Recursive, decide, make
from diagnosers.diagnoser import IMPOSSIBLE, same_severity, with_impossible_unknown

# diagnosers that measure whether their classes explain the readings, or have a part that does
CAN_KNOW = ("residuals", "filter_bank", "integrated")


@dataclass(frozen=True)
class Echo(Recursive):
    """Says what observation it has been given."""

    def initial(self, n_lanes):
        return ()

    def step(self, state, observation):
        return state, Belief(observation.copy(), observation, observation)


def test_the_last_reading_stands_in_for_a_missing_one_and_zero_before_the_first():
    echo = Echo()
    readings = np.full((1, len(CHANNELS)), 2.0)
    echo.reset(1)
    readings[0, 3] = np.nan
    assert (echo.update(readings).log_probability == [*[2.0] * 3, 0.0, *[2.0] * 8]).all()
    assert np.isnan(readings[0, 3])
    assert (echo.update(np.full((1, len(CHANNELS)), 3.0)).log_probability == 3.0).all()
    assert (echo.update(np.full((1, len(CHANNELS)), np.nan)).log_probability == 3.0).all()


@pytest.mark.parametrize("factor", [1.01, -1.01, 1e300, -1e300, np.inf, -np.inf])
def test_a_value_beyond_ten_full_scales_is_no_reading(factor):
    # full scales: of the commands, of speed and acceleration, of each motor
    limits = 10.0 * np.array([[1.0, 1.0, 0.4, 0.4, 5.0, 2.0, *[30.0, 30.0, 6000.0] * 2]])
    echo = Echo()
    echo.reset(1)
    assert (echo.update(0.99 * limits).log_probability == 0.99 * limits).all()
    assert (echo.update(factor * limits).log_probability == 0.99 * limits).all()


@pytest.mark.parametrize(
    ("observation", "thing"),
    [
        (np.zeros((2, len(CHANNELS))), "observation's shape"),
        ([["fast"] * len(CHANNELS)], "observation"),
    ],
)
def test_nonsense_is_refused(observation, thing):
    echo = Echo()
    echo.reset(1)
    with pytest.raises(InputError, match=thing):
        echo.update(observation)


def test_an_update_needs_a_reset():
    with pytest.raises(InputError, match="call reset"):
        Echo().update(np.zeros((1, len(CHANNELS))))


@pytest.mark.parametrize(
    ("probability", "word"),
    [
        ([0.6, 0.4, 0.0], "normal"),
        ([0.5, 0.5, 0.0], "normal"),
        ([0.4, 0.4, 0.2], "drag"),
        ([0.1, 0.2, 0.7], "loss"),
        ([0.1, 0.46, 0.44], "drag"),
        ([0.0, 1e-300, 0.0], "drag"),  # all but certain of nothing: still the likeliest
    ],
)
def test_a_belief_becomes_a_word(probability, word):
    with np.errstate(divide="ignore"):
        belief = Belief(np.log([probability]), *np.zeros((2, 1, 3)))
    assert decide(belief, ("normal", "drag", "loss")) == [word]


def test_a_fault_like_several_is_unknown_and_the_alarm_can_be_set():
    belief = Belief(np.log([[0.4, 0.36, 0.24]]), *np.zeros((2, 1, 3)))
    assert decide(belief, ("normal", "drag", "loss"), name=0.7) == [UNKNOWN]
    assert decide(belief, ("normal", "drag", "loss"), alarm=0.3) == ["normal"]


@pytest.mark.parametrize(
    ("probability", "word"),
    [
        ([0.2, 0.1, 0.7], UNKNOWN),
        ([0.2, 0.44, 0.36], "drag"),
        ([0.6, 0.0, 0.4], "normal"),
    ],
)
def test_a_leading_unknown_class_is_the_decision(probability, word):
    with np.errstate(divide="ignore"):
        belief = Belief(np.log([probability]), *np.zeros((2, 1, 3)))
    assert decide(belief, ("normal", "drag", UNKNOWN)) == [word]


def test_who_cannot_know_gives_unknown_probability_zero_in_any_precision():
    known = Belief(np.log([[0.75, 0.25]]), np.array([[0.0, 0.4]]), np.array([[0.0, 0.1]]))
    belief = with_impossible_unknown(known)
    np.testing.assert_array_equal(np.exp(belief.log_probability), [[0.75, 0.25, 0.0]])
    assert np.isfinite(belief.log_probability.astype(np.float32)).all()
    np.testing.assert_array_equal(belief.severity_mean, [[0.0, 0.4, 0.0]])
    np.testing.assert_array_equal(belief.severity_std, [[0.0, 0.1, 0.0]])


@pytest.mark.parametrize("name", NAMES)
def test_every_belief_ends_with_unknown(name):
    diagnoser = make(name)
    diagnoser.reset(2)
    belief = diagnoser.update(np.zeros((2, len(CHANNELS))))
    assert diagnoser.classes == classes() and diagnoser.classes[-1] == UNKNOWN
    assert diagnoser.known_classes == classes()[:-1]
    is_impossible = belief.log_probability[:, -1] == IMPOSSIBLE
    assert (is_impossible != (name in CAN_KNOW)).all()


def test_same_severity_is_none_for_normal():
    mean, std = same_severity((2, 3), 0.6, 0.2)
    assert mean.tolist() == [[0.0, 0.6, 0.6]] * 2 and std.tolist() == [[0.0, 0.2, 0.2]] * 2
