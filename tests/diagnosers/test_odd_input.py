"""Absurd samples and bursts of silence pass: ten seconds later nothing is left of them."""

from functools import cache

import numpy as np
import pytest

from auv_fault_env import FaultEvent, Fleet
from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.missions import MISSIONS
from diagnosers import NAMES, make
from diagnosers.diagnoser import LARGEST_READING
from training.rollouts import roll_out

ODD = 80  # sample of the oddity, three seconds after the onset
N_SAMPLES = 195
BURST = 10  # samples
SCHEDULES = [(), (FaultEvent("seal_friction:port", 5.0, 0.7),)]
VEHICLES = ("healthy", "faulty")
KINDS = {
    "beyond": (1.01, 1),
    "far beyond": (1e5, 1),
    "huge": (1e300, 1),
    "hugely negative": (-1e300, 1),
    "infinite": (np.inf, 1),
    "burst of nan": (np.nan, BURST),
    "burst of huge": (1e300, BURST),
}
CASES = [
    (vehicle, kind, channel)
    for vehicle in range(len(VEHICLES))
    for kind in KINDS
    for channel in CHANNELS
]


@cache
def observations() -> np.ndarray:
    """(n_samples, n_lanes, n_channels): one lane for each case, then the vehicles as they are."""
    good = roll_out(
        Fleet(2), [3, 4], N_SAMPLES, schedules=SCHEDULES, missions=[MISSIONS["thesis"]] * 2
    ).observations.astype(np.float64)
    vehicle = [case[0] for case in CASES]
    odd = good[:, vehicle].copy()
    for lane, (_, kind, channel) in enumerate(CASES):
        factor, n_samples = KINDS[kind]
        column = INDEX[channel]
        value = factor if abs(factor) > 1e9 else factor * LARGEST_READING[column]
        odd[ODD : ODD + n_samples, lane, column] = value
    return np.concatenate([odd, good], axis=1)


@cache
def probabilities(name: str) -> np.ndarray:
    """(n_samples, n_lanes, n_classes)."""
    rows = observations()
    diagnoser = make(name)
    diagnoser.reset(rows.shape[1])
    return np.array([np.exp(diagnoser.update(row).log_probability) for row in rows])


@pytest.mark.parametrize("name", NAMES)
def test_probabilities_stay_finite_and_sum_to_one(name):
    found = probabilities(name)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found.sum(axis=2), 1.0, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_ten_seconds_later_the_belief_is_what_it_would_have_been(name):
    last = probabilities(name)[-1]
    good = last[-len(VEHICLES) :]
    for lane, (vehicle, kind, channel) in enumerate(CASES):
        difference = np.abs(last[lane] - good[vehicle]).max()
        assert difference <= 0.05, (VEHICLES[vehicle], kind, channel)
