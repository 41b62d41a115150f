"""Compiled loops of what surrounds the vehicle: waves, water, battery, the heat of the motors."""

import math

from numba.np.unsafe.ndarray import to_fixed_tuple

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.layout import LANES
from auv_fault_env.noise import (
    ANGLE_WORD,
    WATER_WORD,
    WHEEL_WORD,
    lower_half_of_word,
    normal_pair,
    random_bits,
    upper_half_of_word,
)
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.realism import N_SURROUNDINGS, Surroundings


@scalar
def surroundings_from_array(effects):
    """The `Surroundings` at the beginning of `realism.kernel_values`."""
    return Surroundings(*to_fixed_tuple(effects, N_SURROUNDINGS))


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
    cold_resistance = block[cold * LANES + k]
    temperature = physics.winding_temperature(
        block[temperature_row * LANES + k],
        block[(state + row.CURRENT) * LANES + k],
        cold_resistance * (1.0 + world.copper * block[temperature_row * LANES + k]),
        world.thermal_resistance,
        share,
    )
    temperature = min(temperature, world.hottest)
    block[temperature_row * LANES + k] = temperature
    resistance = (shaft + row.RESISTANCE) * LANES + k
    block[resistance] = cold_resistance * (1.0 + world.copper * temperature)
    torque_constant = (shaft + row.TORQUE_CONSTANT) * LANES + k
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
