import gymnasium as gym
import numpy as np
import pytest

from auv_fault_env import layout
from auv_fault_env.env.single import PropulsionEnv
from auv_fault_env.env.vector import PropulsionVectorEnv
from auv_fault_env.errors import InputError
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import mission_of
from auv_fault_env.thrust_shift import LARGEST_SHIFT, RUDDER_PER_SHIFT

SPEED = 0.3048


def fleet_at(noise=0.0, band=0.0, n_lanes=1, **others):
    fleet = Fleet(n_lanes, sensor_noise=noise, disturbance=noise, healthy_band=band, **others)
    missions = [mission_of(SPEED)] * n_lanes
    observation = fleet.reset(range(n_lanes), schedules=[()] * n_lanes, missions=missions)
    return fleet, observation


def steady(shift, rudder=0.0):
    """Speed, shaft speeds and voltages of the nominal vehicle after a minute."""
    fleet, _ = fleet_at()
    for _ in range(600):
        fleet.step([[SPEED, rudder, 0.0, shift]])
    rows = (
        layout.SPEED,
        layout.PORT_SHAFT_SPEED,
        layout.STARBOARD_SHAFT_SPEED,
        layout.PORT_VOLTAGE,
        layout.STARBOARD_VOLTAGE,
    )
    return np.array([fleet.row(row)[0] for row in rows])


@pytest.mark.parametrize("shift", [0.1, 0.4, -0.8])
def test_speed_and_total_thrust_stay_and_the_shares_are_those_of_the_shift(shift):
    speed, port, starboard, *_ = steady(0.0)
    # the rudder of the action takes back that of the heading
    shifted_speed, shifted_port, shifted_starboard, *_ = steady(shift, -RUDDER_PER_SHIFT * shift)
    assert shifted_speed == pytest.approx(speed, rel=1e-6)
    total = port**2 + starboard**2
    assert shifted_port**2 + shifted_starboard**2 == pytest.approx(total, rel=1e-6)
    assert shifted_port**2 == pytest.approx((1.0 + shift) * port**2, rel=1e-6)


def test_the_sides_mirror_each_other():
    speed, *of_port = steady(0.4)
    mirrored_speed, *of_starboard = steady(-0.4)
    assert mirrored_speed == speed
    assert of_starboard == [of_port[1], of_port[0], of_port[3], of_port[2]]


def test_the_rudder_holds_the_heading_at_the_price_of_drag():
    with_rudder = steady(0.8)
    without = steady(0.8, -0.8 * RUDDER_PER_SHIFT)
    assert with_rudder[1] > without[1]
    fleet, _ = fleet_at()
    assert fleet.step([[SPEED, 0.0, 0.0, 0.8]])[0, layout.RUDDER] == pytest.approx(
        0.05354, abs=1e-5
    )


@pytest.mark.parametrize("realism", [0.0, 1.0])
def test_a_shift_of_zero_changes_no_bit(realism):
    plain, observation = fleet_at(1.0, 1.0, 3, realism=realism)
    shifted, _ = fleet_at(1.0, 1.0, 3, realism=realism)
    for k in range(50):
        action = np.column_stack([observation[:, 0], np.full((3, 2), 0.1 * (k % 2))])
        observation = plain.step(action)
        same = shifted.step(np.column_stack([action, np.zeros(3)]))
        np.testing.assert_array_equal(observation, same)
    np.testing.assert_array_equal(plain.outcomes, shifted.outcomes)


def test_the_voltages_are_those_of_two_commands():
    """Written anew from the equations of the controllers, from the readings before the step."""
    fleet, observation = fleet_at(1.0, 1.0)
    vehicle = fleet.vehicle
    integral_rows = [
        state + layout.INTEGRAL for state in (layout.PORT_STATE, layout.STARBOARD_STATE)
    ]
    for k in range(30):
        shift = 0.6 * (-1.0) ** (k // 7)
        integral = np.array([fleet.row(row)[0] for row in integral_rows])
        filtered = fleet.row(layout.FILTERED_SPEED)[0]
        readings = np.array(
            [fleet.row(layout.PORT_RPM_READING)[0], fleet.row(layout.STARBOARD_RPM_READING)[0]]
        )
        speed_reading = fleet.row(layout.SPEED_READING)[0]
        observation = fleet.step([[SPEED, 0.0, 0.0, shift]])
        speed = filtered + (1.0 - np.exp(-0.1 / vehicle.speed_filter_time)) * (
            speed_reading - filtered
        )
        drag = vehicle.alpha + vehicle.gamma * (RUDDER_PER_SHIFT * shift) ** 2
        ahead = min(speed, SPEED + vehicle.boundary_layer)
        distance = np.clip((speed - SPEED) / vehicle.boundary_layer, -1.0, 1.0)
        squared = -(drag * ahead**2 + vehicle.reaching_rate * distance) / vehicle.beta
        command = np.sqrt(max(squared, 0.0)) * np.sqrt([1.0 + shift, 1.0 - shift])
        error = command - readings
        proportional = vehicle.proportional_gain * error
        voltage = proportional + integral + vehicle.integral_gain * 0.1 * error
        voltage = np.clip(voltage, 0.0, vehicle.maximum_voltage)
        found = [fleet.row(layout.PORT_VOLTAGE)[0], fleet.row(layout.STARBOARD_VOLTAGE)[0]]
        assert found == pytest.approx(voltage, abs=1e-9)
        found = [fleet.row(row)[0] for row in integral_rows]
        assert found == pytest.approx(voltage - proportional, abs=1e-9)
    assert observation[0, layout.PORT_RPM_READING] != observation[0, layout.STARBOARD_RPM_READING]


def test_a_shift_beyond_the_largest_is_clipped_and_the_actions_stay_the_callers():
    actions = np.array([[SPEED, 0.0, 0.0, 5.0]])
    before = actions.copy()
    observations = []
    for shift in (5.0, LARGEST_SHIFT):
        fleet, _ = fleet_at()
        actions[0, -1] = shift
        observations += [fleet.step(actions) for _ in range(20)][-1:]
    np.testing.assert_array_equal(*observations)
    np.testing.assert_array_equal(actions[0, :3], before[0, :3])


def test_one_shaft_has_nothing_to_shift():
    fleet = Fleet(1, "remus100")
    fleet.reset([0])
    with pytest.raises(InputError, match=r"thrust_shift.*one shaft"):
        fleet.step([[0.3, 0.0, 0.0, 0.1]])
    with pytest.raises(InputError, match=r"thrust_shift.*one shaft"):
        PropulsionEnv(preset="remus100", thrust_shift=True)


@pytest.mark.parametrize("kind", ["command", "residual"])
def test_both_forms_of_the_environment_shift_alike(kind):
    options = {"action": kind, "thrust_shift": True}
    single = PropulsionEnv(**options)
    vector = PropulsionVectorEnv(2, **options)
    assert single.action_space.shape == (4,) == vector.single_action_space.shape
    single.reset(seed=8, options={"schedule": [], "mission": 0.3})
    vector.reset(seed=7, options={"schedule": [], "mission": 0.3})
    action = np.array([0.3, 0.1, 0.0, -0.7], np.float32)
    for _ in range(20):
        observation, reward, *_ = single.step(action)
        observations, rewards, *_ = vector.step(np.stack([action, action]))
        np.testing.assert_array_equal(observation, observations[1])
        assert reward == rewards[1]
    port, starboard = observation[[layout.PORT_VOLTAGE_READING, layout.STARBOARD_VOLTAGE_READING]]
    assert port < starboard - 0.1


def test_the_argument_survives_the_specification():
    env = gym.make("auv_fault_env/Propulsion-v0", thrust_shift=True)
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.action_space == env.action_space
    assert gym.make("auv_fault_env/Propulsion-v0").action_space.shape == (3,)
