"""Compiled loops over the channels of any environment: severities, and the values that arrive."""

import numpy as np

from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.episodes import compiled_fault_effect, profile_at, severity_at
from auv_fault_env.noise import (
    GOLDEN,
    MIX_2,
    mix_bits,
    normal_pair,
    random_bits,
    upper_half_of_word,
)

# parameters of a channel; healthy are gain 1 and all others 0
N_PARAMETERS = 6
GAIN, OFFSET, NOISE, STUCK, DROPOUT, DELAY = range(N_PARAMETERS)
NORMAL_WORD = np.uint64(0)
CHANCE_WORD = np.uint64(1)


@kernel
def update_severities(step, n_steps, profile, severity):
    """Go on by some steps and write the severities there; returns whether one has changed.

    Steps are (n_lanes,), severities (n_lanes, n_events). The times of the profiles (n_lanes,
    n_events, 6) are in steps.
    """
    has_changed = False
    for lane in range(step.size):
        step[lane] += n_steps
        time = np.float64(step[lane])
        for e in range(severity.shape[1]):
            now = severity_at(time, profile_at(profile, lane, e))
            has_changed |= now != severity[lane, e]
            severity[lane, e] = now
    return has_changed


@scalar
def write_parameters(parameters, fault, severity, place, effect):
    """Write the parameters (n_channels, 6) of one lane under its events (n_events,)."""
    for c in range(parameters.shape[0]):
        for p in range(N_PARAMETERS):
            parameters[c, p] = 1.0 if p == GAIN else 0.0
    for e in range(fault.size):
        f = fault[e]
        if f >= 0 and severity[e] > 0.0 and place[f, 0] >= 0:
            factor, shift = compiled_fault_effect(severity[e], effect[f, 0], effect[f, 1])
            c = place[f, 0]
            p = place[f, 1]
            parameters[c, p] = parameters[c, p] * factor + shift


@scalar
def is_healthy(parameters):
    """Whether the parameters (6,) of a channel change nothing."""
    healthy = parameters[GAIN] == 1.0
    for p in range(OFFSET, N_PARAMETERS):
        healthy &= parameters[p] == 0.0
    return healthy


@kernel
def apply_faults(
    values,
    step,
    key,
    fault,
    severity,
    place,
    effect,
    channel,
    stream,
    limits,
    history,
    reported,
):
    """Put what arrives in the place of the values (n_lanes, n_values) of the faulty channels.

    The same values at the same step arrive the same again, so that a call may be repeated.

    Parameters
    ----------
    step, key
        Of each lane (n_lanes,): samples since the start of its episode, key of its noise.
    fault, severity
        Of each event (n_lanes, n_events).
    place, effect
        Of each fault (n_faults, 2): its place in `channel`, -1 for another target, and its
        parameter; factor and shift at severity 1.
    channel, stream, limits
        Of each channel that can be faulty: its column of the values (n_channels,), the number of
        its noise (n_channels,), least and largest value (n_channels, 2).
    history, reported
        Memory: the last values in a circle (n_lanes, n_channels, n_history), and what arrived last
        (n_lanes, n_channels).
    """
    n_channels = channel.size
    n_history = history.shape[2]
    parameters = np.empty((n_channels, N_PARAMETERS))
    for lane in range(step.size):
        write_parameters(parameters, fault[lane], severity[lane], place, effect)
        now = step[lane]
        for c in range(n_channels):
            value = np.float64(values[lane, channel[c]])
            history[lane, c, now % n_history] = value
            if not is_healthy(parameters[c]):
                late = min(np.int64(parameters[c, DELAY] + 0.5), now, n_history - 1)
                noise_key = mix_bits(key[lane] ^ (stream[c] * MIX_2 + GOLDEN))
                normal, _ = normal_pair(random_bits(noise_key, now, NORMAL_WORD))
                chance = upper_half_of_word(random_bits(noise_key, now, CHANCE_WORD))
                fresh = physics.fresh_reading(
                    history[lane, c, (now - late) % n_history],
                    parameters[c, OFFSET],
                    parameters[c, GAIN],
                    parameters[c, NOISE],
                    normal,
                )
                arrived = physics.reported(
                    fresh,
                    parameters[c, STUCK] if now > 0 else 0.0,
                    parameters[c, DROPOUT],
                    chance,
                    reported[lane, c],
                )
                value = physics.clipped(arrived, limits[c, 0], limits[c, 1])
                values[lane, channel[c]] = value
            reported[lane, c] = value
