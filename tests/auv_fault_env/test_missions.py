"""Missions: every form that a user may give, exact legs, starts at rest and in motion."""

import numpy as np
import pytest

from auv_fault_env import MISSIONS, PRESETS, Mission
from auv_fault_env.channels import INDEX
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.missions import mission_of

FOOT = 0.3048
QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)


def legs_seen(mission, steps):
    """The mission speed of the reset and of every step after it, as observed."""
    env = PropulsionEnv(truth="full", **QUIET)
    observation, info = env.reset(seed=1, options={"mission": mission, "schedule": []})
    seen = [(float(observation[0]), info["mission_speed"])]
    for _ in range(steps):
        observation, _, _, _, info = env.step([0.3, 0.0, 0.0])
        seen.append((float(observation[0]), info["mission_speed"]))
    assert all(observed == pytest.approx(commanded, rel=1e-7) for observed, commanded in seen)
    return [commanded for _, commanded in seen]


FORMS = {
    "name": "cruise",
    "speed": FOOT,
    "numpy_speed": np.float64(FOOT),
    "list_of_legs": [[0.0, FOOT]],
    "tuple_of_legs": ((0, FOOT),),
    "array_of_legs": np.array([[0.0, FOOT]]),
    "mapping": {"legs": [(0.0, FOOT)]},
    "mission": Mission(((0.0, FOOT),)),
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_every_form_of_a_mission_means_the_same(form):
    assert mission_of(form) == Mission(((0.0, FOOT),), start_speed=FOOT)
    assert legs_seen(form, 2) == pytest.approx([FOOT] * 3)


@pytest.mark.parametrize("start", [0.1, 0.3, 0.7, 1.1, 1.2, 2.3])
def test_a_leg_counts_from_the_first_step_that_starts_at_its_start(start):
    steps = round(10 * start)
    assert legs_seen([(0.0, 0.2), (start, 0.4)], steps + 2) == pytest.approx(
        [0.2] * (steps + 1) + [0.4] * 2
    )


def test_a_leg_that_starts_within_a_sample_counts_from_the_next():
    assert legs_seen([(0.0, 0.2), (0.25, 0.4), (0.26, 0.5)], 5) == pytest.approx(
        [0.2] * 4 + [0.5] * 2
    )


def test_thesis_mission_alternates_every_ten_seconds():
    seen = np.array(legs_seen("thesis", 600))[1:]
    expected = np.repeat([0.5 * FOOT, 1.0 * FOOT] * 3, 100)
    np.testing.assert_allclose(seen, expected, rtol=1e-12)


def test_acceleration_mission_starts_at_rest():
    env = PropulsionEnv(truth="full", **QUIET)
    observation, _ = env.reset(options={"mission": "acceleration", "schedule": []})
    assert observation[0] == np.float32(1.5 * FOOT) and (observation[4:] == 0.0).all()


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("speed", [0.15, 0.3, 0.6])
def test_a_mission_starts_in_steady_motion(preset, speed):
    env = PropulsionEnv(truth="full", preset=preset, **QUIET)
    first, _ = env.reset(seed=1, options={"mission": speed, "schedule": []})
    assert first[4] == np.float32(speed) and first[5] == pytest.approx(0.0, abs=1e-9)
    for side in PRESETS[preset].sides:
        for quantity, of_port in (("rpm", first[8]), ("current", first[7])):
            assert first[INDEX[f"{side}_{quantity}"]] == of_port > 0.0
    for _ in range(20):
        later, *_ = env.step([speed, 0.0, 0.0])
    np.testing.assert_allclose(later[4:], first[4:], rtol=1e-3, atol=1e-3)


def test_start_speed_may_differ_from_the_first_leg():
    env = PropulsionEnv(truth="full", **QUIET)
    observation, _ = env.reset(
        options={"mission": Mission(((0.0, 0.4),), start_speed=0.2), "schedule": []}
    )
    assert observation[0] == np.float32(0.4) and observation[4] == np.float32(0.2)


@pytest.mark.parametrize("name", MISSIONS)
def test_registered_missions_stay_within_the_command(name):
    assert all(0.0 <= speed <= 1.0 for _, speed in MISSIONS[name].legs)
    assert mission_of(name) is MISSIONS[name]


def test_each_lane_has_its_mission():
    env = PropulsionVectorEnv(3, **QUIET, truth="full")
    observations, info = env.reset(
        options={"missions": ["cruise", 0.2, [(0.0, 0.5), (0.1, 0.6)]], "schedule": []}
    )
    assert info["mission_speed"].tolist() == pytest.approx([FOOT, 0.2, 0.5])
    for _ in range(2):
        observations, *_, info = env.step(np.zeros((3, 3)))
    assert info["mission_speed"].tolist() == [FOOT, 0.2, 0.6]
    np.testing.assert_array_equal(observations[:, 0], np.float32([FOOT, 0.2, 0.6]))


def test_a_given_mission_and_a_sampled_schedule_go_together():
    fixed = PropulsionVectorEnv(30, truth="full")
    free = PropulsionVectorEnv(30, truth="full")
    _, given = fixed.reset(seed=4, options={"mission": "cruise"})
    _, sampled = free.reset(seed=4)
    assert given["truth"]["onset"].tolist() == sampled["truth"]["onset"].tolist()
    assert len(set(given["mission_speed"])) == 1 and len(set(sampled["mission_speed"])) == 30
