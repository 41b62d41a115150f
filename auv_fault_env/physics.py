"""The equations of surge, shafts, controllers and sensors as scalar functions for compiled loops.

All kernels are loops around these functions of floats and named tuples of floats, which create no
arrays, raise nothing and never branch on a fault.

Equations (u surge speed, w shaft speed in rad/s, n the same in rpm, V motor voltage)::

    du/dt   = (alpha + gamma delta^2) u|u| + beta_p n_p^2 + beta_s n_s^2 + d
    J dw/dt = K_T (V - K_b w)/R - Q - b w - tau_c sign(w),      w >= 0, with stiction at w = 0
    Q       = rho D^5 (w/2 pi)^2 (C1 - C2 J_a),                 J_a = u (1 - wake) / ((w/2 pi) D)

With the surge speed known, `shaft_speed_after` solves the shaft equation in closed form.
"""

import math
from typing import NamedTuple

from numba.np.unsafe.ndarray import to_fixed_tuple

from auv_fault_env.compiling import scalar
from auv_fault_env.parameters import ENERGY_WEIGHT, SAMPLE_TIME, SHAFT, Vehicle

RPM = 30.0 / math.pi  # rpm per rad/s
GRAVITY = 9.80665  # m/s^2
LEAST_SUPPLY = 0.5  # share of its voltage that an empty battery still gives

# where tan(y)/y leaves its first branch: the shaft has stopped on the way
POLE = -(math.pi**2)


class PlantConstants(NamedTuple):
    """What all lanes share: water, nominal hull, gains of the controllers, disturbance, reward."""

    density: float
    diameter: float
    wake_fraction: float
    maximum_voltage: float
    disturbance_std: float
    disturbance_time: float
    alpha: float
    beta: float
    gamma: float
    speed_filter_time: float
    reaching_rate: float
    boundary_layer: float
    maximum_rpm: float
    proportional_gain: float
    integral_gain: float
    shafts: float
    energy_weight: float


N_CONSTANTS = len(PlantConstants._fields)


def plant_constants(vehicle: Vehicle, disturbance: float = 1.0) -> PlantConstants:
    """The constants of a vehicle; `disturbance` is a factor on the disturbing acceleration."""
    values = [float(getattr(vehicle, name)) for name in PlantConstants._fields[:-1]]
    constants = PlantConstants(*values, ENERGY_WEIGHT)
    return constants._replace(disturbance_std=constants.disturbance_std * disturbance)


@scalar
def constants_from_array(values):
    """The `PlantConstants` whose fields stand in an array, in their order."""
    return PlantConstants(*to_fixed_tuple(values, N_CONSTANTS))


@scalar
def has_starboard(constants):
    """Whether the vehicle has a starboard shaft beside that of port."""
    return constants.shafts > 1.0


class Shaft(NamedTuple):
    """Parameters of one shaft, in SI but for beta in (m/s^2)/rpm^2."""

    beta: float
    c1: float
    c2: float
    resistance: float
    torque_constant: float
    coulomb_friction: float
    viscous_friction: float
    inertia: float


def nominal_shaft(vehicle: Vehicle) -> Shaft:
    """One of the equal shafts of a vehicle."""
    values = {name: float(getattr(vehicle, name)) for name in SHAFT}
    return Shaft(**values | {"beta": vehicle.beta / vehicle.shafts})


@scalar
def shaft_at(values, first, stride):
    """The `Shaft` whose parameters stand in an array, from `first` on, `stride` elements apart."""
    return Shaft(
        values[first],
        values[first + stride],
        values[first + 2 * stride],
        values[first + 3 * stride],
        values[first + 4 * stride],
        values[first + 5 * stride],
        values[first + 6 * stride],
        values[first + 7 * stride],
    )


class Motor(NamedTuple):
    """A shaft at one voltage: dw/dt = drive - (damping - coupling u) w - load w^2 [rad/s^2].

    Its propeller accelerates the vehicle by thrust w^2 [m/s^2].
    """

    drive: float
    damping: float
    coupling: float
    load: float
    thrust: float


@scalar
def motor(shaft, constants, voltage):
    """The `Motor` of a shaft at a constant voltage."""
    flux = shaft.torque_constant
    diameter = constants.diameter
    blade = constants.density * diameter**4 / (2.0 * math.pi * shaft.inertia)
    return Motor(
        (flux * voltage / shaft.resistance - shaft.coulomb_friction) / shaft.inertia,
        (flux * flux / shaft.resistance + shaft.viscous_friction) / shaft.inertia,
        blade * shaft.c2 * (1.0 - constants.wake_fraction),
        blade * diameter * shaft.c1 / (2.0 * math.pi),
        shaft.beta * RPM * RPM,
    )


@scalar
def surge_acceleration(
    speed, port_shaft_speed, starboard_shaft_speed, drag, disturbance, port, starboard
):
    """du/dt [m/s^2]; drag is alpha + gamma delta^2 [1/m]."""
    thrust = (
        port.thrust * port_shaft_speed * port_shaft_speed
        + starboard.thrust * starboard_shaft_speed * starboard_shaft_speed
    )
    return drag * speed * abs(speed) + thrust + disturbance


@scalar
def shaft_acceleration(shaft_speed, speed, side):
    """dw/dt [rad/s^2]; Coulomb friction holds a standing shaft until the drive exceeds it."""
    rate = (
        side.drive
        - (side.damping - side.coupling * speed) * shaft_speed
        - side.load * shaft_speed * shaft_speed
    )
    return max(rate, 0.0) if shaft_speed <= 0.0 else rate


@scalar
def coloured_noise(std, time, starts=False):
    """Share of an Ornstein-Uhlenbeck process left after a sample, and std of the noise that joins.

    The process has this standard deviation and this correlation time [s]; its first sample keeps
    nothing.
    """
    memory = 0.0 if starts else math.exp(-SAMPLE_TIME / time)
    return memory, std * math.sqrt(1.0 - memory * memory)


@scalar
def disturbance_memory(constants):
    """Share of the disturbance left after a sample, and std of the noise that joins it: exact."""
    return coloured_noise(constants.disturbance_std, constants.disturbance_time)


@scalar
def armature_current(shaft, shaft_speed, voltage):
    """Current [A], inductance neglected as in the thesis."""
    return (voltage - shaft.torque_constant * shaft_speed) / shaft.resistance


@scalar
def electrical_energy(shaft, angle, voltage):
    """Electrical energy [J] of a sample with this turn [rad]; negative while the motor brakes."""
    return voltage * (voltage * SAMPLE_TIME - shaft.torque_constant * angle) / shaft.resistance


@scalar
def equilibrium_shaft_speed(alpha, beta, speed, constants):
    """Shaft speed [rad/s] at which thrust and drag balance, within that of the largest command."""
    rpm = math.sqrt(-alpha / beta) * speed if beta > 0.0 else 0.0
    return min(rpm, constants.maximum_rpm) / RPM


@scalar
def equilibrium_voltage(shaft, shaft_speed, speed, constants):
    """Voltage [V] that keeps a shaft speed, within the supply; zero for a standing shaft."""
    unpowered = motor(shaft, constants, 0.0)
    damping = unpowered.damping - unpowered.coupling * speed + unpowered.load * shaft_speed
    torque = shaft.inertia * (damping * shaft_speed - unpowered.drive)
    voltage = torque * shaft.resistance / shaft.torque_constant if shaft_speed > 0.0 else 0.0
    return min(voltage, constants.maximum_voltage)


@scalar
def mission_reward(deviation, energy, constants):
    """Reward of a step: minus the squared speed deviation and the weighted electrical energy."""
    return -(deviation * deviation) - constants.energy_weight * energy


@scalar
def shaft_speed_after(start, side, mean_speed, slope, time):
    """Shaft speed [rad/s] after `time` [s] under a surge speed of given mean and constant slope.

    The equation is a Riccati equation, the projection of a linear system with generator M =
    [[-b/2, a], [c, b/2]]. At a constant speed, w(t) = w0 + w'(0) T / (1 + (b/2 + c w0) T) with T
    = tanh(l t)/l, l^2 = b^2/4 + a c. A linear speed changes b; the Magnus expansion, to first order
    in the slope, scales a by (1 + k) and c by (1 - k), k = coupling slope t^2 (y coth y - 1)/(4
    y^2), y = l t. With x = y^2, one Pade approximant gives tanh(y)/y = p/(p + x q) and (y coth y -
    1)/y^2 = q/p, for x of either sign.
    """
    damping = side.damping - side.coupling * mean_speed
    x = (0.25 * damping * damping + side.drive * side.load) * time * time
    p = 135135.0 + x * (17325.0 + x * (378.0 + x))
    q = 45045.0 + x * (2772.0 + x * 27.0)
    tilt = 0.25 * side.coupling * slope * time * time * q
    load = side.load * start
    change = time * (
        (side.drive - (damping + load) * start) * p + tilt * (side.drive + load * start)
    )
    below = p + x * q + time * ((0.5 * damping + load) * p - tilt * load)
    stopped = below <= 0.0 or x < POLE
    return 0.0 if stopped else max(start + change / below, 0.0)


@scalar
def clipped(value, low, high):
    """The value, moved to the nearer end of [low, high] if it lies outside."""
    return min(max(value, low), high)


@scalar
def rpm_command(constants, speed_command, speed, delta_squared):
    """Shaft speed command [rpm] by sliding mode control of the surge speed on the nominal hull.

    Form: Healey & Lienard (1993). The measured speed feeds the drag forward only up to the boundary
    layer: else a vehicle with less drag, or a wrong reading, would be driven ever faster.
    """
    ahead = min(speed, speed_command + constants.boundary_layer)
    drag = (constants.alpha + constants.gamma * delta_squared) * ahead * abs(ahead)
    distance = (speed - speed_command) / constants.boundary_layer
    reach = constants.reaching_rate * clipped(distance, -1.0, 1.0)
    rpm_squared = max(-(drag + reach) / constants.beta, 0.0)
    return min(math.sqrt(rpm_squared), constants.maximum_rpm)


@scalar
def voltage_command(constants, error, integral):
    """Voltage [V] by PI control of the shaft speed, and the integral, which stops at saturation."""
    proportional = constants.proportional_gain * error
    unlimited = proportional + integral + constants.integral_gain * SAMPLE_TIME * error
    voltage = clipped(unlimited, 0.0, constants.maximum_voltage)
    return voltage, voltage - proportional


@scalar
def low_pass(filtered, reading, share):
    """First-order low-pass: the filtered value moves by `share` of the way to the reading."""
    return filtered + share * (reading - filtered)


@scalar
def gravity_felt(pitch, roll, cross_axis):
    """Acceleration [m/s^2] that the accelerometer feels at small angles [deg]."""
    return GRAVITY * (math.pi / 180.0) * (pitch + cross_axis * roll)


@scalar
def supply_share(fade, droop, hours, current):
    """Share of its nominal voltage that the supply gives after these hours at this current [A]."""
    return clipped(1.0 - fade * hours - droop * current, LEAST_SUPPLY, 1.0)


@scalar
def winding_temperature(temperature, current, resistance, thermal_resistance, share):
    """Temperature [K] above the water a sample later: it moves by `share` to its equilibrium."""
    loss = current * current * resistance
    return temperature + share * (thermal_resistance * loss - temperature)


@scalar
def fresh_reading(signal, bias, gain, noise, normal):
    """What the converter of a sensor gives of its signal."""
    return gain * signal + bias + noise * normal


@scalar
def converted(value, converter):
    """The nearest multiple of a converter's step within its range; any number if the step is 0."""
    limited = clipped(value, converter.low, converter.high)
    step = converter.step
    return step * math.floor(limited / step + 0.5) if step > 0.0 else limited


@scalar
def reported(fresh, stuck, dropout, chance, last_reading):
    """What arrives of a fresh reading.

    A dropped sample reads zero, a stuck one repeats the last reading; one chance decides both.
    """
    repeated_or_fresh = last_reading if chance < stuck else fresh
    return 0.0 if chance < dropout else repeated_or_fresh
