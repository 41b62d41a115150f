import numpy as np
import pytest

from auv_fault_env import layout
from auv_fault_env.errors import InputError
from auv_fault_env.thrust_shift import LARGEST_SHIFT
from training.active_env.single import ActiveDiagnosisEnv
from training.active_env.vector import ActiveDiagnosisVectorEnv

OPTIONS = {"schedule": [], "mission": 0.3}


def start(**arguments):
    env = ActiveDiagnosisVectorEnv(2, diagnoser="null", **arguments)
    env.reset(seed=4, options=OPTIONS)
    return env


def test_without_the_argument_there_is_one_action():
    assert start().single_action_space.shape == (1,)
    with pytest.raises(InputError, match=r"shape of the action"):
        start().step(np.zeros((2, 2)))


def test_the_second_action_shifts_thrust_and_zero_changes_nothing():
    plain = start()
    still = start(thrust_shift=True)
    shifted = start(thrust_shift=True)
    for _ in range(5):
        first, *_ = plain.step(np.full((2, 1), 0.2))
        second, *_ = still.step(np.array([[0.2, 0.0], [0.2, 0.0]]))
        shifted.step(np.array([[0.2, 0.5], [0.2, -0.5]]))
        np.testing.assert_array_equal(first, second)
    port = shifted.fleet.row(layout.PORT_SHAFT_SPEED) ** 2
    starboard = shifted.fleet.row(layout.STARBOARD_SHAFT_SPEED) ** 2
    shift = 0.5 * LARGEST_SHIFT
    expected = (1.0 + shift) / (1.0 - shift)
    assert port / starboard == pytest.approx([expected, 1.0 / expected], rel=0.1)


def test_a_reward_sees_the_shift():
    seen = []

    def reward(decision):
        seen.append(decision)
        return np.zeros(2)

    env = start(thrust_shift=True, reward=reward)
    env.step(np.array([[0.0, 1.0], [0.0, -3.0]]))
    assert seen[0].shift.tolist() == [LARGEST_SHIFT, -LARGEST_SHIFT]
    assert seen[0].action.tolist() == [0.0, 0.0]
    env = start(reward=reward)
    env.step(np.array([[1.0], [0.0]]))
    assert seen[1].shift.tolist() == [0.0, 0.0]


def test_one_vehicle_has_it_too_and_one_shaft_has_not():
    env = ActiveDiagnosisEnv(diagnoser="null", thrust_shift=True)
    assert env.action_space.shape == (2,)
    env.reset(seed=1, options=OPTIONS)
    env.step([0.0, 0.5])
    assert env.fleet.row(layout.PORT_VOLTAGE) > env.fleet.row(layout.STARBOARD_VOLTAGE)
    with pytest.raises(InputError, match=r"the shift of thrust"):
        env.step([0.0, np.nan])
    with pytest.raises(InputError, match=r"one shaft"):
        ActiveDiagnosisEnv(diagnoser="null", preset="remus100", thrust_shift=True)
