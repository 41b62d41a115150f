"""The equations against an independent solution, closed forms, textbook formulas and hostile
inputs.
"""

from dataclasses import replace
from functools import cache, partial
from math import atanh, cosh, exp, log2, pi, sinh, sqrt, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from auv_fault_env import Fleet, Mission, integration, lanes, layout, physics
from auv_fault_env.integration import Motion
from auv_fault_env.parameters import FOOT, PRESETS, SIDES, Vehicle, nominal
from auv_fault_env.physics import RPM, Motor, Shaft, plant_constants

from . import reference
from .one_lane import advance
from .reference import PLANT_FAULTS, Inputs

N_SAMPLES = 120
REST = Motion(0.0, 0.0, 0.0, 0.0, 0.0)
THESIS = PRESETS["thesis1992"]
EACH_PRESET = pytest.mark.parametrize("preset", PRESETS)


def shafts_of(parameters):
    return [Shaft(*(parameters[f"{side}_{name}"] for name in Shaft._fields)) for side in SIDES]


def motors_of(vehicle, parameters, *voltages):
    constants = plant_constants(vehicle)
    return [
        physics.motor(shaft, constants, v)
        for shaft, v in zip(shafts_of(parameters), voltages, strict=True)
    ]


def simulate(vehicle, parameters, inputs):
    motion = REST
    states = []
    for port, starboard, rudder, plane, disturbance in zip(*inputs, strict=True):
        drag = parameters["alpha"] + parameters["gamma"] * (rudder**2 + plane**2)
        motors = motors_of(vehicle, parameters, port, starboard)
        motion = advance(
            motion._replace(port_angle=0.0, starboard_angle=0.0), drag, disturbance, *motors
        )
        states.append(motion)
    return np.array(states)


def settle(vehicle, parameters, voltage, n_samples=3000):
    """The motion after a long time at one voltage on both sides."""
    motors = motors_of(vehicle, parameters, voltage, voltage)
    motion = REST
    for _ in range(n_samples):
        motion = advance(motion, parameters["alpha"], 0.0, *motors)
    return motion


@cache
def healthy_case(preset):
    vehicle = PRESETS[preset]
    inputs = reference.random_inputs(len(preset), N_SAMPLES)
    return vehicle, nominal(vehicle), inputs, reference.solve(vehicle, nominal(vehicle), inputs)


def check(vehicle, parameters, inputs, exact):
    simulated = simulate(vehicle, parameters, inputs)
    errors = reference.error(simulated, exact)
    # pytest -rP shows it
    print(f"worst error: speed {errors[0]:.1e}, shafts {max(errors[1:3]):.1e}")
    assert max(errors[:3]) < 1e-6
    angles = np.abs(simulated[:, 3:] - exact[:, 3:])
    # of use for the energy only: 1e-3 rad at full voltage are 1.4 mJ; a stop within the sample
    # leaves a kink
    stopped = (exact[:, 1:3] == 0.0) & (exact[:, 3:] > 0.0)
    assert angles.max(where=~stopped, initial=0.0) < 1e-3 and angles.max() < 1e-2


@EACH_PRESET
def test_healthy_vehicle_follows_the_exact_solution(preset):
    vehicle, parameters, inputs, exact = healthy_case(preset)
    # fast, and the shafts stopped at the end
    assert exact[:, 0].max() > 0.5 * vehicle.maximum_speed and exact[-1, 1:3].max() == 0.0
    check(vehicle, parameters, inputs, exact)


@EACH_PRESET
@pytest.mark.parametrize("fault", PLANT_FAULTS)
@pytest.mark.parametrize("severity", [0.0, 0.5, 1.0])
def test_faulty_vehicle_follows_the_exact_solution(preset, fault, severity):
    vehicle, healthy, inputs, exact = healthy_case(preset)
    parameters = reference.faulted(healthy, {fault: severity})
    if severity:
        exact = reference.solve(vehicle, parameters, inputs)
    else:
        assert parameters == healthy
    check(vehicle, parameters, inputs, exact)


@pytest.mark.parametrize("seed", range(20))
def test_random_vehicle_with_compound_faults_follows_the_exact_solution(seed):
    rng = np.random.default_rng(seed)
    vehicle = list(PRESETS.values())[seed % 2]
    names = rng.choice(PLANT_FAULTS, rng.integers(0, 5), replace=False)
    parameters = reference.within_band(nominal(vehicle), rng)
    parameters = reference.faulted(parameters, {str(name): rng.uniform() for name in names})
    inputs = reference.random_inputs(seed, N_SAMPLES)
    check(vehicle, parameters, inputs, reference.solve(vehicle, parameters, inputs))


@pytest.mark.parametrize("severity", [0.0, 0.5, 1.0])
def test_shaft_braked_from_full_speed_to_almost_nothing(severity):
    """The hardest sample: all of 200 rad/s is lost within it, and the error counts relative to the
    1 rad/s left.
    """
    faults = {"motor_overheating:port": severity, "seal_friction:starboard": severity}
    parameters = reference.faulted(nominal(THESIS), faults)
    n = 60
    low = np.linspace(0.0, 0.5, n)
    rows = [np.stack([np.full(n, 24.0)] * 9 + [low]).T.ravel()] * 2 + [np.zeros(10 * n)] * 3
    inputs = Inputs(*rows)
    check(THESIS, parameters, inputs, reference.solve(THESIS, parameters, inputs))


def test_shaft_stays_until_the_motor_overcomes_coulomb_friction():
    breakaway = THESIS.coulomb_friction * THESIS.resistance / THESIS.torque_constant
    for factor, moves in ((0.0, False), (1 - 1e-9, False), (1 + 1e-6, True)):
        motors = motors_of(THESIS, nominal(THESIS), *[factor * breakaway] * 2)
        motion = advance(REST._replace(speed=1.0), THESIS.alpha, 0.0, *motors)
        assert [motion.port_shaft_speed > 0, motion.starboard_shaft_speed > 0] == [moves] * 2


def test_free_shaft_reaches_the_no_load_speed():
    parameters = nominal(replace(THESIS, c1=0.0, c2=0.0, beta=0.0))
    for voltage in (1.0, 6.0, 24.0):
        flux = THESIS.torque_constant
        friction = THESIS.coulomb_friction
        expected = (voltage - THESIS.resistance * friction / flux) / flux
        assert settle(THESIS, parameters, voltage, 100).port_shaft_speed == pytest.approx(
            expected, rel=1e-12
        )


def test_stall_and_no_load_current_are_those_of_appendix_a():
    fleet = Fleet(1, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    scratch = np.zeros(layout.N_SCRATCH * layout.LANES)
    fleet.reset(seeds=[0], schedules=[()])
    block = fleet.table[0]
    current = []
    block[layout.PORT_STATE + layout.VOLTAGE, 0] = 24.0
    for shaft_speed in (
        0.0,
        (24.0 - 1.01 * THESIS.coulomb_friction / THESIS.torque_constant) / THESIS.torque_constant,
    ):
        block[layout.PORT_STATE + layout.SHAFT_SPEED, 0] = shaft_speed
        lanes.write_true_values(block.ravel(), scratch, 1)
        current.append(block[layout.PORT_STATE + layout.CURRENT, 0])
    assert current[0] == pytest.approx(24 / 1.01, rel=1e-12)
    assert current[0] == pytest.approx(23.8, abs=0.05)  # as printed
    assert current[1] == pytest.approx(0.21, abs=0.005)


@EACH_PRESET
def test_terminal_speed_at_a_constant_shaft_speed(preset):
    vehicle = PRESETS[preset]
    shaft_speed = 40.0
    torque_free = Motor(0.0, 0.0, 0.0, 0.0, 0.5 * vehicle.beta * RPM**2)
    motion = REST._replace(port_shaft_speed=shaft_speed, starboard_shaft_speed=shaft_speed)
    for _ in range(6000):
        motion = advance(motion, vehicle.alpha, 0.0, torque_free, torque_free)
    assert motion.port_shaft_speed == shaft_speed
    assert motion.speed == pytest.approx(
        sqrt(vehicle.beta / -vehicle.alpha) * shaft_speed * RPM, rel=1e-10
    )


@pytest.mark.parametrize("feet,seconds", [(0.5, 40.0), (1.0, 20.0), (2.0, 10.0)])
def test_time_constant_at_a_constant_shaft_speed(feet, seconds):
    speed = feet * FOOT
    shaft_speed = sqrt(-THESIS.alpha / THESIS.beta) * speed / RPM
    torque_free = Motor(0.0, 0.0, 0.0, 0.0, 0.5 * THESIS.beta * RPM**2)
    motion = Motion(speed * (1 + 1e-5), shaft_speed, shaft_speed, 0.0, 0.0)
    for _ in range(100):
        motion = advance(motion, THESIS.alpha, 0.0, torque_free, torque_free)
    decay = (motion.speed / speed - 1) / 1e-5
    assert decay == pytest.approx(exp(-10.0 * 2 * -THESIS.alpha * speed), rel=1e-4)
    assert 1 / (2 * -THESIS.alpha * speed) == pytest.approx(seconds, rel=0.02)


def test_propeller_torque_at_the_steady_advance_ratio():
    motion = settle(THESIS, nominal(THESIS), 6.0)
    parameters = nominal(THESIS)
    revs = motion.port_shaft_speed / (2 * pi)
    advance_ratio = motion.speed * (1 - THESIS.wake_fraction) / (revs * THESIS.diameter)
    # 3.696e-3 ft/s per rpm
    assert advance_ratio == pytest.approx(3.696e-3 * 60 / (4 / 12) * 0.9, rel=1e-3)
    side = motors_of(THESIS, parameters, 6.0, 6.0)[0]
    torque = (
        THESIS.inertia
        * (side.load * motion.port_shaft_speed - side.coupling * motion.speed)
        * motion.port_shaft_speed
    )
    coefficient = torque / (THESIS.density * THESIS.diameter**5 * revs**2)
    assert coefficient == pytest.approx(THESIS.c1 - THESIS.c2 * advance_ratio, rel=1e-12)


@EACH_PRESET
@pytest.mark.parametrize("voltage", [0.5, 2.0, 6.0, 12.0, 24.0])
def test_steady_power_balance(preset, voltage):
    vehicle = replace(PRESETS[preset], viscous_friction=1e-4)
    motion = settle(vehicle, nominal(vehicle), voltage)
    w = motion.port_shaft_speed
    revs = motion.port_shaft_speed / (2 * pi)
    current = (voltage - vehicle.torque_constant * w) / vehicle.resistance
    ratio = motion.speed * (1 - vehicle.wake_fraction) / (revs * vehicle.diameter)
    propeller = vehicle.density * vehicle.diameter**5 * revs**2 * (vehicle.c1 - vehicle.c2 * ratio)
    friction = vehicle.coulomb_friction + vehicle.viscous_friction * w
    used = current**2 * vehicle.resistance + friction * w + propeller * w
    assert voltage * current == pytest.approx(used, rel=1e-6)


@pytest.mark.parametrize("feet,ampere,volt", [(0.5, 0.23, 1.1), (1.0, 0.31, 2.0), (2.0, 0.63, 4.1)])
def test_operating_points(feet, ampere, volt):
    fleet = Fleet(1, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    fleet.reset(seeds=[0], schedules=[()], missions=[Mission(((0.0, feet * FOOT),))])
    state = fleet.table[0, :, 0]
    for side in (layout.PORT_STATE, layout.STARBOARD_STATE):
        assert state[side + layout.CURRENT] == pytest.approx(ampere, abs=0.005)
        assert state[side + layout.VOLTAGE] == pytest.approx(volt, abs=0.05)
    fleet.step(np.array([[feet * FOOT, 0.0, 0.0]]))
    assert state[layout.SPEED] == pytest.approx(feet * FOOT, rel=1e-9)
    power = (
        2 * state[layout.PORT_STATE + layout.VOLTAGE] * state[layout.PORT_STATE + layout.CURRENT]
    )
    assert fleet.outcomes[1, 0] == pytest.approx(0.1 * power, rel=1e-6)


def textbook_shaft_speed(start, side, speed, time):
    """Solution of dw/dt = a - b w - c w^2 for constant coefficients."""
    a = side.drive
    b = side.damping - side.coupling * speed
    c = side.load
    if c == 0.0:
        return a / b + (start - a / b) * exp(-b * time)
    root = sqrt(b * b / 4 + a * c)
    offset = (start + b / (2 * c)) * c / root
    if abs(offset) < 1.0:
        return -b / (2 * c) + root / c * tanh(root * time + atanh(offset))
    angle = root * time + atanh(1 / offset)
    return -b / (2 * c) + root / c * cosh(angle) / sinh(angle)


def random_shafts(n, rng, lost=False):
    """Motor coefficients at random voltages under random faults, a random start and surge speed
    each.
    """
    for _ in range(n):
        faults = {
            name: rng.uniform()
            for name in PLANT_FAULTS[2:6]
            if not name.startswith("propeller_loss")
        }
        parameters = reference.faulted(
            nominal(THESIS), faults | ({"propeller_loss:port": 1.0} if lost else {})
        )
        side = motors_of(THESIS, parameters, rng.uniform(1.0, 24.0), 0.0)[0]
        yield side, rng.uniform(1.0, 250.0), rng.uniform(0.0, 1.5)


@pytest.mark.parametrize("lost", [False, True])
def test_spin_is_the_textbook_solution_at_constant_speed(lost):
    time = 0.01
    rng = np.random.default_rng(1)
    for side, start, speed in random_shafts(200, rng, lost):
        expected = textbook_shaft_speed(start, side, speed, time)
        if expected > 0.0:
            assert physics.shaft_speed_after(start, side, speed, 0.0, time) == pytest.approx(
                expected, rel=1e-12, abs=1e-12
            )


def test_longest_substep_lies_within_the_reach_of_the_approximant():
    rng = np.random.default_rng(2)
    time = max(integration.FINE)
    for side, start, speed in random_shafts(200, rng):
        expected = max(textbook_shaft_speed(start, side, speed, time), 0.0)
        assert physics.shaft_speed_after(start, side, speed, 0.0, time) == pytest.approx(
            expected, rel=1e-9, abs=1e-9
        )


def sloped_error(slope, time, used):
    """Error of `shaft_speed_after` under u = 0.5 + slope t, solved with the slope `used`."""
    side = motors_of(THESIS, nominal(THESIS), 12.0, 0.0)[0]

    def rate(t, w):
        damping = side.damping - side.coupling * (0.5 + slope * t)
        return side.drive - damping * w - side.load * w * w

    exact = solve_ivp(rate, (0.0, time), [60.0], "DOP853", rtol=1e-13, atol=1e-13).y[0, -1]
    return abs(physics.shaft_speed_after(60.0, side, 0.5 + 0.5 * slope * time, used, time) - exact)


def test_order_of_the_slope_correction():
    """Error: order 3 in time and 1 in the slope if the slope is ignored, else order 5 and 2."""

    def order(error, large, small):
        return log2(error(large) / error(small))

    def with_slope(slope, time):
        return sloped_error(slope, time, slope)

    without_slope = partial(sloped_error, used=0.0)
    assert order(lambda t: without_slope(50.0, t), 0.002, 0.001) == pytest.approx(3.0, abs=0.1)
    assert order(lambda s: without_slope(s, 0.002), 50.0, 25.0) == pytest.approx(1.0, abs=0.02)
    assert order(lambda t: with_slope(2e4, t), 0.002, 0.001) == pytest.approx(5.0, abs=0.2)
    assert order(lambda s: with_slope(s, 0.002), 2e4, 1e4) == pytest.approx(2.0, abs=0.1)


EXTREMES = {
    "friction": {"coulomb_friction": 3 * THESIS.coulomb_friction, "viscous_friction": 2e-4},
    "stuck": {"coulomb_friction": 10.0},
    "light": {"inertia": 1e-6},
    "light and hot": {
        "inertia": 1e-6,
        "resistance": 1.4,
        "torque_constant": 0.049,
        "coulomb_friction": 0.04,
    },
    "heavy": {"inertia": 1.0},
    "strong": {"torque_constant": 1.0, "resistance": 0.1},
    "no propeller": {"c1": 0.0, "c2": 0.0, "beta": 0.0},
}


@pytest.mark.parametrize("period", [1, 2, 7])
@pytest.mark.parametrize("name", EXTREMES)
def test_extreme_vehicles_stay_within_physical_bounds(name, period):
    vehicle: Vehicle = replace(THESIS, **EXTREMES[name])
    on = (np.arange(300) // period) % 2 == 0
    inputs = Inputs(np.where(on, 24.0, 0.0), np.where(on, 0.0, 24.0), *np.zeros((3, 300)))
    simulated = simulate(vehicle, nominal(vehicle), inputs)
    assert np.isfinite(simulated).all() and (simulated[:, 1:3] >= 0.0).all()
    assert simulated[:, 1:3].max() <= 24.0 / vehicle.torque_constant
    assert simulated[:, 0].max() <= 10.0 and simulated[:, 0].min() >= 0.0


@pytest.mark.parametrize("name", ["friction", "stuck", "light", "light and hot"])
def test_unpowered_shaft_stops_and_stays(name):
    vehicle = replace(THESIS, **EXTREMES[name])
    for speed in (0.0, 1.0, 2.4):
        inputs = np.zeros(30)
        motors = motors_of(vehicle, nominal(vehicle), 0.0, 0.0)
        motion = Motion(speed, 200.0, 1.0, 0.0, 0.0)
        shaft_speeds = []
        for _ in inputs:
            motion = advance(motion, vehicle.alpha, 0.0, *motors)
            shaft_speeds.append(motion[1:3])
        assert np.array(shaft_speeds)[-1].max() == 0.0
        assert (np.diff(np.array(shaft_speeds), axis=0) <= 0.0).all()
