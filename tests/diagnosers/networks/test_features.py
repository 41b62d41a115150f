"""The features: complete, finite, causal by construction, and alike for both sides."""

import re

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from diagnosers.networks.class_list import SHIPPED_CLASSES
from diagnosers.networks.features import MEAN_TIMES, Features, feature_names
from training.rollouts import roll_out

FEATURES = feature_names(SHIPPED_CLASSES)

N_SAMPLES = 80


def encoded(observations):
    features = Features(PRESETS["thesis1992"])
    state = features.initial(observations.shape[1])
    rows = []
    for observation in observations.astype(np.float64):
        state, row, _ = features.step(state, observation)
        rows.append(row)
    return np.stack(rows)


def episodes(*faults):
    schedules = [(FaultEvent(fault, 4.0, 0.8),) for fault in faults]
    return roll_out(
        Fleet(len(faults)), range(len(faults)), N_SAMPLES, schedules=schedules
    ).observations


def mirror(names):
    swap = {"port": "starboard", "starboard": "port"}
    return [
        list(names).index(re.sub("starboard|port", lambda side: swap[side[0]], name))
        for name in names
    ]


@pytest.fixture(scope="module")
def observations():
    return episodes("sensor_stuck:port_rpm", "sensor_dropout:speed", "propeller_loss:starboard")


def test_every_feature_has_a_name_of_its_own(observations):
    assert len(set(FEATURES)) == len(FEATURES) == encoded(observations[:2]).shape[-1]


def test_features_are_of_the_order_of_one(observations):
    features = encoded(observations)
    assert np.isfinite(features).all()
    assert np.abs(features).max() <= 4.0 + 1e-6


def test_no_feature_is_written_by_mistake_or_forgotten(observations):
    spread = encoded(observations).std(axis=(0, 1))
    still = {name for name, value in zip(FEATURES, spread, strict=True) if value == 0.0}
    quiet = {name for name in FEATURES if re.search(r":(repeated|zero|repeats|zeros)$", name)}
    commands = {"rudder", "stern_plane", "deflection", "surge_gamma:now", "parameter_gamma:now"}
    assert still <= quiet | commands | {"surge_gamma:change", "parameter_gamma:change"}


def test_held_and_lost_readings_are_seen(observations):
    features = encoded(observations)
    at = {name: features[..., FEATURES.index(name)] for name in ("port_rpm:repeated", "speed:zero")}
    assert at["port_rpm:repeated"][:40].max() == 0.0
    assert at["port_rpm:repeated"][45:, 0].mean() > 0.5
    assert at["speed:zero"][45:, 1].mean() > 0.5
    assert at["speed:zero"][:, 2].max() == 0.0


def test_port_and_starboard_are_treated_alike(observations):
    swapped = encoded(observations[..., mirror(CHANNELS)])
    np.testing.assert_allclose(
        swapped, encoded(observations)[..., mirror(FEATURES)], atol=1e-2
    )  # a fault of the speed sensor takes its severity from port first


def test_a_batch_equals_its_lanes(observations):
    together = encoded(observations)
    for lane in range(observations.shape[1]):
        np.testing.assert_array_equal(encoded(observations[:, [lane]])[:, 0], together[:, lane])


def test_running_means_reach_a_constant_after_their_time():
    rows = encoded(np.repeat(episodes("increased_drag")[:1], N_SAMPLES, axis=0))
    for time in MEAN_TIMES:
        mean = rows[:, 0, FEATURES.index(f"port_voltage:mean_{time:g}")]
        # residuals of repeated readings are constant
        assert np.isclose(mean[-1], mean[1], atol=1e-5)
