"""One sample of many lanes: compiled loops around the equations of `physics`, block after block."""

import math

import numpy as np

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.integration import advance_motions, store_five_numbers, stored_motor
from auv_fault_env.layout import LANES
from auv_fault_env.noise import normal_pair, random_bits
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import clipped
from auv_fault_env.sensors import read_real_sensors, read_sensors
from auv_fault_env.surroundings import advance_surroundings


@scalar
def shaft_of_lane(block, shaft, k):
    """The `Shaft` of lane k whose parameters begin at row `shaft`."""
    return physics.shaft_at(block, shaft * LANES + k, LANES)


@scalar
def delta_squared(block, k):
    """Rudder and stern plane of lane k, squared and summed [rad^2]."""
    rudder = block[row.RUDDER * LANES + k]
    plane = block[row.STERN_PLANE * LANES + k]
    return rudder * rudder + plane * plane


@kernel
def write_commands(block, width, actions, limits):
    """Write the actions (n_lanes, 3), clipped, into the command rows."""
    for k in range(width):
        for c in range(3):
            command = row.SPEED_COMMAND + c
            low = limits[command, 0]
            high = limits[command, 1]
            block[command * LANES + k] = clipped(actions[k, c], low, high)


@scalar
def run_shaft_controller(block, k, constants, command, rpm_reading, state):
    """Set the voltage of one shaft from its command and its rpm reading."""
    error = command - block[rpm_reading * LANES + k]
    integral_before = block[(state + row.INTEGRAL) * LANES + k]
    voltage, integral = physics.voltage_command(constants, error, integral_before)
    block[(state + row.VOLTAGE) * LANES + k] = voltage
    block[(state + row.INTEGRAL) * LANES + k] = integral


@kernel
def run_controllers(block, width, constants):
    """Set the voltages from the commands and the latest readings."""
    has_starboard = physics.has_starboard(constants)
    share = 1.0 - math.exp(-SAMPLE_TIME / constants.speed_filter_time)
    for k in range(width):
        speed_reading = block[row.SPEED_READING * LANES + k]
        speed = physics.low_pass(block[row.FILTERED_SPEED * LANES + k], speed_reading, share)
        block[row.FILTERED_SPEED * LANES + k] = speed
        speed_command = block[row.SPEED_COMMAND * LANES + k]
        command = physics.rpm_command(constants, speed_command, speed, delta_squared(block, k))
        run_shaft_controller(block, k, constants, command, row.PORT_RPM_READING, row.PORT_STATE)
        if has_starboard:
            run_shaft_controller(
                block,
                k,
                constants,
                command,
                row.STARBOARD_RPM_READING,
                row.STARBOARD_STATE,
            )


@kernel
def sample_normals(scratch, width, key, step):
    """Write ten standard normals of each lane, for the readings and the disturbance of a step."""
    for pair in range(5):
        first = (row.NORMAL + 2 * pair) * LANES
        for k in range(width):
            word = random_bits(key[k], step[k], np.uint64(pair))
            normals = normal_pair(word)
            scratch[first + k] = normals[0]
            scratch[first + LANES + k] = normals[1]


@scalar
def motor_of_lane(block, shaft, state, k, constants):
    """The `Motor` of one of lane k's shafts at its present voltage."""
    voltage = block[(state + row.VOLTAGE) * LANES + k]
    return physics.motor(shaft_of_lane(block, shaft, k), constants, voltage)


@kernel
def prepare_step(block, scratch, width, constants):
    """Write the coefficients of the next sample and advance the disturbance to it."""
    memory, std = physics.disturbance_memory(constants)
    for k in range(width):
        port = motor_of_lane(block, row.PORT_SHAFT, row.PORT_STATE, k, constants)
        store_five_numbers(scratch, row.PORT_MOTOR, k, port)
        starboard = motor_of_lane(block, row.STARBOARD_SHAFT, row.STARBOARD_STATE, k, constants)
        store_five_numbers(scratch, row.STARBOARD_MOTOR, k, starboard)
        alpha = block[row.ALPHA * LANES + k]
        gamma = block[row.GAMMA * LANES + k]
        scratch[row.DRAG * LANES + k] = alpha + gamma * delta_squared(block, k)
        before = block[row.DISTURBANCE * LANES + k]
        normal = scratch[row.DISTURBANCE_NORMAL * LANES + k]
        disturbance = memory * before + std * normal
        block[row.DISTURBANCE * LANES + k] = disturbance
        scratch[row.PUSH * LANES + k] = disturbance
        block[row.PORT_ANGLE * LANES + k] = 0.0
        block[row.STARBOARD_ANGLE * LANES + k] = 0.0
    for r in range(len(row.MOVING)):
        for k in range(width):
            scratch[(row.START + r) * LANES + k] = block[row.MOVING[r] * LANES + k]


@kernel
def advance_motion(block, scratch, width):
    """Advance speed, shafts and angles of all lanes by one sample."""
    advance_motions(scratch, width)
    for r in range(len(row.MOVING)):
        for k in range(width):
            block[row.MOVING[r] * LANES + k] = scratch[(row.MOTION + r) * LANES + k]


@scalar
def current_of_lane(block, shaft, state, k):
    """Armature current of one of lane k's motors [A]."""
    shaft_speed = block[(state + row.SHAFT_SPEED) * LANES + k]
    voltage = block[(state + row.VOLTAGE) * LANES + k]
    return physics.armature_current(shaft_of_lane(block, shaft, k), shaft_speed, voltage)


@kernel
def write_true_values(block, scratch, width):
    """Write the surge acceleration and both currents that follow from the state."""
    for k in range(width):
        block[row.ACCELERATION * LANES + k] = physics.surge_acceleration(
            block[row.SPEED * LANES + k],
            block[row.PORT_SHAFT_SPEED * LANES + k],
            block[row.STARBOARD_SHAFT_SPEED * LANES + k],
            scratch[row.DRAG * LANES + k],
            block[row.DISTURBANCE * LANES + k],
            stored_motor(scratch, row.PORT_MOTOR, k),
            stored_motor(scratch, row.STARBOARD_MOTOR, k),
        )
        port_current = current_of_lane(block, row.PORT_SHAFT, row.PORT_STATE, k)
        block[row.PORT_CURRENT * LANES + k] = port_current
        starboard_current = current_of_lane(block, row.STARBOARD_SHAFT, row.STARBOARD_STATE, k)
        block[row.STARBOARD_CURRENT * LANES + k] = starboard_current


@scalar
def energy_of_lane(block, shaft, state, k):
    """Electrical energy of one of lane k's motors in the sample [J]."""
    angle = block[(state + row.ANGLE) * LANES + k]
    voltage = block[(state + row.VOLTAGE) * LANES + k]
    return physics.electrical_energy(shaft_of_lane(block, shaft, k), angle, voltage)


@kernel
def write_outcomes(block, width, constants):
    """Write the step's energy [J], cost (squared speed deviation) [m^2/s^2] and reward."""
    for k in range(width):
        energy = energy_of_lane(block, row.PORT_SHAFT, row.PORT_STATE, k)
        energy += energy_of_lane(block, row.STARBOARD_SHAFT, row.STARBOARD_STATE, k)
        mission_speed = block[row.MISSION_SPEED * LANES + k]
        deviation = block[row.SPEED * LANES + k] - mission_speed
        block[row.ENERGY * LANES + k] = energy
        block[row.COST * LANES + k] = deviation * deviation
        block[row.REWARD * LANES + k] = physics.mission_reward(deviation, energy, constants)


@scalar
def copy_row(block, width, source, target):
    """Copy the row `source` of the block into an array."""
    for k in range(width):
        target[k] = block[source * LANES + k]


@kernel
def copy_results(block, width, first, observations, outcomes):
    """Copy the block from lane `first` on to observations (n_lanes, n_channels) and outcomes.

    Outcomes are (4, n_lanes): reward, energy, cost, mission speed.
    """
    rows = observations[first:]
    for k in range(width):
        for channel in range(row.N_CHANNELS):
            rows[k, channel] = block[channel * LANES + k]
    copy_row(block, width, row.REWARD, outcomes[0][first:])
    copy_row(block, width, row.ENERGY, outcomes[1][first:])
    copy_row(block, width, row.COST, outcomes[2][first:])
    copy_row(block, width, row.MISSION_SPEED, outcomes[3][first:])


@kernel
def step_block(
    block,
    first,
    key,
    step,
    next_update,
    actions,
    limits,
    constants,
    effects,
    observations,
    outcomes,
):
    """One sample of the block from lane `first` on; returns how many lanes need an update."""
    width = min(LANES, key.size - first)
    key = key[first:]
    step = step[first:]
    next_update = next_update[first:]
    scratch = np.empty(row.N_SCRATCH * LANES)
    count = 0
    for k in range(width):
        step[k] += 1
        count += step[k] >= next_update[k]
    write_commands(block, width, actions[first:], limits)
    run_controllers(block, width, constants)
    if effects is not None:
        advance_surroundings(block, width, key, step, effects)
    sample_normals(scratch, width, key, step)
    prepare_step(block, scratch, width, constants)
    advance_motion(block, scratch, width)
    write_true_values(block, scratch, width)
    if effects is not None:
        read_real_sensors(block, scratch, width, key, step, limits, effects)
    else:
        read_sensors(block, scratch, width, key, step, limits)
    write_outcomes(block, width, constants)
    copy_results(block, width, first, observations, outcomes)
    return count


@kernel
def step_blocks(
    first,
    last,
    memory,
    key,
    step,
    next_update,
    actions,
    limits,
    constants,
    effects,
    observations,
    outcomes,
):
    """One sample of the blocks `first` to `last` - 1; returns how many lanes need an update.

    It takes plain arrays, constants too: unpacking named tuples costs more than a lane's step.
    `effects` is `realism.kernel_values`, or None where no lane needs it: then nothing of it is
    compiled. Threads may share the
    blocks, because it releases the interpreter's lock.
    """
    shared = physics.constants_from_array(constants)
    count = 0
    for b in range(first, last):
        block = memory[b]
        start = b * LANES
        count += step_block(
            block,
            start,
            key,
            step,
            next_update,
            actions,
            limits,
            shared,
            effects,
            observations,
            outcomes,
        )
    return count
