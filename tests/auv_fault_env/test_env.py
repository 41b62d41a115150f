"""The single environment: contract checkers, spaces, information, reward, energy, seeds."""

import dataclasses
import itertools
import math
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from auv_fault_env import CATALOGUE, CHANNELS, PARAMETERS, PRESETS, classes
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv

NAME = "auv_fault_env/Propulsion-v0"
QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
SIDES = ("port", "starboard")
ENERGY_WEIGHT = 0.01  # as the class documents it
FAULTS = [{"fault": "propeller_damage:port", "onset": 2.0, "severity": 0.7, "ramp": 3.0}]


def simulate(env, steps, seed=3, **options):
    """Every (observation, reward, info) of an episode under wild commands, the reset first."""
    random = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, options=options)
    rows = [(observation, 0.0, info)]
    action = env.action_space.sample() * 0.0
    for step in range(steps):
        if step % 7 == 0:
            action = random.uniform(env.action_space.low, env.action_space.high)
        observation, reward, _, _, info = env.step(action)
        rows.append((observation, reward, info))
    return rows


def test_gymnasium_check_env_passes_without_a_warning():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gym.make(NAME, truth="full").unwrapped, skip_render_check=True)
    assert not caught, [str(one.message) for one in caught]


def test_stable_baselines_check_env_passes_without_a_warning():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gym.wrappers.RescaleAction(gym.make(NAME, truth="full"), -1, 1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        checker.check_env(env, skip_render_check=True)
    assert not caught, [str(one.message) for one in caught]


def test_spaces_are_the_documented_ones():
    env = gym.make(NAME, truth="full")
    assert env.observation_space.dtype == env.action_space.dtype == np.float32
    assert env.observation_space.shape == (12,) and env.action_space.shape == (3,)
    assert np.isfinite([env.observation_space.low, env.observation_space.high]).all()
    np.testing.assert_array_equal(
        env.observation_space.low, np.float32([c.low for c in CHANNELS.values()])
    )
    np.testing.assert_array_equal(
        env.observation_space.high, np.float32([c.high for c in CHANNELS.values()])
    )
    np.testing.assert_array_equal(env.action_space.high, np.float32([1.0, 0.4, 0.4]))
    assert tuple(CHANNELS) == (
        *("mission_speed", "speed_command", "rudder", "stern_plane", "speed", "acceleration"),
        *(
            "port_voltage",
            "port_current",
            "port_rpm",
            "starboard_voltage",
            "starboard_current",
            "starboard_rpm",
        ),
    )


@pytest.mark.parametrize("seed", range(5))
def test_info_and_truth_have_their_form(seed):
    for observation, _, info in simulate(PropulsionEnv(truth="full"), 30, seed):
        assert set(info) == {"mission_speed", "energy", "cost", "true_class", "truth"}
        assert {type(info[key]) for key in ("mission_speed", "energy", "cost")} == {np.float64}
        truth = info["truth"]
        assert type(info["true_class"]) is np.int64
        assert truth["label"] == classes()[info["true_class"]]
        assert set(truth) == {"label", "severity", "onset", "parameters", "state"}
        assert truth["label"] in classes() and tuple(truth["severity"]) == classes()[1:]
        assert tuple(truth["parameters"]) == tuple(PARAMETERS)
        assert type(truth["onset"]) is np.float64 and (
            truth["onset"] >= 5.0 or math.isnan(truth["onset"])
        )
        assert set(CHANNELS) - set(list(CHANNELS)[:4]) <= set(truth["state"])
        plain = [
            *truth["severity"].values(),
            *truth["parameters"].values(),
            *truth["state"].values(),
        ]
        assert {type(value) for value in plain} == {np.float64} and np.isfinite(plain).all()
        assert observation.dtype == np.float32 and observation.shape == (12,)


def test_truth_is_a_fresh_dictionary_every_step():
    rows = simulate(PropulsionEnv(truth="full"), 3, schedule=FAULTS)
    rows[1][2]["truth"]["parameters"]["alpha"] = rows[1][2]["truth"]["severity"][
        "increased_drag"
    ] = 7.0
    assert rows[2][2]["truth"]["parameters"]["alpha"] < 0.0
    assert rows[2][2]["truth"]["severity"]["increased_drag"] == 0.0
    assert not any(np.shares_memory(one[0], two[0]) for one, two in itertools.pairwise(rows))


@pytest.mark.parametrize("preset", PRESETS)
def test_reward_is_the_documented_formula(preset):
    for _, reward, info in simulate(
        PropulsionEnv(truth="full", preset=preset), 200, schedule=FAULTS
    )[1:]:
        deviation = info["truth"]["state"]["speed"] - info["mission_speed"]
        assert info["cost"] == pytest.approx(deviation**2, rel=1e-12)
        assert reward == pytest.approx(-(deviation**2) - ENERGY_WEIGHT * info["energy"], rel=1e-12)
        assert type(reward) is float


def test_energy_lies_between_the_powers_at_the_ends_of_the_sample():
    rows = simulate(PropulsionEnv(truth="full", healthy_band=3.0), 400, schedule=FAULTS)
    wide = 0
    for (_, _, before), (_, _, after) in itertools.pairwise(rows):
        low = high = 0.0
        for side in SIDES:
            state = after["truth"]["state"]
            parameters = after["truth"]["parameters"]
            flux = parameters[f"{side}_torque_constant"] * math.pi / 30.0
            voltage = state[f"{side}_voltage"]
            shaft_speed = before["truth"]["state"][f"{side}_rpm"]
            first = (voltage - flux * shaft_speed) / parameters[f"{side}_resistance"]
            ends = sorted(0.1 * voltage * current for current in (first, state[f"{side}_current"]))
            low = low + ends[0]
            high = high + ends[1]
        # while the shaft is steady the surge still moves the current
        slack = 1e-9 + 2e-3 * max(abs(low), abs(high))
        assert low - slack <= after["energy"] <= high + slack
        wide += high - low > 1e-3
    assert wide > 100  # the bracket is put to the test by real transients


def test_energy_of_steady_motion_is_voltage_times_current():
    rows = simulate(PropulsionEnv(truth="full", **QUIET), 0, mission="cruise", schedule=[])
    env = PropulsionEnv(truth="full", **QUIET)
    env.reset(options={"mission": "cruise", "schedule": []})
    for _ in range(300):
        *_, info = env.step([rows[0][0][0], 0.0, 0.0])
    state = info["truth"]["state"]
    power = sum(state[f"{side}_voltage"] * state[f"{side}_current"] for side in SIDES)
    assert power > 0.5 and info["energy"] == pytest.approx(0.1 * power, rel=1e-6)


def test_readings_without_noise_are_the_true_state():
    for observation, _, info in simulate(
        PropulsionEnv(truth="full", sensor_noise=0.0), 200, schedule=FAULTS
    ):
        state = info["truth"]["state"]
        expected = np.float32([state[name] for name in list(CHANNELS)[4:]])
        np.testing.assert_allclose(observation[4:], expected, rtol=2e-7, atol=1e-12)


def test_noise_of_the_readings_has_its_default_size():
    rows = simulate(PropulsionEnv(truth="full"), 600, mission="cruise", schedule=[])
    readings = list(CHANNELS)[4:]
    errors = np.array(
        [row[0][4:] - [row[2]["truth"]["state"][name] for name in readings] for row in rows]
    )
    sigma = np.array([CHANNELS[name].noise for name in readings])
    np.testing.assert_allclose(errors.std(axis=0), sigma, rtol=0.15)
    assert (np.abs(errors.mean(axis=0)) < 4 * sigma / len(rows) ** 0.5).all()


def test_commands_are_observed_clipped():
    env = PropulsionEnv(truth="full")
    env.reset(seed=1)
    observation, *_ = env.step([5.0, -5.0, 5.0])
    np.testing.assert_array_equal(observation[1:4], np.float32([1.0, -0.4, 0.4]))
    observation, *_ = env.step(np.array([0.25, 0.1, -0.1], np.float32))
    np.testing.assert_array_equal(observation[1:4], np.float32([0.25, 0.1, -0.1]))
    assert env.observation_space.contains(observation)


@pytest.mark.parametrize(
    "kind", [list, tuple, np.float32, np.float64], ids=["list", "tuple", "float32", "float64"]
)
def test_an_action_may_be_any_sequence_of_numbers(kind):
    action = (
        kind([0.5, 0.0, 0.25])
        if isinstance(kind(()), list | tuple)
        else np.array([0.5, 0.0, 0.25], kind)
    )
    env = PropulsionEnv(truth="full")
    env.reset(seed=1)
    assert env.step(action)[0][1:4].tolist() == [0.5, 0.0, 0.25]


def test_same_seed_same_episode():
    one, two = (simulate(PropulsionEnv(truth="full"), 100, seed=9) for _ in range(2))
    assert [row[0].tobytes() for row in one] == [row[0].tobytes() for row in two]
    assert [(row[1], row[2]) for row in one] == [(row[1], row[2]) for row in two]


def test_different_seeds_and_later_episodes_differ():
    env = PropulsionEnv(truth="full")
    starts = [env.reset(seed=seed)[0].tobytes() for seed in range(20)] + [
        env.reset()[0].tobytes() for _ in range(20)
    ]
    assert len(set(starts)) == 40
    env.reset(seed=19)
    assert [env.reset()[0].tobytes() for _ in range(3)] == starts[20:23]


def test_vehicles_differ_within_the_healthy_band():
    alphas = np.array(
        [
            PropulsionEnv(truth="full").reset(seed=s)[1]["truth"]["parameters"]["alpha"]
            for s in range(200)
        ]
    )
    relative = alphas / PRESETS["thesis1992"].alpha - 1.0
    assert np.abs(relative).max() <= 0.05 and np.ptp(relative) > 0.09


def test_without_a_band_the_vehicle_is_the_nominal_one():
    truth = PropulsionEnv(truth="full", healthy_band=0.0).reset(seed=5, options={"schedule": []})[
        1
    ]["truth"]
    preset = PRESETS["thesis1992"]
    assert (
        truth["parameters"]["alpha"] == preset.alpha and truth["parameters"]["port_c1"] == preset.c1
    )
    assert (
        truth["parameters"]["port_beta"] == truth["parameters"]["starboard_beta"] == preset.beta / 2
    )


@pytest.mark.parametrize("factor", ["sensor_noise", "disturbance", "healthy_band"])
def test_make_takes_the_factors_of_the_design(factor):
    default = gym.make(NAME, truth="full", preset="thesis1992")
    off = gym.make(NAME, truth="full", **{factor: 0.0})
    one, two = (env.reset(seed=1, options={"schedule": []}) for env in (default, off))
    changed = {
        "sensor_noise": lambda info: info["truth"]["parameters"]["speed_noise"],
        "disturbance": lambda info: info["truth"]["state"]["disturbance"],
        "healthy_band": lambda info: (
            info["truth"]["parameters"]["alpha"] - PRESETS["thesis1992"].alpha
        ),
    }
    for name, value in changed.items():
        assert value(one[1]) != 0.0
        assert (value(two[1]) == 0.0) == (name == factor)


@pytest.mark.parametrize(
    "preset", [*PRESETS, dataclasses.replace(PRESETS["thesis1992"], name="mine", alpha=-0.2)]
)
def test_make_takes_presets_and_vehicles(preset):
    vehicle = preset if not isinstance(preset, str) else PRESETS[preset]
    _, info = gym.make(NAME, truth="full", preset=preset, healthy_band=0.0).reset(seed=1)
    assert info["truth"]["parameters"]["alpha"] == vehicle.alpha


@pytest.mark.parametrize("limit", [None, 30], ids=["default_600", "given_30"])
def test_time_limit_truncates_and_nothing_terminates(limit):
    env = (
        gym.make(NAME, truth="full")
        if limit is None
        else gym.make(NAME, truth="full", max_episode_steps=limit)
    )
    env.reset(seed=1)
    ends = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(limit or 600)]
    assert ends == [(False, False)] * (len(ends) - 1) + [(False, True)]


def test_every_element_varies_and_stays_inside_under_random_actions():
    # 102000 lane-steps: every fault at severity 1, and healthy lanes
    n = 10 * (len(CATALOGUE) + 1)
    steps = 200
    schedules = [[{"fault": name, "onset": 1.0, "severity": 1.0}] for name in CATALOGUE] + [[]]
    env = PropulsionVectorEnv(n, truth="full")
    random = np.random.default_rng(0)
    rows = [env.reset(seed=77, options={"schedules": schedules * 10})[0]]
    low = env.action_space.low
    high = env.action_space.high
    for step in range(steps):
        rows.append(
            env.step(
                random.uniform(low, high) if step % 20 < 10 else random.choice([0.0, 1.0], (n, 3))
            )[0]
        )
    rows = np.array(rows)
    assert np.isfinite(rows).all()
    assert (rows >= env.single_observation_space.low).all() and (
        rows <= env.single_observation_space.high
    ).all()
    healthy = rows[:, len(CATALOGUE) :: len(CATALOGUE) + 1]
    # in every healthy lane; the mission speed has its legs
    assert (np.ptp(healthy[:, :, 1:], axis=0) > 0.0).all()
    assert (np.ptp(rows, axis=(0, 1)) > 0.1).all() and np.ptp(rows[0], axis=0)[
        [0, 4, 6, 8]
    ].min() > 0.0
