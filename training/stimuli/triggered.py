"""Stimuli that leave the mission alone until a fault is suspected, and then spend what the budget has left."""

import math
from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop
from training.stimuli.d_optimal import d_optimal
from training.stimuli.waveforms import prbs, square

# s, over which the allowance that is left is spread when the suspicion arises: a period of the
# thesis'
EXCITATION_TIME = 20.0
SPELL_SAMPLES = round(EXCITATION_TIME * SAMPLE_RATE)
SUSPICION = math.log(0.5)  # log p(normal) below which a spell begins
CALM = math.log(0.9)  # and above which it ends


class Spell(NamedTuple):
    """Of every lane: samples since its spell began (n_lanes,), -1 for none, and the spell's amplitude [m/s]."""

    phase: np.ndarray
    amplitude: np.ndarray


class Triggered(ClosedLoop):
    """Cruise until p(normal) falls below 0.5, then a wave for `EXCITATION_TIME`, or until p(normal) is above 0.9 again.

    Its amplitude spreads the allowance that is left over the spell, up to `LARGEST_OFFSET`. So a small
    budget buys a strong stimulus for a short time, and an early false suspicion takes from a later
    true one.
    """

    wave: ClassVar[Callable[[], np.ndarray]]  # a period of root mean square 1, sample by sample

    def initial_memory(self, n_lanes: int) -> Spell:
        """No spell anywhere."""
        return Spell(np.full(n_lanes, -1), np.zeros(n_lanes))

    def choose_offset(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: Spell
    ) -> np.ndarray:
        """The wave where a spell is on."""
        log_normal = belief.log_probability[:, 0]
        (phase, amplitude) = memory
        wave = self.wave()
        phase[phase >= 0] += 1
        phase[(log_normal > CALM) | (phase >= SPELL_SAMPLES)] = -1
        begins = (phase < 0) & (log_normal < SUSPICION)
        phase[begins] = 0
        amplitude[begins] = np.minimum(np.sqrt(left[begins] / SPELL_SAMPLES), LARGEST_OFFSET)
        return np.where(phase >= 0, amplitude * wave[phase % wave.size], 0.0)


class TriggeredThesis(Triggered):
    """The thesis' square wave once a fault is suspected, slower first."""

    name = "triggered_thesis"
    seed_block = 5
    wave = staticmethod(square)


class TriggeredPrbs(Triggered):
    """The pseudo-random binary sequence once a fault is suspected."""

    name = "triggered_prbs"
    seed_block = 6
    wave = staticmethod(prbs)


class TriggeredDOptimal(Triggered):
    """Once a fault is suspected, the profile that tells most of drag and thrust within a spell."""

    name = "triggered_d_optimal"
    seed_block = 7
    wave = staticmethod(partial(d_optimal, EXCITATION_TIME))
