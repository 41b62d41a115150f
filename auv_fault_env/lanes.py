"""One sample of many lanes: compiled loops around the equations of `physics`, block after block."""

import math

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.layout import LANES
from auv_fault_env.noise import (
    ANGLE_WORD,
    CHANCE_WORD,
    OUTLIER_WORD,
    WATER_WORD,
    WHEEL_WORD,
    channel_uniform,
    lower_half_of_word,
    normal_pair,
    random_bits,
    sine,
    upper_half_of_word,
)
from auv_fault_env.parameters import RIPPLE_FREQUENCY, SAMPLE_TIME
from auv_fault_env.physics import RPM, SUBSTEP, SUBSTEPS, Motion, Motor, clipped
from auv_fault_env.realism import N_CONVERSION, N_SURROUNDINGS, Conversion, Surroundings

# row of the true value behind each reading, and factor of its unit
TRUE_ROW = (
    row.SPEED,
    row.ACCELERATION,
    row.PORT_VOLTAGE,
    row.PORT_CURRENT,
    row.PORT_SHAFT_SPEED,
    row.STARBOARD_VOLTAGE,
    row.STARBOARD_CURRENT,
    row.STARBOARD_SHAFT_SPEED,
)
TRUE_FACTOR = (1.0, 1.0, 1.0, 1.0, RPM, 1.0, 1.0, RPM)


@scalar
def shaft_of_lane(block, shaft, k):
    """The `Shaft` of lane k whose parameters begin at row `shaft`."""
    return physics.shaft_at(block, shaft * LANES + k, LANES)


@scalar
def stored_motor(scratch, side, k):
    """The `Motor` of lane k that `prepare_step` left in the scratch rows."""
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
    """Set both voltages from the commands and the latest readings."""
    share = 1.0 - math.exp(-SAMPLE_TIME / constants.speed_filter_time)
    for k in range(width):
        speed_reading = block[row.SPEED_READING * LANES + k]
        speed = physics.low_pass(block[row.FILTERED_SPEED * LANES + k], speed_reading, share)
        block[row.FILTERED_SPEED * LANES + k] = speed
        speed_command = block[row.SPEED_COMMAND * LANES + k]
        command = physics.rpm_command(constants, speed_command, speed, delta_squared(block, k))
        run_shaft_controller(block, k, constants, command, row.PORT_RPM_READING, row.PORT_STATE)
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


@scalar
def store_motor(scratch, side, k, coefficients):
    """Write a `Motor` into the scratch rows."""
    at = side * LANES + k
    scratch[at] = coefficients.drive
    scratch[at + LANES] = coefficients.damping
    scratch[at + 2 * LANES] = coefficients.coupling
    scratch[at + 3 * LANES] = coefficients.load
    scratch[at + 4 * LANES] = coefficients.thrust


@scalar
def surroundings_from_array(effects):
    """The `Surroundings` at the beginning of `realism.kernel_values`."""
    return Surroundings(*to_fixed_tuple(effects, N_SURROUNDINGS))


@scalar
def conversion_from_array(effects, channel):
    """The `Conversion` of one reading in `realism.kernel_values`."""
    first = N_SURROUNDINGS + N_CONVERSION * channel
    return Conversion(*to_fixed_tuple(effects[first:], N_CONVERSION))


@kernel
def advance_noise(block, width, key, step, world, starts):
    """Advance the angles and the noise of the paddle wheel by a sample, or start them."""
    pitch_memory, pitch_std = physics.coloured_noise(world.pitch, world.pitch_time, starts)
    roll_memory, roll_std = physics.coloured_noise(world.roll, world.roll_time, starts)
    wheel_memory, wheel_std = physics.coloured_noise(
        world.wheel_noise, world.wheel_noise_time, starts
    )
    for k in range(width):
        angles = normal_pair(random_bits(key[k], step[k], ANGLE_WORD))
        pitch = pitch_memory * block[row.PITCH * LANES + k] + pitch_std * angles[0]
        block[row.PITCH * LANES + k] = pitch
        roll = roll_memory * block[row.ROLL * LANES + k] + roll_std * angles[1]
        block[row.ROLL * LANES + k] = roll
        normals = normal_pair(random_bits(key[k], step[k], WHEEL_WORD))
        noise = wheel_memory * block[row.WHEEL_NOISE * LANES + k] + wheel_std * normals[0]
        block[row.WHEEL_NOISE * LANES + k] = noise


@kernel
def change_water(block, width, key, step, world, starts):
    """Change the current of the water and the speed through it, or start with a constant one."""
    chance = 1.0 if starts else world.current_rate * SAMPLE_TIME
    share = 1.0 - math.exp(-SAMPLE_TIME / world.current_time)
    for k in range(width):
        word = random_bits(key[k], step[k], WATER_WORD)
        place = 2.0 * lower_half_of_word(word) - 1.0
        target = block[row.WATER_TARGET * LANES + k]
        target = world.current_range * place if upper_half_of_word(word) < chance else target
        before = target if starts else block[row.WATER_CURRENT * LANES + k]
        current = physics.low_pass(before, target, share)
        block[row.WATER_TARGET * LANES + k] = target
        block[row.WATER_CURRENT * LANES + k] = current
        block[row.SPEED * LANES + k] -= current - before


@scalar
def warm_motor(block, k, world, share, shaft, state, temperature_row, cold):
    """Warm one of lane k's motors by the loss of the last sample."""
    resistance = (shaft + row.RESISTANCE) * LANES + k
    temperature = physics.winding_temperature(
        block[temperature_row * LANES + k],
        block[(state + row.CURRENT) * LANES + k],
        block[resistance],
        world.thermal_resistance,
        share,
    )
    temperature = min(temperature, world.hottest)
    block[temperature_row * LANES + k] = temperature
    torque_constant = (shaft + row.TORQUE_CONSTANT) * LANES + k
    block[resistance] = block[cold * LANES + k] * (1.0 + world.copper * temperature)
    cold_torque_constant = block[(cold + 1) * LANES + k]
    block[torque_constant] = cold_torque_constant * (1.0 + world.magnets * temperature)


@kernel
def supply_motors(block, width, step, world):
    """Lower the voltages as the battery does, and warm the motors."""
    share = 1.0 - math.exp(-SAMPLE_TIME / world.thermal_time)
    for k in range(width):
        hours = step[k] * (SAMPLE_TIME / 3600.0)
        port = block[row.PORT_CURRENT * LANES + k]
        current = abs(port) + abs(block[row.STARBOARD_CURRENT * LANES + k])
        supply = physics.supply_share(world.supply_fade, world.supply_droop, hours, current)
        block[row.PORT_VOLTAGE * LANES + k] *= supply
        block[row.STARBOARD_VOLTAGE * LANES + k] *= supply
        warm_motor(
            block,
            k,
            world,
            share,
            row.PORT_SHAFT,
            row.PORT_STATE,
            row.PORT_TEMPERATURE,
            row.PORT_COLD,
        )
        warm_motor(
            block,
            k,
            world,
            share,
            row.STARBOARD_SHAFT,
            row.STARBOARD_STATE,
            row.STARBOARD_TEMPERATURE,
            row.STARBOARD_COLD,
        )


@kernel
def advance_surroundings(block, width, key, step, effects):
    """Advance what surrounds the vehicle by a sample."""
    world = surroundings_from_array(effects)
    advance_noise(block, width, key, step, world, False)
    change_water(block, width, key, step, world, False)
    supply_motors(block, width, step, world)


@kernel
def start_surroundings(block, width, key, step, effects):
    """Start what surrounds the vehicle in its stationary distribution, the motors cold."""
    world = surroundings_from_array(effects)
    advance_noise(block, width, key, step, world, True)
    change_water(block, width, key, step, world, True)
    for k in range(width):
        block[row.PORT_TEMPERATURE * LANES + k] = 0.0
        block[row.STARBOARD_TEMPERATURE * LANES + k] = 0.0


@kernel
def prepare_step(block, scratch, width, constants):
    """Write the coefficients of the next sample and advance the disturbance to it."""
    memory, std = physics.disturbance_memory(constants)
    for k in range(width):
        port = motor_of_lane(block, row.PORT_SHAFT, row.PORT_STATE, k, constants)
        store_motor(scratch, row.PORT_MOTOR, k, port)
        starboard = motor_of_lane(block, row.STARBOARD_SHAFT, row.STARBOARD_STATE, k, constants)
        store_motor(scratch, row.STARBOARD_MOTOR, k, starboard)
        alpha = block[row.ALPHA * LANES + k]
        gamma = block[row.GAMMA * LANES + k]
        scratch[row.DRAG * LANES + k] = alpha + gamma * delta_squared(block, k)
        before = block[row.DISTURBANCE * LANES + k]
        normal = scratch[row.DISTURBANCE_NORMAL * LANES + k]
        block[row.DISTURBANCE * LANES + k] = memory * before + std * normal
        block[row.PORT_ANGLE * LANES + k] = 0.0
        block[row.STARBOARD_ANGLE * LANES + k] = 0.0


@kernel
def advance_motion(block, scratch, width):
    """Advance speed, shafts and angles of all lanes by one sample, substep after substep."""
    for s in range(SUBSTEPS):
        time = SUBSTEP[s]
        for k in range(width):
            motion = physics.substep(
                Motion(
                    block[row.SPEED * LANES + k],
                    block[row.PORT_SHAFT_SPEED * LANES + k],
                    block[row.STARBOARD_SHAFT_SPEED * LANES + k],
                    block[row.PORT_ANGLE * LANES + k],
                    block[row.STARBOARD_ANGLE * LANES + k],
                ),
                scratch[row.DRAG * LANES + k],
                block[row.DISTURBANCE * LANES + k],
                stored_motor(scratch, row.PORT_MOTOR, k),
                stored_motor(scratch, row.STARBOARD_MOTOR, k),
                time,
            )
            block[row.SPEED * LANES + k] = motion.speed
            block[row.PORT_SHAFT_SPEED * LANES + k] = motion.port_shaft_speed
            block[row.STARBOARD_SHAFT_SPEED * LANES + k] = motion.starboard_shaft_speed
            block[row.PORT_ANGLE * LANES + k] = motion.port_angle
            block[row.STARBOARD_ANGLE * LANES + k] = motion.starboard_angle


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


@kernel
def sample_words(words, width, key, step, first):
    """Write the random bits of each lane (2, n_lanes), from the word `first` on."""
    for i in range(2):
        word = first + np.uint64(i)
        for k in range(width):
            words[i, k] = random_bits(key[k], step[k], word)


@kernel
def write_signals(block, scratch, width, effects):
    """Write what acts on the sensors, in the units of their readings, into the scratch rows."""
    world = surroundings_from_array(effects)
    for channel in range(row.N_READINGS):
        true_row = TRUE_ROW[channel] * LANES
        signal = (row.SIGNAL_VALUE + channel) * LANES
        factor = TRUE_FACTOR[channel]
        for k in range(width):
            scratch[signal + k] = factor * block[true_row + k]
    wheel = (row.SIGNAL_VALUE + row.SPEED_READING - row.READING) * LANES
    acceleration = (row.SIGNAL_VALUE + row.ACCELERATION_READING - row.READING) * LANES
    for k in range(width):
        pitch = block[row.PITCH * LANES + k]
        roll = block[row.ROLL * LANES + k]
        scratch[wheel + k] += block[row.WHEEL_NOISE * LANES + k]
        scratch[acceleration + k] += physics.gravity_felt(pitch, roll, world.cross_axis)


@kernel
def start_history(block, scratch, width, effects):
    """Let the signals be what they are since long ago."""
    write_true_values(block, scratch, width)
    write_signals(block, scratch, width, effects)
    for channel in range(row.N_READINGS):
        for place in range(row.N_HISTORY):
            past = (row.HISTORY + row.N_HISTORY * channel + place) * LANES
            for k in range(width):
                block[past + k] = scratch[(row.SIGNAL_VALUE + channel) * LANES + k]


@kernel
def delay_signals(block, scratch, width, step):
    """Store the signals, and put those in their place that are as old as the latencies."""
    for channel in range(row.N_READINGS):
        signal = (row.SIGNAL_VALUE + channel) * LANES
        history = (row.HISTORY + row.N_HISTORY * channel) * LANES
        latency = (row.SIGNALS + row.N_SIGNAL_PARAMETERS * channel) * LANES
        for k in range(width):
            block[history + (step[k] % row.N_HISTORY) * LANES + k] = scratch[signal + k]
            late = np.int64(block[latency + k] + 0.5)
            place = (step[k] - late) % row.N_HISTORY
            scratch[signal + k] = block[history + place * LANES + k]


@scalar
def outlier(chance, probability, size):
    """A positive or a negative outlier, equally likely, or 0."""
    positive = size if chance < probability else 0.0
    return -size if chance < 0.5 * probability else positive


@kernel
def convert_signals(block, scratch, width, key, step, effects):
    """Put what the converters give in the place of the signals."""
    probability = surroundings_from_array(effects).outlier_probability
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, OUTLIER_WORD)
    for k in range(width):
        turns = RIPPLE_FREQUENCY * SAMPLE_TIME * step[k]
        scratch[row.RIPPLE * LANES + k] = sine(turns - math.floor(turns))
    for channel in range(row.N_READINGS):
        converter = conversion_from_array(effects, channel)
        chances = words[channel // 4]
        value = (row.SIGNAL_VALUE + channel) * LANES
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        ripple = (row.SIGNALS + row.N_SIGNAL_PARAMETERS * channel + 1) * LANES
        normal = (row.NORMAL + channel) * LANES
        for k in range(width):
            signal = scratch[value + k]
            fresh = physics.fresh_reading(
                signal,
                block[sensor + k],
                block[sensor + LANES + k],
                block[sensor + 2 * LANES + k],
                scratch[normal + k],
            )
            fresh += block[ripple + k] * scratch[row.RIPPLE * LANES + k]
            chance = channel_uniform(chances[k], channel)
            fresh += outlier(chance, probability, converter.outlier)
            counted = fresh if abs(signal) >= converter.least else 0.0
            scratch[value + k] = physics.converted(counted, converter)


@kernel
def read_real_sensors(block, scratch, width, key, step, limits, effects):
    """As `read_sensors`, with the imperfections of `realism.kernel_values`."""
    write_true_values(block, scratch, width)
    write_signals(block, scratch, width, effects)
    delay_signals(block, scratch, width, step)
    convert_signals(block, scratch, width, key, step, effects)
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, CHANCE_WORD)
    for channel in range(row.N_READINGS):
        chances = words[channel // 4]
        read_into = row.READING + channel
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        low = limits[read_into, 0]
        high = limits[read_into, 1]
        for k in range(width):
            unlimited = physics.reported(
                scratch[(row.SIGNAL_VALUE + channel) * LANES + k],
                block[sensor + 3 * LANES + k],
                block[sensor + 4 * LANES + k],
                channel_uniform(chances[k], channel),
                block[read_into * LANES + k],
            )
            block[read_into * LANES + k] = clipped(unlimited, low, high)


@kernel
def read_sensors(block, scratch, width, key, step, limits):
    """Write the true values and the readings of every sensor of every lane."""
    write_true_values(block, scratch, width)
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, CHANCE_WORD)
    for channel in range(row.N_READINGS):
        chances = words[channel // 4]
        read_into = row.READING + channel
        true_row = TRUE_ROW[channel]
        factor = TRUE_FACTOR[channel]
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        normal = (row.NORMAL + channel) * LANES
        low = limits[read_into, 0]
        high = limits[read_into, 1]
        for k in range(width):
            fresh = physics.fresh_reading(
                factor * block[true_row * LANES + k],
                block[sensor + k],
                block[sensor + LANES + k],
                block[sensor + 2 * LANES + k],
                scratch[normal + k],
            )
            unlimited = physics.reported(
                fresh,
                block[sensor + 3 * LANES + k],
                block[sensor + 4 * LANES + k],
                channel_uniform(chances[k], channel),
                block[read_into * LANES + k],
            )
            block[read_into * LANES + k] = clipped(unlimited, low, high)


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
    if effects.size:
        advance_surroundings(block, width, key, step, effects)
    sample_normals(scratch, width, key, step)
    prepare_step(block, scratch, width, constants)
    advance_motion(block, scratch, width)
    if effects.size:
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
    `effects` is `realism.kernel_values`, or empty where no lane needs it. Threads may share the
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
