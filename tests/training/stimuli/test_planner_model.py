"""Rollouts of evidence against cases that are solved by hand."""

import numpy as np
import pytest

from auv_fault_env.faults import classes
from training.stimuli.planner_model import (
    FOLLOWING,
    ISOLATED,
    N_STEPS,
    RATE,
    STEP,
    force_shares,
    scores,
)

NO_NOISE = np.zeros((1, N_STEPS))
BASE = -1.0
SPEED = 0.3


def score(held, price=0.0, log_odds=-2.0, severity=0.5, free=1.0, standing=0.0, noise=NO_NOISE):
    """Scores (n_candidates,) of a vehicle with one class that doubles the force."""
    return scores(
        np.array([log_odds]),
        np.ones((1, 1)),
        np.ones(1),
        np.full((1, 1), severity),
        np.zeros((1, 1)),
        np.array([SPEED]),
        np.array([SPEED]),
        np.array([free]),
        standing,
        0.5,
        np.asarray(held, float),
        price,
        noise,
    )[0]


def test_without_noise_the_delay_is_that_of_the_drift():
    p = 1.0 / (1.0 + np.exp(2.0))
    per_second = RATE * 0.5**2 * SPEED**4
    delay = (ISOLATED + 2.0) / per_second
    assert 5.0 < delay < N_STEPS * STEP
    # next to no allowance, so that the base rule cannot surge
    assert score([0.0, BASE], free=1e-9) == pytest.approx(p * delay, rel=1e-3)


def test_a_faster_vehicle_shows_the_fault_sooner_and_pays_its_price_where_it_is_healthy():
    fast, base = score([0.2, BASE], free=0.2)
    assert fast < base
    p = 1.0 / (1.0 + np.exp(-2.0))
    dear, _ = score([0.2, BASE], price=10.0, free=0.2)
    spent = (dear - fast) / 10.0
    # two steps at 0.2 m/s, and little by the rule
    assert p * 2.0 * 0.2**2 * STEP < spent < p * 4.0 * 0.2**2 * STEP


def test_a_candidate_spends_no_more_than_the_allowance():
    little = score([0.2], price=1.0, free=0.001)[0] - score([0.2], free=0.001)[0]
    assert little <= 0.001 * 1.001


def test_an_offset_on_a_sure_vehicle_brings_nothing():
    fast, base = score([0.2, BASE], price=1.0, log_odds=-12.0)
    assert base < fast


def test_the_speed_follows_its_command_within_some_seconds():
    assert 0.3 < FOLLOWING < 0.7


def test_shares_of_force_are_those_of_the_catalogue():
    shares = dict(zip(classes(), force_shares(classes()), strict=True))
    assert shares["increased_drag"] == pytest.approx(1.0)
    assert shares["decreased_drag"] == pytest.approx(0.5)
    assert shares["propeller_loss:port"] == 2.0 * shares["propeller_damage:starboard"]
    assert shares["normal"] == shares["seal_friction:port"] == shares["sensor:speed"] == 0.0
