"""References at the lower end: a diagnoser that always gives the prior, and one that guesses."""

from dataclasses import dataclass

import numpy as np

from auv_fault_env.compiling import kernel
from auv_fault_env.errors import whole_number
from auv_fault_env.noise import GOLDEN, LOW_32, MIX_2, float_of_integer, mix_bits
from auv_fault_env.schedules import ScheduleSampler
from diagnosers.diagnoser import Belief, Memoryless, same_severity, with_impossible_unknown

PRIOR_NORMAL = ScheduleSampler.healthy
UNIFORM_SEVERITY = (
    0.5,
    12**-0.5,
)  # mean and standard deviation of a uniform one from 0 to 1
LEAST_LOG_NORMAL = -30.0  # least log probability of `normal` of `Random`


def _without_severity(log_probability: np.ndarray) -> Belief:
    """The belief of log probabilities (n_lanes, n_known), with the prior of the severities."""
    severity = same_severity(log_probability.shape, *UNIFORM_SEVERITY)
    return with_impossible_unknown(Belief(log_probability, *severity))


class Null(Memoryless):
    """Always the prior: `normal` as often as in sampled schedules, all fault classes alike.

    Its belief never changes, so no threshold gives one alarm per hour: it alarms never or always.
    """

    name = "null"

    def step(self, state: tuple[()], observation: np.ndarray) -> tuple[tuple[()], Belief]:
        """The prior."""
        n_faults = len(self.known_classes) - 1
        prior = np.full((len(observation), n_faults + 1), (1.0 - PRIOR_NORMAL) / n_faults)
        prior[:, 0] = PRIOR_NORMAL
        return state, _without_severity(np.log(prior))


@kernel
def _uniforms(bits, seed, count):
    """Uniform numbers (n_lanes, count) in (0, 1), from bits (n_lanes, n_channels) and the seed."""
    uniforms = np.empty((len(bits), count))
    for lane in range(len(bits)):
        key = mix_bits(seed + GOLDEN)
        for channel in range(bits.shape[1]):
            key = mix_bits(key ^ (bits[lane, channel] * MIX_2) + GOLDEN)
        for c in range(count):
            low_bits = mix_bits(key + np.uint64(c + 1) * GOLDEN) & LOW_32
            uniforms[lane, c] = (float_of_integer(low_bits) + 0.5) * 2.0**-32
    return uniforms


@dataclass(frozen=True)
class Random(Memoryless):
    """A guess per sample from a hash of the observation and of `seed`: the same for equal readings.

    The log probability of `normal` is uniform from -30 to 0, so that a threshold can be set for any
    rate of false alarms, down to one in about 10^9 samples; the rest goes to the fault classes at
    random (Dirichlet of ones).
    """

    seed: int = 0

    name = "random"

    def __post_init__(self):
        whole_number("seed", self.seed, 0)

    def step(self, state: tuple[()], observation: np.ndarray) -> tuple[tuple[()], Belief]:
        """A new guess."""
        seed = np.uint64(self.seed % 2**64)
        uniform = _uniforms(observation.view(np.uint64), seed, len(self.known_classes))
        log_normal = LEAST_LOG_NORMAL * uniform[:, :1]
        log_faults = np.log(-np.log(uniform))[:, 1:]
        total = np.exp(log_faults).sum(axis=1, keepdims=True)
        log_faults = log_faults - np.log(total)
        log_faulty = np.log(-np.expm1(log_normal))
        log_probability = np.concatenate([log_normal, log_faults + log_faulty], axis=1)
        return state, _without_severity(log_probability)
