"""What happens to a lane besides physics: severities, mission legs and starts of episodes."""

import math

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from auv_fault_env import lanes, physics, sensors, surroundings
from auv_fault_env import layout as row
from auv_fault_env.compiling import kernel, part, scalar
from auv_fault_env.faults import fault_effect
from auv_fault_env.layout import LANES, SeverityProfile
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME

# values of `FleetState.next_update`: no update to come, and one at once, whatever the severities
NEVER = np.int64(1 << 60)
UPDATE_NOW = -1
FAR = 1e15  # steps: an instant so late that it never comes

N_PROFILE = len(SeverityProfile._fields)
compiled_fault_effect = scalar(fault_effect)


@scalar
def profile_at(profiles, lane, event):
    """The `SeverityProfile` of one event of a lane, from an array (n_lanes, n_events, 6)."""
    return SeverityProfile(*to_fixed_tuple(profiles[lane, event], N_PROFILE))


@scalar
def periods_at(time, profile):
    """Periods of an intermittent event since its onset, 0 for others; a period never ends late."""
    since_onset = time - profile.onset
    return since_onset / profile.period + 1e-9 if profile.period > 0.0 else 0.0


@scalar
def severity_at(time, profile):
    """Severity of an event at `time` [s]: it grows over the ramp, ends, and may be intermittent."""
    since_onset = time - profile.onset
    periods = periods_at(time, profile)
    in_duty = periods - math.floor(periods) <= profile.duty
    is_present = since_onset >= 0.0 and time < profile.end and in_duty
    is_full = since_onset >= profile.ramp
    reached = profile.severity if is_full else profile.severity * since_onset / profile.ramp
    return reached if is_present else 0.0


@kernel
def severities_over_time(times, profiles):
    """Severities (n_times, n_lanes) of one event of each lane, profiles (n_lanes, 1, 6)."""
    severities = np.empty((times.size, profiles.shape[0]))
    for lane in range(profiles.shape[0]):
        profile = profile_at(profiles, lane, 0)
        for k in range(times.size):
            severities[k, lane] = severity_at(times[k], profile)
    return severities


@scalar
def step_at(time, step):
    """The step of a future instant [s], at least the next one."""
    return max(step + 1, np.int64(min(time * SAMPLE_RATE, FAR)))


@scalar
def next_change(step, time, profile):
    """The first step at which the severity of an event can differ from that at `time` [s]."""
    if time >= profile.end:
        return NEVER
    if time < profile.onset:
        return step_at(profile.onset, step)
    if time < profile.onset + profile.ramp:
        return step + 1
    change = profile.end
    if profile.period > 0.0:
        start = profile.onset + math.floor(periods_at(time, profile)) * profile.period
        duty_end = start + profile.duty * profile.period
        # the event is present up to the end of the duty, and absent from the next step on
        is_before = time < duty_end + 0.5 * SAMPLE_TIME
        change = min(change, duty_end if is_before else start + profile.period)
    return step_at(change, step)


@scalar
def update_severities(lane, step, plan):
    """Write the severities of a lane; returns whether one has changed, and the next update."""
    time = step / SAMPLE_RATE
    next_update = NEVER
    has_changed = False
    for e in range(plan.severity.shape[1]):
        profile = profile_at(plan.profile, lane, e)
        severity = severity_at(time, profile)
        has_changed |= severity != plan.severity[lane, e]
        plan.severity[lane, e] = severity
        next_update = min(next_update, next_change(step, time, profile))
    return has_changed, next_update


@part
def update_parameter(memory, lane, p, plan, catalogue):
    """Write a parameter of a lane under its faults, within its physical limits."""
    factor = 1.0
    shift = 0.0
    for e in range(plan.severity.shape[1]):
        fault = plan.fault[lane, e]
        severity = plan.severity[lane, e]
        if severity > 0.0:
            scale = catalogue.scale[fault, p]
            offset = catalogue.offset[fault, p]
            factor_of_event, shift_of_event = compiled_fault_effect(severity, scale, offset)
            factor *= factor_of_event
            shift += shift_of_event
    value = plan.healthy[lane, p] * factor + shift
    limited = physics.clipped(value, catalogue.low[p], catalogue.high[p])
    block = memory[lane // LANES]
    k = lane % LANES
    block[(row.PARAMETER + p) * LANES + k] = limited
    if row.COLD_ROW[p]:
        block[row.COLD_ROW[p] * LANES + k] = limited


@scalar
def update_faulty_parameters(memory, lane, plan, catalogue):
    """Write the parameters of a lane that its faults change."""
    for e in range(plan.fault.shape[1]):
        fault = plan.fault[lane, e]
        if fault >= 0:
            for i in range(catalogue.changed.shape[1]):
                p = catalogue.changed[fault, i]
                if p >= 0:
                    update_parameter(memory, lane, p, plan, catalogue)


@scalar
def update_mission_speed(memory, lane, step, legs):
    """Write the mission speed of a lane; returns the step of the next leg."""
    time = step / SAMPLE_RATE
    next_update = NEVER
    for g in range(legs.shape[1]):
        if time >= legs[lane, g, 0]:
            memory[lane // LANES, row.MISSION_SPEED * LANES + lane % LANES] = legs[lane, g, 1]
        else:
            next_update = min(next_update, step_at(legs[lane, g, 0], step))
    return next_update


@scalar
def update_lane(state, lane, plan, catalogue):
    """Bring severities, parameters and mission speed of one lane to the present step."""
    step = state.step[lane]
    update_now = state.next_update[lane] == UPDATE_NOW
    has_changed, next_update = update_severities(lane, step, plan)
    if update_now:
        for p in range(row.N_PARAMETERS):
            update_parameter(state.memory, lane, p, plan, catalogue)
    elif has_changed:
        update_faulty_parameters(state.memory, lane, plan, catalogue)
    next_leg = update_mission_speed(state.memory, lane, step, plan.legs)
    state.next_update[lane] = min(next_update, next_leg)


@kernel
def update_due_lanes(state, plan, catalogue):
    """Update every lane whose next update is due."""
    for lane in range(state.key.size):
        if state.step[lane] >= state.next_update[lane]:
            update_lane(state, lane, plan, catalogue)


@scalar
def start_shaft(block, k, shaft, first_state, shaft_speed, speed, constants):
    """Let one shaft turn at a constant speed, its voltage in the integral of the controller."""
    coefficients = lanes.shaft_of_lane(block, shaft, k)
    voltage = physics.equilibrium_voltage(coefficients, shaft_speed, speed, constants)
    block[(first_state + row.SHAFT_SPEED) * LANES + k] = shaft_speed
    block[(first_state + row.INTEGRAL) * LANES + k] = voltage
    block[(first_state + row.VOLTAGE) * LANES + k] = voltage


@kernel(notice="the simulator: about 5 s")
def start_episodes(
    state,
    started,
    start_speed,
    plan,
    catalogue,
    limits,
    constants,
    effects,
    observations,
    outcomes,
):
    """Start an episode on the lanes `started` (m,), at a constant `start_speed` (m,) [m/s].

    Constants are a `PlantConstants` as an array; effects as in `lanes.step_blocks`. The sensors are
    read.
    """
    scratch = np.empty(row.N_SCRATCH * LANES)
    shared = physics.constants_from_array(constants)
    for i in range(started.size):
        lane = started[i]
        speed = start_speed[i]
        block = state.memory[lane // LANES]
        k = lane % LANES
        for r in range(row.PARAMETER):
            block[r * LANES + k] = 0.0
        state.step[lane] = 0
        state.next_update[lane] = UPDATE_NOW
        update_lane(state, lane, plan, catalogue)
        column = block[k:]
        key = state.key[lane:]
        step = state.step[lane:]
        if effects is not None:
            surroundings.start_surroundings(column, 1, key, step, effects)
        beta = block[row.PORT_SHAFT * LANES + k] + block[row.STARBOARD_SHAFT * LANES + k]
        alpha = block[row.ALPHA * LANES + k]
        shaft_speed = physics.equilibrium_shaft_speed(alpha, beta, speed, shared)
        start_shaft(block, k, row.PORT_SHAFT, row.PORT_STATE, shaft_speed, speed, shared)
        if physics.has_starboard(shared):
            start_shaft(
                block,
                k,
                row.STARBOARD_SHAFT,
                row.STARBOARD_STATE,
                shaft_speed,
                speed,
                shared,
            )
        block[row.SPEED * LANES + k] = speed
        block[row.FILTERED_SPEED * LANES + k] = speed
        block[row.SPEED_COMMAND * LANES + k] = block[row.MISSION_SPEED * LANES + k]
        lanes.sample_normals(scratch, 1, key, step)
        lanes.prepare_step(column, scratch, 1, shared)
        normal = scratch[row.DISTURBANCE_NORMAL * LANES]
        block[row.DISTURBANCE * LANES + k] = shared.disturbance_std * normal
        lanes.write_true_values(column, scratch, 1)
        if effects is not None:
            sensors.start_history(column, scratch, 1, effects)
            sensors.read_real_sensors(column, scratch, 1, key, step, limits, effects)
        else:
            sensors.read_sensors(column, scratch, 1, key, step, limits)
        lanes.copy_results(column, 1, lane, observations, outcomes)
