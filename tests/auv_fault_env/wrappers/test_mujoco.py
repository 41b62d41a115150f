"""Faults on a robot of MuJoCo, where it is installed: `pip install 'gymnasium[mujoco]'`."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from auv_fault_env.wrappers import FaultInjection, SignalFault

pytest.importorskip("mujoco")

DT = 0.04
FAULTS = {
    "rate_bias": SignalFault("bias", "observation", channel=6, size=2.0),
    "weak_motor": SignalFault("gain", "action", channel=0, size=0.2),
}
ONSET = 1.0
N_STEPS = 60


def swim(env):
    """Observations (n_steps + 1, 8) under a wave of both motors, and the labels."""
    observation, info = env.reset(seed=3)
    observations = [observation]
    labels = [info.get("truth", {}).get("label")]
    for k in range(N_STEPS):
        command = np.array([np.sin(0.4 * k), np.cos(0.4 * k)])
        observation, *_, info = env.step(command)
        observations.append(observation)
        labels.append(info.get("truth", {}).get("label"))
    return np.array(observations), labels


def faulty(name):
    event = {"fault": name, "onset": ONSET, "severity": 1.0}
    return FaultInjection(gym.make("Swimmer-v5"), FAULTS, [event], sample_time=DT, truth="full")


def test_a_sensor_is_off_from_the_onset_and_the_robot_swims_as_before():
    twin, _ = swim(gym.make("Swimmer-v5"))
    observations, labels = swim(faulty("rate_bias"))
    first = round(ONSET / DT)
    assert labels == ["normal"] * first + ["rate_bias"] * (N_STEPS + 1 - first)
    np.testing.assert_allclose(observations[first:, 6] - twin[first:, 6], 2.0)
    observations[first:, 6] = twin[first:, 6]
    assert observations.tobytes() == twin.tobytes()


def test_a_weak_motor_changes_how_it_swims_from_the_onset():
    twin, _ = swim(gym.make("Swimmer-v5"))
    observations, _ = swim(faulty("weak_motor"))
    first = round(ONSET / DT)
    assert observations[: first + 1].tobytes() == twin[: first + 1].tobytes()
    assert np.abs(observations[-1] - twin[-1]).max() > 0.1


def test_the_specification_makes_it_again():
    env = faulty("rate_bias")
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert swim(again)[0].tobytes() == swim(env)[0].tobytes()
