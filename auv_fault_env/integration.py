"""The motion of lanes over one sample: closed-form shafts and a quadrature of the speed.

The lanes stand in the scratch rows of `layout`, each with its motion at the start of the sample,
its motors, drag and disturbance. All take the coarse substeps. Those with a large misfit take the
fine substeps from the start again; they stand together meanwhile, so that the loop vectorises.
"""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, part, scalar
from auv_fault_env.layout import LANES
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import Motor


def graded_substeps(count: int, grading: float) -> np.ndarray:
    """Durations [s] that make a sample: short ones while the shaft answers a new voltage."""
    ends = [SAMPLE_TIME * (k / count) ** grading for k in range(count + 1)]
    return np.diff(ends)


# Samples stay within 1e-6 of DOP853 at 1e-11 (tests/auv_fault_env/test_physics.py).
COARSE = graded_substeps(4, 1.5)
FINE = graded_substeps(8, 1.75)
# of the speed; up to it the coarse substeps err by less than 3e-7
ALLOWED_MISFIT = 8e-5
LEAST_SPEED = 0.05  # m/s; misfits of slower vehicles are relative to it
# Lobatto points and weights on [0, 1], order 6
NODE_1 = 0.5 - 0.1 * math.sqrt(5.0)
NODE_2 = 0.5 + 0.1 * math.sqrt(5.0)
END_WEIGHT = 1.0 / 12.0
INNER_WEIGHT = 5.0 / 12.0
THIRD = 1.0 / 3.0


class Motion(NamedTuple):
    """Surge speed [m/s], shaft speeds [rad/s] and the angles [rad] that the shafts have turned."""

    speed: float
    port_shaft_speed: float
    starboard_shaft_speed: float
    port_angle: float
    starboard_angle: float


@scalar
def shafts_and_acceleration(
    motion, start, jerk, bend, twist, drag, disturbance, port, starboard, time
):
    """Shaft speeds, acceleration and its remainder at `time` [s] within a substep.

    The surge speed follows u' = start + jerk t + bend t^2 + twist t^3.
    """
    speed = motion.speed + time * (
        start + time * (0.5 * jerk + time * (THIRD * bend + time * (0.25 * twist)))
    )
    inner = 0.5 * THIRD * jerk + time * (0.25 * THIRD * bend + time * (0.05 * twist))
    mean = motion.speed + time * (0.5 * start + time * inner)
    slope = start + time * (0.5 * jerk + time * (0.3 * bend + time * (0.2 * twist)))
    port_shaft_speed = physics.shaft_speed_after(motion.port_shaft_speed, port, mean, slope, time)
    starboard_shaft_speed = physics.shaft_speed_after(
        motion.starboard_shaft_speed, starboard, mean, slope, time
    )
    acceleration = physics.surge_acceleration(
        speed,
        port_shaft_speed,
        starboard_shaft_speed,
        drag,
        disturbance,
        port,
        starboard,
    )
    remainder = (acceleration - start - jerk * time) * (1.0 / (time * time))
    return port_shaft_speed, starboard_shaft_speed, acceleration, remainder


@scalar
def substep(motion, drag, disturbance, port, starboard, time):
    """The motion after `time` [s], and its misfit.

    Shafts follow in closed form at Lobatto points, the speed by a quadrature of order 6. The misfit
    [m/s] is the difference of the last acceleration from the cubic through the others, times the
    duration. It exceeds the error of the speed by far.
    """
    u = motion.speed
    port_0 = motion.port_shaft_speed
    starboard_0 = motion.starboard_shaft_speed
    first = physics.surge_acceleration(u, port_0, starboard_0, drag, disturbance, port, starboard)
    port_part = port.thrust * port_0 * physics.shaft_acceleration(port_0, u, port)
    starboard_rate = physics.shaft_acceleration(starboard_0, u, starboard)
    starboard_part = starboard.thrust * starboard_0 * starboard_rate
    jerk = 2.0 * (drag * abs(u) * first + port_part + starboard_part)
    t_1 = NODE_1 * time
    t_2 = NODE_2 * time
    port_1, starboard_1, second, bend_1 = shafts_and_acceleration(
        motion, first, jerk, 0.0, 0.0, drag, disturbance, port, starboard, t_1
    )
    port_2, starboard_2, third, bend_2 = shafts_and_acceleration(
        motion, first, jerk, bend_1, 0.0, drag, disturbance, port, starboard, t_2
    )
    twist = (bend_2 - bend_1) * (1.0 / (t_2 - t_1))
    port_3, starboard_3, last, bend_3 = shafts_and_acceleration(
        motion,
        first,
        jerk,
        bend_1 - twist * t_1,
        twist,
        drag,
        disturbance,
        port,
        starboard,
        time,
    )
    end = END_WEIGHT * time
    inner = INNER_WEIGHT * time
    speed_ahead = u + end * (first + last) + inner * (second + third)
    port_angle = motion.port_angle + end * (port_0 + port_3) + inner * (port_1 + port_2)
    starboard_angle = motion.starboard_angle + end * (starboard_0 + starboard_3)
    starboard_angle += inner * (starboard_1 + starboard_2)
    ahead = Motion(speed_ahead, port_3, starboard_3, port_angle, starboard_angle)
    misfit = abs(bend_3 - bend_1 - twist * (time - t_1)) * (time * time * time)
    return ahead, misfit


@scalar
def five_numbers(scratch, first, k):
    """The numbers of lane k in the scratch rows from `first` on, a `Motion` or a `Motor`."""
    at = first * LANES + k
    return (
        scratch[at],
        scratch[at + LANES],
        scratch[at + 2 * LANES],
        scratch[at + 3 * LANES],
        scratch[at + 4 * LANES],
    )


@scalar
def store_five_numbers(scratch, first, k, numbers):
    """Write a `Motion` or a `Motor` of lane k into the scratch rows from `first` on."""
    at = first * LANES + k
    scratch[at] = numbers[0]
    scratch[at + LANES] = numbers[1]
    scratch[at + 2 * LANES] = numbers[2]
    scratch[at + 3 * LANES] = numbers[3]
    scratch[at + 4 * LANES] = numbers[4]


@scalar
def stored_motor(scratch, first, k):
    """The `Motor` of lane k in the scratch rows from `first` on."""
    return Motor(*five_numbers(scratch, first, k))


@part
def take_substeps(scratch, width, substeps):
    """Write the motions after the substeps, and the largest misfit as a share of the speed."""
    for k in range(width):
        store_five_numbers(scratch, row.MOTION, k, five_numbers(scratch, row.START, k))
        scratch[row.MISFIT * LANES + k] = 0.0
    for time in substeps:
        for k in range(width):
            motion, misfit = substep(
                Motion(*five_numbers(scratch, row.MOTION, k)),
                scratch[row.DRAG * LANES + k],
                scratch[row.PUSH * LANES + k],
                stored_motor(scratch, row.PORT_MOTOR, k),
                stored_motor(scratch, row.STARBOARD_MOTOR, k),
                time,
            )
            store_five_numbers(scratch, row.MOTION, k, motion)
            share = misfit / max(motion.speed, LEAST_SPEED)
            largest = scratch[row.MISFIT * LANES + k]
            scratch[row.MISFIT * LANES + k] = max(largest, share)


@scalar
def find_misfits(scratch, width, lanes):
    """Write the lanes whose misfit is not allowed; returns how many they are."""
    count = 0
    for k in range(width):
        if scratch[row.MISFIT * LANES + k] > ALLOWED_MISFIT:
            lanes[count] = k
            count += 1
    return count


@kernel
def advance_motions(scratch, width):
    """Write the motions of all lanes a sample after those of the rows from `layout.START` on."""
    take_substeps(scratch, width, COARSE)
    lanes = np.empty(LANES, np.int64)
    count = find_misfits(scratch, width, lanes)
    if count:
        apart = np.empty(row.N_INTEGRATION * LANES)
        for r in range(row.MOTION):
            for i in range(count):
                apart[r * LANES + i] = scratch[r * LANES + lanes[i]]
        take_substeps(apart, count, FINE)
        for r in range(row.MOTION, row.MISFIT):
            for i in range(count):
                scratch[r * LANES + lanes[i]] = apart[r * LANES + i]
