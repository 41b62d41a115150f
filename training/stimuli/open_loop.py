"""The stimuli that follow a fixed wave, whatever the belief: they cost healthy vehicles as much."""

from collections.abc import Callable
from functools import partial
from typing import ClassVar

import numpy as np

from diagnosers import Belief
from training.stimuli.base import EPISODE_TIME, Stimulus, within_channel
from training.stimuli.d_optimal import d_optimal
from training.stimuli.waveforms import constant, multisine, prbs, square


class Cruise(Stimulus):
    """No stimulus, the baseline of all others; at constant speed some faults look alike."""

    name = "cruise"
    seed_block = 0

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Zeros."""
        return np.zeros(len(observation))


class OpenLoop(Stimulus):
    """A wave of root mean square 1 times the budget, the same on all lanes.

    Only over whole periods, as in `EPISODE_TIME`, is the root mean square the budget.
    """

    wave: ClassVar[Callable[[], np.ndarray]]
    """Gives one period, sample by sample, (n_samples,)."""

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The wave at this sample, clipped to the channel."""
        wave = self.wave()
        offset = self.budget * wave[sample % wave.size]
        return within_channel(np.full(len(observation), offset), observation)


class Thesis(OpenLoop):
    """The square wave of the thesis (V.D): ten seconds slower, ten seconds faster by the budget."""

    name = "thesis"
    seed_block = 1
    wave = staticmethod(square)


class Prbs(OpenLoop):
    """A pseudo-random binary sequence: all frequencies up to a quarter of a hertz."""

    name = "prbs"
    seed_block = 2
    wave = staticmethod(prbs)


class Multisine(OpenLoop):
    """Eight harmonics of equal amplitude: smoother than steps, peaks of 1.7 times the budget."""

    name = "multisine"
    seed_block = 3
    wave = staticmethod(multisine)


class DOptimal(OpenLoop):
    """The periodic profile with most information on drag and thrust over an episode.

    See `training.stimuli.d_optimal`. It is optimal for these two parameters of a nominal vehicle at
    1 ft/s; faults of motors and sensors do not enter.
    """

    name = "d_optimal"
    seed_block = 4
    wave = staticmethod(partial(d_optimal, EPISODE_TIME))


class Constant(OpenLoop):
    """Faster by the budget all the time: what speed alone brings.

    Drag and thrust grow with the square of the speed, and so do their faults in the readings. It
    costs energy and saves time.
    """

    name = "constant"
    seed_block = 16
    wave = staticmethod(constant)
