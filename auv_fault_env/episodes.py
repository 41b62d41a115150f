"""What happens to a lane besides physics: faults coming and going, mission legs, the start of an episode."""

import math

import numpy as np

from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.lanes import copy_results, prepare_step, read_sensors, sample_normals, shaft_of
from auv_fault_env.layout import (
    ALPHA,
    DISTURBANCE,
    DISTURBANCE_NORMAL,
    FILTERED_SPEED,
    INTEGRAL,
    LANES,
    MISSION_SPEED,
    N_PARAMETERS,
    N_SCRATCH,
    PARAMETER,
    PORT_SHAFT,
    PORT_STATE,
    SHAFT_SPEED,
    SPEED,
    SPEED_COMMAND,
    STARBOARD_SHAFT,
    STARBOARD_STATE,
    VOLTAGE,
)
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.physics import (
    clipped,
    constants_from_array,
    equilibrium_shaft_speed,
    equilibrium_voltage,
)

NEVER = np.int64(1 << 60)
UPDATE_NOW = (
    -1
)  # next update of a lane whose parameters must be written anew, whatever its severities
FAR = 1e15  # steps: an instant so late that it never comes


@scalar
def severity_at(time, onset, severity, ramp, end, period, duty):
    """Severity in force at `time`: abrupt or ramped from the onset, until the end, in the on-part of each period."""
    since = time - onset
    turns = since / period + 1e-9 if period > 0.0 else 0.0
    on = since >= 0.0 and time < end and turns - math.floor(turns) <= duty
    grown = severity if since >= ramp else severity * since / ramp
    return grown if on else 0.0


@scalar
def step_at(time, step):
    """The step of an instant to come, at least the next."""
    return max(step + 1, np.int64(min(time * SAMPLE_RATE, FAR)))


@scalar
def next_change(step, time, onset, ramp, end, period):
    """The step at which an event next changes the severity in force, at the earliest."""
    if time >= end:
        return NEVER
    if time < onset:
        return step_at(onset, step)
    if period > 0.0 or time < onset + ramp:
        return step + 1
    return step_at(end, step)


@scalar
def update_severities(lane, step, plan):
    """Write the lane's severities in force; returns whether one has changed, and the step of the next change."""
    time = step / SAMPLE_RATE
    next_update = NEVER
    changed = False
    for e in range(plan.severity.shape[1]):
        onset = plan.profile[lane, e, 0]
        ramp = plan.profile[lane, e, 2]
        end = plan.profile[lane, e, 3]
        period = plan.profile[lane, e, 4]
        now = severity_at(
            time, onset, plan.profile[lane, e, 1], ramp, end, period, plan.profile[lane, e, 5]
        )
        changed |= now != plan.severity[lane, e]
        plan.severity[lane, e] = now
        next_update = min(next_update, next_change(step, time, onset, ramp, end, period))
    return changed, next_update


@scalar
def update_parameters(memory, lane, plan, catalogue):
    """Write the lane's parameters: healthy * prod(1 + s (scale - 1)) + sum(s offset), within their physical limits."""
    b = lane // LANES
    k = lane % LANES
    for p in range(N_PARAMETERS):
        factor = 1.0
        shift = 0.0
        for e in range(plan.severity.shape[1]):
            fault = plan.fault[lane, e]
            severity = plan.severity[lane, e]
            if severity > 0.0:
                factor *= 1.0 + severity * (catalogue.scale[fault, p] - 1.0)
                shift += severity * catalogue.offset[fault, p]
        value = plan.healthy[lane, p] * factor + shift
        memory[b, (PARAMETER + p) * LANES + k] = clipped(value, catalogue.low[p], catalogue.high[p])


@scalar
def update_mission_speed(memory, lane, step, legs):
    """Write the lane's mission speed; returns the step of the next leg."""
    time = step / SAMPLE_RATE
    next_update = NEVER
    for g in range(legs.shape[1]):
        if time >= legs[lane, g, 0]:
            memory[lane // LANES, MISSION_SPEED * LANES + lane % LANES] = legs[lane, g, 1]
        else:
            next_update = min(next_update, step_at(legs[lane, g, 0], step))
    return next_update


@scalar
def update_lane(lanes, lane, plan, catalogue):
    """Bring severities, parameters and mission speed of one lane to the sample ahead."""
    step = lanes.step[lane]
    stale = lanes.next_update[lane] == UPDATE_NOW
    changed, next_update = update_severities(lane, step, plan)
    if stale or changed:
        update_parameters(lanes.memory, lane, plan, catalogue)
    lanes.next_update[lane] = min(
        next_update, update_mission_speed(lanes.memory, lane, step, plan.legs)
    )


@kernel
def update_due_lanes(lanes, plan, catalogue):
    """Update every lane whose next update is due."""
    for lane in range(lanes.key.size):
        if lanes.step[lane] >= lanes.next_update[lane]:
            update_lane(lanes, lane, plan, catalogue)


@scalar
def start_shaft(block, k, shaft, state, shaft_speed, speed, constants):
    """Put one shaft at a steady speed, its voltage held by the controller's integral."""
    voltage = equilibrium_voltage(shaft_of(block, shaft, k), shaft_speed, speed, constants)
    block[(state + SHAFT_SPEED) * LANES + k] = shaft_speed
    block[(state + INTEGRAL) * LANES + k] = voltage
    block[(state + VOLTAGE) * LANES + k] = voltage


@kernel
def start_episodes(
    lanes, chosen, start_speed, plan, catalogue, limits, constants, observations, outcomes
):
    """Start an episode on the chosen lanes (m,), at rest or steady at start_speed (m,), and read the sensors once.

    constants is a `PlantConstants` as an array, as for `lanes.step_blocks`.
    """
    scratch = np.empty(N_SCRATCH * LANES)
    shared = constants_from_array(constants)
    for i in range(chosen.size):
        lane = chosen[i]
        speed = start_speed[i]
        block = lanes.memory[lane // LANES]
        k = lane % LANES
        for row in range(PARAMETER):
            block[row * LANES + k] = 0.0
        lanes.step[lane] = 0
        lanes.next_update[lane] = UPDATE_NOW
        update_lane(lanes, lane, plan, catalogue)
        beta = block[PORT_SHAFT * LANES + k] + block[STARBOARD_SHAFT * LANES + k]
        shaft_speed = equilibrium_shaft_speed(block[ALPHA * LANES + k], beta, speed, shared)
        start_shaft(block, k, PORT_SHAFT, PORT_STATE, shaft_speed, speed, shared)
        start_shaft(block, k, STARBOARD_SHAFT, STARBOARD_STATE, shaft_speed, speed, shared)
        block[SPEED * LANES + k] = speed
        block[FILTERED_SPEED * LANES + k] = speed
        block[SPEED_COMMAND * LANES + k] = block[MISSION_SPEED * LANES + k]
        one = block[k:]
        sample_normals(scratch, 1, lanes.key[lane:], lanes.step[lane:])
        prepare_step(one, scratch, 1, shared)
        block[DISTURBANCE * LANES + k] = (
            shared.disturbance_std * scratch[DISTURBANCE_NORMAL * LANES]
        )
        read_sensors(one, scratch, 1, lanes.key[lane:], lanes.step[lane:], limits)
        copy_results(one, 1, lane, observations, outcomes)
