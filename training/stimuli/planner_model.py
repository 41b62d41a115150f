"""Rollouts of a speed offset in a model of the evidence alone: no plant and no filter in the loop.

The log odds of a fault against `normal` drift by the information rate under the fault, and fall by
it without one, with noise in proportion to that rate. A fault that changes the force of drag or
thrust by the share f changes it by f v^2, and so its rate is ``RATE f^2 v^4`` at the speed v.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.physics import clipped
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET

# nat/s at 1 m/s of a fault that doubles the force: what the log odds of `filter_bank` gain after
# the first second, on validation seeds under the conditions of the suite `ideal`
RATE = 120.0
# variance of the log odds per nat of information; 2 where likelihoods are exact and independent
NOISE = 2.0
STEP = 1.0  # s
N_STEPS = 20  # a rollout ends after them
HOLD = 2  # steps for which a candidate is held
# share of the way to a new command that the speed goes in a step: it takes about two seconds
FOLLOWING = 1.0 - math.exp(-STEP / 2.0)
ISOLATED = 1.5  # nat, log odds at which a fault counts as isolated
RESTING = -3.5  # nat, to which the log odds fall on a healthy vehicle
MOST_LOG_ODDS = 5.0  # nat: with more the offset is the largest anyway
LEAST_SHARE = 0.02  # of a class in the probability of a fault; less does not count
LEAST_SEVERITY = 0.15  # of a sampled fault
N_PATHS = 24  # of each class
SEED = 0


class BaseRule(NamedTuple):
    """What the rule that follows a candidate goes by."""

    standing: float  # m/s
    gain: float  # of `triggered_surge.surge_offset`
    free: float  # m^2/s, allowance beyond the standing offsets


@cache
def noises() -> np.ndarray:
    """Standard normal noise of the paths, (n_paths, n_steps): the same for all candidates.

    Each second path has the opposite noise of the one before, and the same severity.
    """
    half = np.random.default_rng(SEED).standard_normal((N_PATHS // 2, N_STEPS))
    return np.stack([half, -half], axis=1).reshape(N_PATHS, N_STEPS)


@cache
def force_shares(names: tuple[str, ...]) -> np.ndarray:
    """Share by which each class at severity 1 changes the force it acts on, (n_classes,).

    Of a propeller the torque counts too, which the motor's current shows: together as much as
    twice the share of thrust that is lost.
    """
    shares = np.zeros(len(names))
    for fault in CATALOGUE.values():
        if fault.component == "hull":
            shares[names.index(fault.diagnosis)] = abs(fault.scale["alpha"] - 1.0)
        elif fault.component.startswith("propeller:"):
            side = fault.component.removeprefix("propeller:")
            lost = 1.0 - fault.scale[f"{side}_beta"]
            shares[names.index(fault.diagnosis)] = 4.0 * lost
    return shares


@scalar
def base_offset(log_odds, base):
    """The offset of `StandingSurge` at these odds [m/s]."""
    eager = base.gain * math.sqrt(base.free / EPISODE_TIME) * math.exp(min(log_odds, MOST_LOG_ODDS))
    return max(
        min(eager, LARGEST_OFFSET, affordable_offset(base.free, base.standing)), base.standing
    )


@scalar
def affordable_offset(free, standing):
    """The largest offset that the allowance covers for a step [m/s]."""
    return math.sqrt(free / STEP + standing * standing)


@scalar
def information(force, speed):
    """Nat of a step at this speed under a fault of this share."""
    return RATE * STEP * force * force * speed * speed * speed * speed


@scalar
def deviation(number, count):
    """One of `count` equally likely places of a uniform distribution of standard deviation 1."""
    return math.sqrt(3.0) * ((2 * number + 1) / max(count, 1) - 1.0)


@scalar
def follow(log_odds, force, has_fault, speed, mission, held, base, noise):
    """Time until isolation [s] and squared offsets spent [m^2/s] of one path.

    Parameters
    ----------
    log_odds, speed, mission
        At the start: of a fault of hull or propellers [nat], and [m/s].
    force
        Share of the force that the fault changes, or would.
    held
        Least offset of the first `HOLD` steps [m/s]; below zero the base rule alone decides.
    base
        The `BaseRule` of the other steps.
    noise
        (n_steps,), standard normal.
    """
    resting = min(log_odds, RESTING)
    standing = base.standing
    free = base.free
    spent = 0.0
    for k in range(noise.size):
        offset = base_offset(log_odds, BaseRule(standing, base.gain, free))
        if k < HOLD:
            offset = max(offset, min(held, affordable_offset(free, standing)))
        free = max(free - STEP * (offset * offset - standing * standing), 0.0)
        spent += STEP * offset * offset
        speed += FOLLOWING * (mission + offset - speed)
        gain = information(force, speed)
        before = log_odds
        drift = gain if has_fault else -gain
        log_odds = max(log_odds + drift + math.sqrt(NOISE * gain) * noise[k], resting)
        if has_fault and log_odds >= ISOLATED:
            share = (ISOLATED - before) / (log_odds - before)
            return STEP * (k + max(share, 0.0)), spent
    return STEP * noise.size, spent


@kernel
def scores(
    log_odds, shares, force, severity, spread, speed, mission, free, standing, gain, held, price,
    noise,
):  # fmt: skip
    """What each candidate costs, delay and offsets together, (n_lanes, n_candidates) [s].

    Parameters
    ----------
    log_odds
        Of a fault of hull or propellers against `normal`, (n_lanes,) [nat].
    shares
        Of each class in their probability, (n_lanes, n_classes).
    force
        Share of the force that each class changes at severity 1, (n_classes,).
    severity, spread
        Of each class, mean and standard deviation, (n_lanes, n_classes).
    speed, mission
        Measured and asked for, (n_lanes,) [m/s].
    free
        Allowance beyond the standing offsets to come, (n_lanes,) [m^2/s].
    standing
        Offset of the base rule on a healthy vehicle [m/s].
    gain
        Of the base rule, see `triggered_surge.surge_offset`.
    held
        The candidates, (n_candidates,) [m/s]; below zero the base rule alone.
    price
        Seconds of delay that a squared offset on a healthy vehicle is worth [s per m^2/s].
    noise
        (n_paths, n_steps), standard normal.
    """
    n_lanes, n_classes = shares.shape
    total = np.zeros((n_lanes, held.size))
    for lane in range(n_lanes):
        base = BaseRule(standing, gain, free[lane])
        faulty = 1.0 / (1.0 + math.exp(-log_odds[lane]))
        for c in range(n_classes):
            weight = shares[lane, c] / noise.shape[0]
            if shares[lane, c] < LEAST_SHARE:
                continue
            for path in range(noise.shape[0]):
                place = deviation(path // 2, noise.shape[0] // 2) * spread[lane, c]
                size = clipped(severity[lane, c] + place, LEAST_SEVERITY, 1.0)
                change = force[c] * size
                for k in range(held.size):
                    delay, _ = follow(
                        log_odds[lane], change, True, speed[lane], mission[lane], held[k], base,
                        noise[path],
                    )  # fmt: skip
                    _, spent = follow(
                        log_odds[lane], change, False, speed[lane], mission[lane], held[k], base,
                        noise[path],
                    )  # fmt: skip
                    total[lane, k] += weight * faulty * delay
                    total[lane, k] += weight * (1.0 - faulty) * price * spent
    return total
