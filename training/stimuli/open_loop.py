"""Stimuli that run like clockwork, whatever is believed; each costs as much on a healthy vehicle."""

from collections.abc import Callable
from functools import partial
from typing import ClassVar

import numpy as np

from diagnosers import Belief
from training.stimuli.base import EPISODE_TIME, Stimulus, within_channel
from training.stimuli.d_optimal import d_optimal
from training.stimuli.waveforms import multisine, prbs, square


class Cruise(Stimulus):
    """No stimulus: what any other is measured against. At constant speed some faults look alike."""

    name = "cruise"
    seed_block = 0

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Nothing."""
        return np.zeros(len(observation))


class OpenLoop(Stimulus):
    """A wave of root mean square 1 times the budget, the same on all lanes.

    The budget is kept over whole periods, and `EPISODE_TIME` has a whole number of them where the wave's
    size varies; over another time the root mean square may differ.
    """

    wave: ClassVar[Callable[[], np.ndarray]]  # a period, sample by sample, (n_samples,)

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The wave's value at this sample, as far as the channel goes."""
        wave = self.wave()
        return within_channel(
            np.full(len(observation), self.budget * wave[sample % wave.size]), observation
        )


class Thesis(OpenLoop):
    """The thesis' square wave (V.D): slower and faster than the mission by the budget, ten seconds each, slower first.

    It knows neither what is believed nor when a fault is suspected, and so costs as much on a
    healthy vehicle.
    """

    name = "thesis"
    seed_block = 1
    wave = staticmethod(square)


class Prbs(OpenLoop):
    """A pseudo-random binary sequence: all frequencies up to a quarter of a hertz, never off duty."""

    name = "prbs"
    seed_block = 2
    wave = staticmethod(prbs)


class Multisine(OpenLoop):
    """Eight harmonics of equal size: smoother for the vehicle than steps, and its peaks are 1.7 times the budget."""

    name = "multisine"
    seed_block = 3
    wave = staticmethod(multisine)


class DOptimal(OpenLoop):
    """The periodic profile that tells most of drag and thrust over an episode (`training.stimuli.d_optimal`).

    It is optimal for these two of a nominal vehicle at 1 ft/s; faults of motors and sensors do not
    enter.
    """

    name = "d_optimal"
    seed_block = 4
    wave = staticmethod(partial(d_optimal, EPISODE_TIME))
