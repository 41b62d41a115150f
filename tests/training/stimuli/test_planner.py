"""The planner against its base rule, and in a toy of its own model."""

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import classes
from diagnosers import Belief
from training.stimuli import planner
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES
from training.stimuli.planner import DECISION, Planner
from training.stimuli.planner_model import (
    FOLLOWING,
    ISOLATED,
    N_STEPS,
    NOISE,
    RESTING,
    STEP,
    information,
    noises,
    scores,
)
from training.stimuli.standing import StandingSurge

N_CLASSES = len(classes())
DRAG = classes().index("increased_drag")
SPEEDS = (0.2, 0.3, 0.5)


class OnlyBase(Planner):
    """A planner whose only candidate is the base rule."""

    candidates = (Planner.candidates[0],)


def observation(n_lanes):
    values = np.zeros((n_lanes, len(CHANNELS)))
    for name in ("mission_speed", "speed_command", "speed"):
        values[:, INDEX[name]] = np.resize(SPEEDS, n_lanes)
    return values


def belief(log_odds, severity=0.4):
    """A belief whose only fault is more drag, with these log odds against normal, (n_lanes,)."""
    log_odds = np.asarray(log_odds, float)
    log_probability = np.full((len(log_odds), N_CLASSES), -40.0)
    log_probability[:, DRAG] = -np.logaddexp(0.0, -log_odds)
    log_probability[:, 0] = -np.logaddexp(0.0, log_odds)
    shape = log_probability.shape
    return Belief(log_probability, np.full(shape, severity), np.full(shape, 0.1))


def offsets(stimulus, log_odds):
    """Offsets (n_samples, n_lanes) under log odds (n_samples,), the same on all lanes."""
    read = observation(len(SPEEDS))
    series = [np.full(len(SPEEDS), value) for value in log_odds]
    return np.array([stimulus.offset(k, read, belief(one)) for k, one in enumerate(series)])


WANDERING = -2.0 + 2.0 * np.sin(np.arange(N_SAMPLES) / 40.0)


def test_with_its_base_rule_as_the_only_candidate_it_is_that_rule():
    found = offsets(OnlyBase(0.1), WANDERING)
    np.testing.assert_array_equal(found, offsets(StandingSurge(0.1), WANDERING))


def test_it_stands_on_a_sure_vehicle_and_never_spends_more_than_the_budget():
    for budget in (0.02, 0.1):
        planned = offsets(Planner(budget), WANDERING)
        assert np.abs(planned).max() <= LARGEST_OFFSET
        assert (np.sqrt(np.mean(planned**2, axis=0)) <= budget * (1 + 1e-9)).all()
        sure = offsets(Planner(budget), np.full(N_SAMPLES, -12.0))
        np.testing.assert_allclose(sure, Planner.standing_share * budget)


LOW_PRICE = 0.02  # s/m


class Timid(Planner):
    """A planner whose base rule hardly surges at odds below one."""

    gain = 0.5


def test_it_goes_ahead_of_its_base_rule_where_a_fault_would_stay_hidden(monkeypatch):
    monkeypatch.setattr(planner, "PRICE", LOW_PRICE)
    suspected = np.full(30, -1.5)
    slowest, _, fastest = offsets(Timid(0.2), suspected)[0]
    assert slowest >= min(one for one in Planner.candidates if one > 0.0)
    assert slowest >= fastest
    # a dearer offset needs higher odds
    monkeypatch.setattr(planner, "PRICE", 100.0)
    assert offsets(Timid(0.2), suspected)[0, 0] < 0.1
    assert (offsets(Planner(0.2), suspected) >= offsets(OnlyBase(0.2), suspected)).all()


def test_an_offset_stays_for_a_second_and_an_episode_repeats(monkeypatch):
    monkeypatch.setattr(planner, "PRICE", LOW_PRICE)
    stimulus = Timid(0.2)
    log_odds = np.where(np.arange(40) % DECISION == 0, -1.5, -12.0)
    found = offsets(stimulus, log_odds)
    np.testing.assert_array_equal(found[:DECISION, 0], np.full(DECISION, found[0, 0]))
    assert found[0, 0] in Planner.candidates
    np.testing.assert_array_equal(found, offsets(stimulus, log_odds))


def test_where_only_a_surge_can_show_the_fault_it_costs_less_than_a_rule_that_never_surges():
    planned = toy_costs(Planner.candidates)
    ruled = toy_costs(OnlyBase.candidates)
    assert (planned - ruled).mean() < -0.1 * ruled.mean()
    # offsets at a price that nothing is worth are not chosen
    np.testing.assert_array_equal(
        toy_costs(Planner.candidates, price=1e4), toy_costs(OnlyBase.candidates, price=1e4)
    )


def toy_costs(candidates, price=1.0, n_lanes=60):
    """Expected cost [s] of each lane if it plans with these candidates, (n_lanes,).

    The log odds of a slight drag fault follow the model from even odds on, with noise that the
    planner does not know. The base rule stands still.
    """
    delay, _ = toy_run(True, candidates, price, n_lanes)
    _, spent = toy_run(False, candidates, price, n_lanes)
    return 0.5 * (delay + price * spent)


def toy_run(has_fault, candidates, price, n_lanes, gain=0.0, standing=0.02, force=0.4):
    """Delay [s] and squared offsets [m^2/s] of each lane, (n_lanes,)."""
    noise = np.random.default_rng(1).standard_normal((N_STEPS, n_lanes))
    one_class = np.ones((n_lanes, 1))
    mission = np.full(n_lanes, 0.2)
    speed = mission + standing
    log_odds = np.zeros(n_lanes)
    free = np.full(n_lanes, 2.0)
    held = np.array(candidates)
    delay = np.zeros(n_lanes)
    spent = np.zeros(n_lanes)
    is_open = np.ones(n_lanes, bool)
    for k in range(N_STEPS):
        total = scores(
            *(log_odds, one_class, np.ones(1), force * one_class, 0.0 * one_class),
            *(speed, mission, free, standing, gain, held, price, noises()),
        )
        chosen = held[total.argmin(axis=1)]
        offset = np.where(chosen < 0.0, standing, chosen)
        delay += STEP * is_open
        spent += STEP * offset**2
        free = np.maximum(free - STEP * (offset**2 - standing**2), 0.0)
        speed = speed + FOLLOWING * (mission + offset - speed)
        rate = np.array([information(force, one) for one in speed])
        drift = rate if has_fault else -rate
        log_odds = np.maximum(log_odds + drift + np.sqrt(NOISE * rate) * noise[k], RESTING)
        is_open &= log_odds < ISOLATED
    return delay, spent
