"""One sample of many lanes: the loops around `physics`, block after block."""

import math

import numpy as np

from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.layout import (
    ACCELERATION,
    ACCELERATION_READING,
    ALPHA,
    ANGLE,
    COST,
    CURRENT,
    DISTURBANCE,
    DISTURBANCE_NORMAL,
    DRAG,
    ENERGY,
    FILTERED_SPEED,
    GAMMA,
    INTEGRAL,
    LANES,
    MISSION_SPEED,
    N_CHANNELS,
    N_SCRATCH,
    N_SENSOR_PARAMETERS,
    NORMAL,
    PORT_CURRENT_READING,
    PORT_MOTOR,
    PORT_RPM_READING,
    PORT_SHAFT,
    PORT_STATE,
    PORT_VOLTAGE_READING,
    READING,
    REWARD,
    RUDDER,
    SENSORS,
    SHAFT_SPEED,
    SPEED,
    SPEED_COMMAND,
    SPEED_READING,
    STARBOARD_CURRENT_READING,
    STARBOARD_MOTOR,
    STARBOARD_RPM_READING,
    STARBOARD_SHAFT,
    STARBOARD_STATE,
    STARBOARD_VOLTAGE_READING,
    STERN_PLANE,
    VOLTAGE,
)
from auv_fault_env.noise import DROPOUT_WORD, channel_uniform, normal_pair, random_bits
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import (
    RPM,
    SUBSTEP,
    SUBSTEPS,
    Motion,
    Motor,
    Shaft,
    armature_current,
    clipped,
    constants_from_array,
    disturbance_memory,
    electrical_energy,
    low_pass,
    mission_reward,
    motor,
    reading,
    rpm_command,
    substep,
    surge_acceleration,
    voltage_command,
)


@scalar
def shaft_of(block, side, k):
    """The `Shaft` of lane k; `side` is the first row of its parameters."""
    at = side * LANES + k
    return Shaft(
        block[at],
        block[at + LANES],
        block[at + 2 * LANES],
        block[at + 3 * LANES],
        block[at + 4 * LANES],
        block[at + 5 * LANES],
        block[at + 6 * LANES],
        block[at + 7 * LANES],
    )


@scalar
def motor_of(scratch, side, k):
    """The `Motor` of lane k, as `prepare_step` left it in the scratch rows."""
    at = side * LANES + k
    return Motor(
        scratch[at],
        scratch[at + LANES],
        scratch[at + 2 * LANES],
        scratch[at + 3 * LANES],
        scratch[at + 4 * LANES],
    )


@scalar
def delta_squared(block, k):
    """Rudder and stern plane of lane k, squared and summed [rad^2]."""
    rudder = block[RUDDER * LANES + k]
    plane = block[STERN_PLANE * LANES + k]
    return rudder * rudder + plane * plane


@kernel
def write_commands(block, width, actions, limits):
    """Clip the actions (n_lanes, 3) into the command rows."""
    for k in range(width):
        for c in range(3):
            command = SPEED_COMMAND + c
            block[command * LANES + k] = clipped(
                actions[k, c], limits[command, 0], limits[command, 1]
            )


@scalar
def run_shaft_controller(block, k, constants, command, rpm_row, state):
    """Let one shaft's controller set its voltage."""
    voltage, integral = voltage_command(
        constants, command - block[rpm_row * LANES + k], block[(state + INTEGRAL) * LANES + k]
    )
    block[(state + VOLTAGE) * LANES + k] = voltage
    block[(state + INTEGRAL) * LANES + k] = integral


@kernel
def run_controllers(block, width, constants):
    """Let the controllers set both voltages, from the commands and the latest readings."""
    share = 1.0 - math.exp(-SAMPLE_TIME / constants.speed_filter_time)
    for k in range(width):
        speed = low_pass(block[FILTERED_SPEED * LANES + k], block[SPEED_READING * LANES + k], share)
        block[FILTERED_SPEED * LANES + k] = speed
        command = rpm_command(
            constants, block[SPEED_COMMAND * LANES + k], speed, delta_squared(block, k)
        )
        run_shaft_controller(block, k, constants, command, PORT_RPM_READING, PORT_STATE)
        run_shaft_controller(block, k, constants, command, STARBOARD_RPM_READING, STARBOARD_STATE)


@kernel
def sample_normals(scratch, width, key, step):
    """Ten standard normals per lane, for the readings and the disturbance of this step."""
    for pair in range(5):
        row = (NORMAL + 2 * pair) * LANES
        for k in range(width):
            one, two = normal_pair(random_bits(key[k], step[k], np.uint64(pair)))
            scratch[row + k] = one
            scratch[row + LANES + k] = two


@scalar
def motor_of_lane(block, shaft, state, k, constants):
    """Coefficients of one of lane k's shafts at its present voltage."""
    return motor(shaft_of(block, shaft, k), constants, block[(state + VOLTAGE) * LANES + k])


@scalar
def store_motor(scratch, side, k, values):
    """Keep a `Motor` in the scratch rows."""
    at = side * LANES + k
    scratch[at] = values.drive
    scratch[at + LANES] = values.damping
    scratch[at + 2 * LANES] = values.coupling
    scratch[at + 3 * LANES] = values.load
    scratch[at + 4 * LANES] = values.thrust


@kernel
def prepare_step(block, scratch, width, constants):
    """Coefficients of the sample ahead, and the disturbance's next value (exact Ornstein-Uhlenbeck step)."""
    memory, kick = disturbance_memory(constants)
    for k in range(width):
        store_motor(
            scratch, PORT_MOTOR, k, motor_of_lane(block, PORT_SHAFT, PORT_STATE, k, constants)
        )
        store_motor(
            scratch,
            STARBOARD_MOTOR,
            k,
            motor_of_lane(block, STARBOARD_SHAFT, STARBOARD_STATE, k, constants),
        )
        scratch[DRAG * LANES + k] = block[ALPHA * LANES + k] + block[
            GAMMA * LANES + k
        ] * delta_squared(block, k)
        pushed = (
            memory * block[DISTURBANCE * LANES + k] + kick * scratch[DISTURBANCE_NORMAL * LANES + k]
        )
        block[DISTURBANCE * LANES + k] = pushed
        block[(PORT_STATE + ANGLE) * LANES + k] = 0.0
        block[(STARBOARD_STATE + ANGLE) * LANES + k] = 0.0


@kernel
def advance_motion(block, scratch, width):
    """Advance all lanes by one sample, substep after substep."""
    for s in range(SUBSTEPS):
        time = SUBSTEP[s]
        for k in range(width):
            motion = substep(
                Motion(
                    block[SPEED * LANES + k],
                    block[(PORT_STATE + SHAFT_SPEED) * LANES + k],
                    block[(STARBOARD_STATE + SHAFT_SPEED) * LANES + k],
                    block[(PORT_STATE + ANGLE) * LANES + k],
                    block[(STARBOARD_STATE + ANGLE) * LANES + k],
                ),
                scratch[DRAG * LANES + k],
                block[DISTURBANCE * LANES + k],
                motor_of(scratch, PORT_MOTOR, k),
                motor_of(scratch, STARBOARD_MOTOR, k),
                time,
            )
            block[SPEED * LANES + k] = motion.speed
            block[(PORT_STATE + SHAFT_SPEED) * LANES + k] = motion.port_shaft_speed
            block[(STARBOARD_STATE + SHAFT_SPEED) * LANES + k] = motion.starboard_shaft_speed
            block[(PORT_STATE + ANGLE) * LANES + k] = motion.port_angle
            block[(STARBOARD_STATE + ANGLE) * LANES + k] = motion.starboard_angle


@scalar
def current_of_lane(block, shaft, state, k):
    """Armature current of one of lane k's motors [A]."""
    shaft_speed = block[(state + SHAFT_SPEED) * LANES + k]
    voltage = block[(state + VOLTAGE) * LANES + k]
    return armature_current(shaft_of(block, shaft, k), shaft_speed, voltage)


@kernel
def write_true_values(block, scratch, width):
    """The true values that follow from the state: surge acceleration and both currents."""
    for k in range(width):
        block[ACCELERATION * LANES + k] = surge_acceleration(
            block[SPEED * LANES + k],
            block[(PORT_STATE + SHAFT_SPEED) * LANES + k],
            block[(STARBOARD_STATE + SHAFT_SPEED) * LANES + k],
            scratch[DRAG * LANES + k],
            block[DISTURBANCE * LANES + k],
            motor_of(scratch, PORT_MOTOR, k),
            motor_of(scratch, STARBOARD_MOTOR, k),
        )
        block[(PORT_STATE + CURRENT) * LANES + k] = current_of_lane(
            block, PORT_SHAFT, PORT_STATE, k
        )
        block[(STARBOARD_STATE + CURRENT) * LANES + k] = current_of_lane(
            block, STARBOARD_SHAFT, STARBOARD_STATE, k
        )


@scalar
def read_sensor(block, scratch, width, gates, held, truth, factor, limits):
    """Read one channel on all lanes: `factor` times the true value, through the sensor, into the row `held`."""
    channel = held - READING
    sensor = (SENSORS + N_SENSOR_PARAMETERS * channel) * LANES
    normal = (NORMAL + channel) * LANES
    low = limits[held, 0]
    high = limits[held, 1]
    for k in range(width):
        got = reading(
            factor * block[truth * LANES + k],
            block[sensor + k],
            block[sensor + LANES + k],
            block[sensor + 2 * LANES + k],
            block[sensor + 3 * LANES + k],
            block[sensor + 4 * LANES + k],
            scratch[normal + k],
            channel_uniform(gates[k], channel),
            block[held * LANES + k],
        )
        block[held * LANES + k] = clipped(got, low, high)


@kernel
def read_sensors(block, scratch, width, key, step, limits):
    """Read every sensor of every lane."""
    write_true_values(block, scratch, width)
    gates = np.empty((2, LANES), np.uint64)
    for k in range(width):
        gates[0, k] = random_bits(key[k], step[k], DROPOUT_WORD)
        gates[1, k] = random_bits(key[k], step[k], DROPOUT_WORD + np.uint64(1))
    one = gates[0]
    two = gates[1]
    read_sensor(block, scratch, width, one, SPEED_READING, SPEED, 1.0, limits)
    read_sensor(block, scratch, width, one, ACCELERATION_READING, ACCELERATION, 1.0, limits)
    read_sensor(block, scratch, width, one, PORT_VOLTAGE_READING, PORT_STATE + VOLTAGE, 1.0, limits)
    read_sensor(block, scratch, width, one, PORT_CURRENT_READING, PORT_STATE + CURRENT, 1.0, limits)
    read_sensor(block, scratch, width, two, PORT_RPM_READING, PORT_STATE + SHAFT_SPEED, RPM, limits)
    read_sensor(
        block,
        scratch,
        width,
        two,
        STARBOARD_VOLTAGE_READING,
        STARBOARD_STATE + VOLTAGE,
        1.0,
        limits,
    )
    read_sensor(
        block,
        scratch,
        width,
        two,
        STARBOARD_CURRENT_READING,
        STARBOARD_STATE + CURRENT,
        1.0,
        limits,
    )
    read_sensor(
        block,
        scratch,
        width,
        two,
        STARBOARD_RPM_READING,
        STARBOARD_STATE + SHAFT_SPEED,
        RPM,
        limits,
    )


@scalar
def energy_of_lane(block, shaft, state, k):
    """Electrical energy of one of lane k's motors in the sample [J]."""
    angle = block[(state + ANGLE) * LANES + k]
    voltage = block[(state + VOLTAGE) * LANES + k]
    return electrical_energy(shaft_of(block, shaft, k), angle, voltage)


@kernel
def write_outcomes(block, width, constants):
    """The step's electrical energy [J], cost (squared speed deviation) [m^2/s^2] and reward."""
    for k in range(width):
        energy = energy_of_lane(block, PORT_SHAFT, PORT_STATE, k)
        energy += energy_of_lane(block, STARBOARD_SHAFT, STARBOARD_STATE, k)
        deviation = block[SPEED * LANES + k] - block[MISSION_SPEED * LANES + k]
        block[ENERGY * LANES + k] = energy
        block[COST * LANES + k] = deviation * deviation
        block[REWARD * LANES + k] = mission_reward(deviation, energy, constants)


@scalar
def copy_row(block, width, row, values):
    """Copy one row of the block."""
    for k in range(width):
        values[k] = block[row * LANES + k]


@kernel
def copy_results(block, width, first, observations, outcomes):
    """Copy, from lane `first` on, the channels to (n_lanes, N_CHANNELS), reward ... mission speed to (4, n_lanes)."""
    rows = observations[first:]
    for k in range(width):
        for channel in range(N_CHANNELS):
            rows[k, channel] = block[channel * LANES + k]
    copy_row(block, width, REWARD, outcomes[0][first:])
    copy_row(block, width, ENERGY, outcomes[1][first:])
    copy_row(block, width, COST, outcomes[2][first:])
    copy_row(block, width, MISSION_SPEED, outcomes[3][first:])


@kernel
def step_block(
    block, first, key, step, next_update, actions, limits, constants, observations, outcomes
):
    """One sample of the block that begins with lane `first`; returns how many lanes are due for a refresh after it."""
    width = min(LANES, key.size - first)
    key = key[first:]
    step = step[first:]
    next_update = next_update[first:]
    scratch = np.empty(N_SCRATCH * LANES)
    count = 0
    for k in range(width):
        step[k] += 1
        count += step[k] >= next_update[k]
    write_commands(block, width, actions[first:], limits)
    run_controllers(block, width, constants)
    sample_normals(scratch, width, key, step)
    prepare_step(block, scratch, width, constants)
    advance_motion(block, scratch, width)
    read_sensors(block, scratch, width, key, step, limits)
    write_outcomes(block, width, constants)
    copy_results(block, width, first, observations, outcomes)
    return count


@kernel
def step_blocks(
    first, last, memory, key, step, next_update, actions, limits, constants, observations, outcomes
):
    """One sample of the blocks from `first` to before `last`; returns the number of lanes due for a refresh.

    Plain arrays come in, because unpacking named tuples at the border to Python costs more than a
    lane's step; constants is a `PlantConstants` as an array. It releases the interpreter's lock, so
    threads may share the blocks.
    """
    shared = constants_from_array(constants)
    count = 0
    for b in range(first, last):
        count += step_block(
            memory[b],
            b * LANES,
            key,
            step,
            next_update,
            actions,
            limits,
            shared,
            observations,
            outcomes,
        )
    return count
