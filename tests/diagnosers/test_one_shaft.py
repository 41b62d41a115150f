"""Diagnosers on vehicles with one shaft: which name their faults, and which refuse the vehicle."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import auv_fault_env  # noqa: F401  (registers the environment)
from auv_fault_env import PRESETS, classes
from auv_fault_env.errors import InputError
from diagnosers import make

ONE_SHAFT = [name for name, vehicle in PRESETS.items() if vehicle.shafts == 1]
FAULTS = ("seal_friction:port", "propeller_loss:port", "motor_overheating:port", "increased_drag")
ONSET = 15.0  # s


def named(preset, fault, seconds=30):
    """The class of the largest probability before the onset and at the end, by `filter_bank`."""
    cruise = 0.8 * PRESETS[preset].maximum_speed
    mission = [(0.0, 0.6 * cruise), (10.0, cruise), (20.0, 0.6 * cruise)]
    event = {"fault": fault, "onset": ONSET, "severity": 1.0}
    env = gym.make("auv_fault_env/Propulsion-v0", preset=preset, realism=1.0)
    observation, _ = env.reset(seed=4, options={"schedule": [event], "mission": mission})
    bank = make("filter_bank", vehicle=preset)
    bank.reset(1)
    best = []
    for _ in range(10 * seconds):
        best.append(bank.update(observation[None]).log_probability[0].argmax())
        observation, *_ = env.step([observation[0], 0.0, 0.0])
    names = [bank.classes[k] for k in best]
    return names[round(10 * ONSET) - 1], names[-1]


@pytest.mark.parametrize("preset", ONE_SHAFT)
@pytest.mark.parametrize("fault", FAULTS)
def test_the_filter_bank_names_a_fault_of_a_mission(preset, fault):
    assert named(preset, fault) == ("normal", fault)


def test_the_filter_bank_takes_the_shafts_from_the_vehicle():
    bank = make("filter_bank", vehicle="remus100")
    assert not any("starboard" in name for name in bank.fault_names)
    both = make("filter_bank", vehicle=replace(PRESETS["remus100"], shafts=2))
    assert sum("starboard" in name for name in both.fault_names) == 19
    explicit = make("filter_bank", vehicle="thesis1992", shafts=1)
    assert explicit.fault_names == bank.fault_names
    bank.reset(1)
    probability = np.exp(bank.update(np.zeros((1, 12))).log_probability[0])
    of_starboard = [probability[k] for k, name in enumerate(classes()) if "starboard" in name]
    assert len(of_starboard) == 7 and not any(of_starboard)


@pytest.mark.parametrize(
    "name", ["limits", "cusum", "rules", "kalman_network", "parallel", "integrated"]
)
def test_diagnosers_of_two_shafts_refuse_a_vehicle_with_one(name):
    with pytest.raises(InputError, match=r"shafts: got 1; allowed is 2.*filter_bank"):
        make(name, vehicle="remus100")
