"""Periodic speed profiles of root mean square 1: a period of each, sample by sample."""

from functools import cache

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE

HALF_PERIOD = 10.0  # s, of the thesis' square wave
BIT = 2.0  # s, of the pseudo-random sequence: with 31 bits, from 0.016 Hz to a quarter of a hertz
# stages of the shift register, and those fed back: x^5 + x^3 + 1 is primitive
REGISTER = 5
TAPS = (5, 3)
PERIOD = 32.5  # s, half an episode of the suites
HARMONICS = 8  # 0.03 to 0.25 Hz


@cache
def square() -> np.ndarray:
    """The thesis' stimulus (V.D): ten seconds slower, ten seconds faster."""
    return np.repeat([-1.0, 1.0], round(HALF_PERIOD * SAMPLE_RATE))


@cache
def prbs() -> np.ndarray:
    """A pseudo-random binary sequence of maximum length, slower first: flat in frequency up to about 1/(2 `BIT`).

    Source: Ljung, "System Identification", 2nd ed., 1999, 13.3.
    """
    register = [1] * REGISTER
    bits = []
    for _ in range(2**REGISTER - 1):
        bits.append(1.0 - 2.0 * register[-1])
        register = [register[TAPS[0] - 1] ^ register[TAPS[1] - 1], *register[:-1]]
    return np.repeat(bits, round(BIT * SAMPLE_RATE))


@cache
def multisine() -> np.ndarray:
    """Harmonics of equal size with Schroeder's phases: a low peak (IEEE Trans. Inf. Theory 16, 1970, 85)."""
    phase = 2.0 * np.pi * np.arange(round(PERIOD * SAMPLE_RATE)) / round(PERIOD * SAMPLE_RATE)
    k = np.arange(1, HARMONICS + 1)[:, None]
    return np.sqrt(2.0 / HARMONICS) * np.cos(k * phase - np.pi * k * (k - 1) / HARMONICS).sum(
        axis=0
    )
