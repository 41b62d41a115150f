"""The stimuli that cruise until a fault is suspected, and then spend what the budget has left."""

import math
from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop, EpisodeState
from training.stimuli.d_optimal import d_optimal
from training.stimuli.waveforms import prbs, square

EXCITATION_TIME = 20.0  # s, a period of the thesis' wave
N_SAMPLES = round(EXCITATION_TIME * SAMPLE_RATE)
START_BELOW = math.log(0.5)  # log p(normal) below which an excitation starts
STOP_ABOVE = math.log(0.9)  # and above which it stops


class Excitation(NamedTuple):
    """The excitation of every lane, (n_lanes,) each."""

    age: np.ndarray  # samples since its start; -1 without one
    amplitude: np.ndarray  # root mean square of its offsets [m/s]


class Triggered(ClosedLoop):
    """Cruise until p(normal) < 0.5, then a wave for `EXCITATION_TIME` or until p(normal) > 0.9.

    The amplitude spends the whole allowance within the excitation, up to `LARGEST_OFFSET`. So an
    early false suspicion takes from a later true one.
    """

    wave: ClassVar[Callable[[], np.ndarray]]
    """Gives one period of root mean square 1, sample by sample."""

    def initial_memory(self, n_lanes: int) -> Excitation:
        """No excitation."""
        return Excitation(np.full(n_lanes, -1), np.zeros(n_lanes))

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The wave where an excitation is running."""
        log_normal = belief.log_probability[:, 0]
        age, amplitude = episode.memory
        age[age >= 0] += 1
        stops = (log_normal > STOP_ABOVE) | (age >= N_SAMPLES)
        age[stops] = -1
        starts = (age < 0) & (log_normal < START_BELOW)
        age[starts] = 0
        whole_allowance = np.sqrt(episode.allowance[starts] / N_SAMPLES)
        amplitude[starts] = np.minimum(whole_allowance, LARGEST_OFFSET)
        wave = self.wave()
        return np.where(age >= 0, amplitude * wave[age % wave.size], 0.0)


class TriggeredThesis(Triggered):
    """The square wave of the thesis once a fault is suspected, slower first."""

    name = "triggered_thesis"
    seed_block = 5
    wave = staticmethod(square)


class TriggeredPrbs(Triggered):
    """The pseudo-random binary sequence once a fault is suspected."""

    name = "triggered_prbs"
    seed_block = 6
    wave = staticmethod(prbs)


class TriggeredDOptimal(Triggered):
    """The D-optimal profile over an excitation once a fault is suspected."""

    name = "triggered_d_optimal"
    seed_block = 7
    wave = staticmethod(partial(d_optimal, EXCITATION_TIME))
