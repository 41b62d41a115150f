"""Anchors of the scale: a diagnoser that knows nothing, and one that guesses. What does not beat them is worthless."""

from dataclasses import dataclass

import numpy as np

from auv_fault_env.compiling import kernel
from auv_fault_env.errors import whole_number
from auv_fault_env.noise import GOLDEN, LOW_32, MIX_2, float_of_integer, mix_bits
from auv_fault_env.schedules import ScheduleSampler
from diagnosers.diagnoser import Belief, Recursive, same_severity

HEALTHY = ScheduleSampler.healthy  # prior probability of normal
GUESSED = 0.5, 12**-0.5  # severity of a guess: uniform from 0 to 1, mean and standard deviation
DEEPEST = 30.0  # least log probability of normal that `Random` gives


def _guess(log_probability: np.ndarray) -> Belief:
    """A belief that knows nothing of severities."""
    return Belief(log_probability, *same_severity(log_probability.shape, *GUESSED))


class Null(Recursive):
    """Always the prior: `normal` as often as in sampled schedules, every fault class with the same share of the rest.

    It never changes its mind, so no threshold makes it alarm once an hour: it alarms never or
    always.
    """

    name = "null"

    def initial(self, n_lanes: int) -> tuple[()]:
        """Nothing."""
        return ()

    def step(self, state: tuple[()], observation: np.ndarray) -> tuple[tuple[()], Belief]:
        """The prior."""
        n_faults = len(self.classes) - 1
        prior = np.log([HEALTHY, *[(1.0 - HEALTHY) / n_faults] * n_faults])
        return state, _guess(np.tile(prior, (len(observation), 1)))


@kernel
def _uniforms(bits, seed, count):
    """Uniform numbers (n_lanes, count) in (0, 1) from the bits of each row (n_lanes, n_channels) and the seed."""
    out = np.empty((len(bits), count))
    for lane in range(len(bits)):
        key = mix_bits(seed + GOLDEN)
        for channel in range(bits.shape[1]):
            key = mix_bits(key ^ (bits[lane, channel] * MIX_2) + GOLDEN)
        for c in range(count):
            out[lane, c] = (
                float_of_integer(mix_bits(key + np.uint64(c + 1) * GOLDEN) & LOW_32) + 0.5
            ) * 2.0**-32
    return out


@dataclass(frozen=True)
class Random(Recursive):
    """A guess per sample, a hash of the observation's bits and of `seed`: equal readings get equal guesses.

    The log probability of `normal` is uniform from -30 to 0, so that a threshold can be set for any
    rate of false alarms, down to one in about 10^9 samples; the rest goes to the fault classes at
    random (Dirichlet of ones).
    """

    seed: int = 0

    name = "random"

    def __post_init__(self):
        whole_number("seed", self.seed, 0)

    def initial(self, n_lanes: int) -> tuple[()]:
        """Nothing."""
        return ()

    def step(self, state: tuple[()], observation: np.ndarray) -> tuple[tuple[()], Belief]:
        """Another guess."""
        uniform = _uniforms(
            observation.view(np.uint64), np.uint64(self.seed % 2**64), len(self.classes)
        )
        log_probability = np.log(-np.log(uniform))
        normal = -DEEPEST * uniform[:, :1]
        faults = log_probability[:, 1:] - np.log(
            np.exp(log_probability[:, 1:]).sum(axis=1, keepdims=True)
        )
        return state, _guess(np.concatenate([normal, faults + np.log(-np.expm1(normal))], axis=1))
