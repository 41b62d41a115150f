"""The stimulus that was learnt: the offset that a trained policy chooses by what is believed."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from diagnosers import Belief, storage
from diagnosers.kalman import Estimate, ParameterFilter
from training.stimuli.closed_loop import ClosedLoop
from training.stimuli.declaration import DECLARE, NONE, Declaration
from training.stimuli.light_bank import suspected
from training.stimuli.policy_inputs import features

if TYPE_CHECKING:
    from training.stimuli.policy import LearnedPolicy


@dataclass
class Notes:
    """What is known of every lane: the parameter filter's estimate, what is declared, and the action in force."""

    estimate: Estimate
    declaration: Declaration
    action: np.ndarray


class Learned(ClosedLoop):
    """What `auv-fault train-stimulus` has made of the environment's rewards; the policies come with the package.

    It ends with the first declaration, as the episodes of its training did. These had a decision
    per second; here the policy is asked at every sample, so that it goes ahead as soon as there is
    doubt and stops as soon as there is none.

    A policy has seen the beliefs of one filter bank on simulated vehicles at 0.2 to 0.5 m/s. Beside
    another diagnoser, whose beliefs move otherwise, it may excite for nothing, or sit still while
    there is something to be told.
    """

    name = "learned"
    seed_block = 10
    seed: ClassVar[int] = 0  # of the training
    every: ClassVar[int] = 1  # samples for which an action is held

    @property
    def _path(self) -> Path:
        return storage.WEIGHTS / f"stimulus-filter_bank-{self.seed}.safetensors"

    @cached_property
    def _policy(self) -> "LearnedPolicy":
        from training.stimuli.policy import LearnedPolicy  # PyTorch, for those alone who are asked

        return LearnedPolicy.load(self._path)

    @cached_property
    def policy_digest(self) -> str:
        """Digest of the policy's file."""
        return hashlib.sha256(self._path.read_bytes()).hexdigest()

    def initial_memory(self, n_lanes: int) -> Notes:
        """Nothing read, nothing declared, no action."""
        return Notes(
            ParameterFilter().initial(n_lanes), Declaration(n_lanes, DECLARE), np.zeros(n_lanes)
        )

    def choose_offset(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: Notes
    ) -> np.ndarray:
        """The offset in force, until a fault is declared."""
        memory.estimate = ParameterFilter().update(
            memory.estimate, np.asarray(observation, np.float64)
        )
        memory.declaration.note(belief.log_probability)
        if sample % self.every == 0:
            time = np.full(len(left), sample * SAMPLE_TIME)
            left = left * SAMPLE_TIME
            seen = features(
                suspected(belief), memory.estimate, observation, memory.action, time, left
            )
            most = np.sqrt(left) / self._policy.amplitude
            memory.action = np.clip(self._policy.action(seen)[:, 0].astype(np.float64), -most, most)
        return np.where(
            memory.declaration.declared == NONE, self._policy.amplitude * memory.action, 0.0
        )


class Learned1(Learned):
    """The same from another seed of the training: how much of what is learnt is luck."""

    name = "learned_1"
    seed_block = 11
    seed = 1


class Learned2(Learned):
    """As `Learned1`."""

    name = "learned_2"
    seed_block = 12
    seed = 2


class Learned3(Learned):
    """As `Learned1`."""

    name = "learned_3"
    seed_block = 13
    seed = 3


class Learned4(Learned):
    """As `Learned1`."""

    name = "learned_4"
    seed_block = 14
    seed = 4


class LearnedHeld(Learned):
    """`Learned` with a decision per second, as in its training: what it brings to be asked more often."""

    name = "learned_held"
    seed_block = 15
    every = round(SAMPLE_RATE)
