"""Periodic speed profiles of root mean square 1: a period of each, sample by sample."""

from functools import cache

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE

HALF_PERIOD = 10.0  # s, of the square wave of the thesis
BIT_TIME = 2.0  # s, of the pseudo-random sequence: 31 bits cover 0.016 Hz to a quarter of a hertz
# stages of the shift register, and those that are fed back: x^5 + x^3 + 1 is primitive
N_STAGES = 5
TAPS = (5, 3)
MULTISINE_PERIOD = 32.5  # s, half an episode of the suites
N_HARMONICS = 8  # 0.03 to 0.25 Hz


@cache
def square() -> np.ndarray:
    """The stimulus of the thesis (V.D): ten seconds slower, ten seconds faster."""
    return np.repeat([-1.0, 1.0], round(HALF_PERIOD * SAMPLE_RATE))


@cache
def prbs() -> np.ndarray:
    """A pseudo-random binary sequence of maximum length, slower first.

    Its spectrum is flat up to about 1/(2 `BIT_TIME`). Source: Ljung, "System Identification", 2nd
    ed., 1999, 13.3.
    """
    register = [1] * N_STAGES
    levels = []
    for _ in range(2**N_STAGES - 1):
        levels.append(1.0 - 2.0 * register[-1])
        feedback = register[TAPS[0] - 1] ^ register[TAPS[1] - 1]
        register = [feedback, *register[:-1]]
    return np.repeat(levels, round(BIT_TIME * SAMPLE_RATE))


@cache
def multisine() -> np.ndarray:
    """Harmonics of equal amplitude with the phases of Schroeder, which keep the peak low.

    Source: IEEE Trans. Inf. Theory 16, 1970, 85.
    """
    n_samples = round(MULTISINE_PERIOD * SAMPLE_RATE)
    phase = 2.0 * np.pi * np.arange(n_samples) / n_samples
    k = np.arange(1, N_HARMONICS + 1)[:, None]
    harmonics = np.cos(k * phase - np.pi * k * (k - 1) / N_HARMONICS)
    return np.sqrt(2.0 / N_HARMONICS) * harmonics.sum(axis=0)


@cache
def constant() -> np.ndarray:
    """No wave: always one."""
    return np.ones(1)
