"""Thrust shifted between the sides of a vehicle, at the total thrust that it has anyway.

A shift s asks the port propeller for 1 + s and the starboard one for 1 - s times the thrust of
each. Thrust grows with the square of the shaft speed, so the shaft speed command n becomes
n sqrt(1 + s) and n sqrt(1 - s). The rudder holds the heading against the moment of the difference.

The kernel of a step gives both shaft controllers one command. A command that is larger by e adds
(K_p + K_i T) e to the voltage and K_i T e to the integral. So the integral has (K_p + K_i T) e more
before the step and K_p e less after it: the voltages are those of two commands, saturated or not.

Source [N] is that of `auv_fault_env.parameters`.
"""

import math

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.layout import LANES
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import clipped

THRUST_SHIFT = "thrust_shift"
LARGEST_SHIFT = 0.8  # at 1 the slower shaft would stand
# rad, rudder that holds the heading at a shift of 1, at any speed. Moment of the thrust: shafts
# 3.75 inch off the centre line; thrust equal to the drag, 14.585 slug times 0.02467 1/ft. Moment of
# the stern rudder: rho/2 L^2 0.0118 at 0.377 L behind the middle, with L 7.302 ft; all N
RUDDER_PER_SHIFT = (
    (3.75 / 12.0) * 14.585 * 0.02467 / (0.5 * 1.94 * 7.302**2 * 0.0118 * 0.377 * 7.302)
)


@scalar
def command_change(command, share, constants):
    """The change [rpm] of a shaft speed command that gives this share more thrust."""
    return min(command * math.sqrt(1.0 + share), constants.maximum_rpm) - command


@scalar
def action_within(actions, lane, column, limits):
    """One of a lane's three actions, clipped to its channel."""
    channel = row.SPEED_COMMAND + column
    return clipped(actions[lane, column], limits[channel, 0], limits[channel, 1])


@kernel
def raise_integrals(memory, actions, shift, limits, constants, excess):
    """Raise the integrals before a step, and write by how much they are too high after it.

    Parameters
    ----------
    memory
        As in `layout.FleetState`.
    actions, shift
        Those of the step, (n_lanes, 3) and (n_lanes,).
    limits, constants
        As in `Fleet`.
    excess
        Of port and starboard [V], (n_lanes, 2), filled.
    """
    shared = physics.constants_from_array(constants)
    filter_share = 1.0 - math.exp(-SAMPLE_TIME / shared.speed_filter_time)
    gain = shared.proportional_gain + shared.integral_gain * SAMPLE_TIME
    for lane in range(shift.size):
        block = memory[lane // LANES]
        k = lane % LANES
        filtered = block[row.FILTERED_SPEED * LANES + k]
        reading = block[row.SPEED_READING * LANES + k]
        speed = physics.low_pass(filtered, reading, filter_share)
        speed_command = action_within(actions, lane, 0, limits)
        rudder = action_within(actions, lane, 1, limits)
        plane = action_within(actions, lane, 2, limits)
        delta_squared = rudder * rudder + plane * plane
        command = physics.rpm_command(shared, speed_command, speed, delta_squared)
        port = command_change(command, shift[lane], shared)
        starboard = command_change(command, -shift[lane], shared)
        block[(row.PORT_STATE + row.INTEGRAL) * LANES + k] += gain * port
        block[(row.STARBOARD_STATE + row.INTEGRAL) * LANES + k] += gain * starboard
        excess[lane, 0] = shared.proportional_gain * port
        excess[lane, 1] = shared.proportional_gain * starboard


@kernel
def lower_integrals(memory, excess):
    """Take the excess (n_lanes, 2) [V] of port and starboard off the integrals after a step."""
    for lane in range(len(excess)):
        block = memory[lane // LANES]
        k = lane % LANES
        block[(row.PORT_STATE + row.INTEGRAL) * LANES + k] -= excess[lane, 0]
        block[(row.STARBOARD_STATE + row.INTEGRAL) * LANES + k] -= excess[lane, 1]
