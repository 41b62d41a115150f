"""Rules that spend a share of the budget all the time, by hand."""

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import classes
from diagnosers import Belief
from training.stimuli import EPISODE_TIME, STIMULI
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.standing import StandingSurge
from training.stimuli.two_experiments import TwoExperiments, affected_log_odds

N_SAMPLES = round(EPISODE_TIME * 10)
OBSERVATION = np.zeros((2, len(CHANNELS)))
OBSERVATION[:, INDEX["mission_speed"]] = 0.4
STANDING = [StandingSurge, TwoExperiments]


def belief(*drag_odds):
    """A belief of two lanes in `increased_drag` against `normal` at these odds."""
    log_probability = np.full((2, len(classes())), -30.0)
    odds = np.array(drag_odds)
    log_probability[:, 0] = -np.log1p(odds)
    log_probability[:, classes().index("increased_drag")] = np.log(odds / (1.0 + odds))
    return Belief(log_probability, np.zeros_like(log_probability), np.ones_like(log_probability))


def offsets(stimulus, odds):
    """Offsets (n_samples, 2) at these odds (n_samples, 2)."""
    return np.array([stimulus.offset(k, OBSERVATION, belief(*one)) for k, one in enumerate(odds)])


@pytest.mark.parametrize("kind", STANDING)
def test_a_vehicle_without_suspicion_spends_the_standing_share_and_no_more(kind):
    found = offsets(kind(0.1), np.full((N_SAMPLES, 2), 1e-6))
    np.testing.assert_allclose(found, kind.standing_share * 0.1, rtol=1e-3)


@pytest.mark.parametrize("kind", STANDING)
def test_a_surge_is_the_largest_offset_and_leaves_the_standing_share_to_the_end(kind):
    odds = np.full((N_SAMPLES, 2), 1e-6)
    odds[100:, 1] = 1e4
    stimulus = kind(0.1)
    quiet, suspected = offsets(stimulus, odds).T
    standing = stimulus.standing
    np.testing.assert_allclose(suspected[:100], standing, rtol=1e-3)
    assert (suspected[100:110] == LARGEST_OFFSET).all()
    np.testing.assert_allclose(suspected[-1], standing, rtol=0.02)
    np.testing.assert_allclose(quiet, standing, rtol=1e-3)
    assert np.sum(suspected**2) <= N_SAMPLES * 0.1**2 * (1.0 + 1e-9)
    assert np.sum(suspected**2) > 0.95 * N_SAMPLES * 0.1**2


def test_the_dear_experiment_starts_by_the_rise_of_the_odds_and_stops_when_they_fall():
    """The log odds rise from their lowest value by more than `UP`, then fall below `DOWN`."""
    log_odds = np.full((40, 2), -8.0)
    log_odds[10:20, 1] = -8.0 + TwoExperiments.UP + 0.5
    log_odds[20:30, 1] = -8.0 + TwoExperiments.DOWN + 0.3
    log_odds[30:, 1] = -8.0 + TwoExperiments.DOWN - 0.3
    quiet, risen = offsets(TwoExperiments(0.1), np.exp(log_odds)).T
    standing = TwoExperiments(0.1).standing
    assert (risen[10:30] == LARGEST_OFFSET).all()
    np.testing.assert_allclose(np.r_[risen[:10], risen[30:], quiet], standing)


def test_a_vehicle_that_was_suspected_from_the_start_waits_for_evidence():
    found = offsets(TwoExperiments(0.1), np.full((20, 2), 1.0))
    np.testing.assert_allclose(found, TwoExperiments(0.1).standing)


def test_log_odds_of_hull_and_propellers_add_their_classes_and_stay_within_bounds():
    one = belief(3.0, 1e-30)
    log_odds = affected_log_odds(one.log_probability)
    assert log_odds[0] == pytest.approx(np.log(3.0), abs=1e-6) and log_odds[1] == -20.0
    both = one.log_probability.copy()
    both[:, classes().index("propeller_damage:port")] = np.log(0.25)
    both[:, classes().index("seal_friction:port")] = np.log(0.25)
    assert affected_log_odds(both)[0] == pytest.approx(np.log(4.0), abs=1e-6)


def test_constant_is_its_budget_whatever_is_believed():
    found = offsets(STIMULI["constant"](0.05), np.geomspace(1e-6, 1e6, 40).reshape(20, 2))
    np.testing.assert_array_equal(found, 0.05)
