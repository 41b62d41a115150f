"""The learned stimulus: a trained policy chooses the offset from belief and estimates."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from diagnosers import Belief, storage
from diagnosers.filter_bank import FilterBank
from diagnosers.kalman import Estimate, ParameterFilter
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop, EpisodeState
from training.stimuli.light_bank import restrict_belief
from training.stimuli.policy import REACH, LearnedPolicy, policy_name
from training.stimuli.policy_inputs import policy_features


@dataclass
class LearnedMemory:
    """The memory of an episode."""

    estimate: Estimate  # of the parameter filter
    offset: np.ndarray  # the current one, (n_lanes,) [m/s]
    seen_classes: list[int]  # columns of the policy's classes in the belief


class Learned(ClosedLoop):
    """The policy of a training with `auv-fault train-stimulus`; the policies come with the package.

    The budget is among the inputs of the policy, which has learned those of
    `training.stimuli.policy_inputs.BUDGETS`. Its training had one decision per second; here it
    decides at every sample.

    The training had the beliefs of one filter bank on simulated vehicles at 0.2 to 0.5 m/s. Beside
    another diagnoser, with other beliefs, a policy may excite without a reason, or not excite where
    it would help. A policy sees the log odds of the classes of its training; a fault that joins the
    catalogue later only lowers those of `normal`.
    """

    name = "learned"
    seed_block = 10
    training_seed: ClassVar[int] = 0
    samples_per_decision: ClassVar[int] = 1

    @property
    def _path(self) -> Path:
        name = policy_name(FilterBank.name, self.training_seed)
        return storage.WEIGHTS / f"{name}.safetensors"

    @cached_property
    def _policy(self) -> LearnedPolicy:
        return LearnedPolicy.load(self._path)

    @cached_property
    def policy_digest(self) -> str:
        """Digest of the file of the policy."""
        return hashlib.sha256(self._path.read_bytes()).hexdigest()

    def initial_memory(self, n_lanes: int) -> LearnedMemory:
        """The prior estimate, no offset."""
        names = classes()
        return LearnedMemory(
            ParameterFilter().initial(n_lanes),
            np.zeros(n_lanes),
            [names.index(name) for name in self._policy.classes],
        )

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The offset of the current action."""
        memory: LearnedMemory = episode.memory
        reading = np.asarray(observation, np.float64)
        memory.estimate = ParameterFilter().update(memory.estimate, reading)
        if episode.sample % self.samples_per_decision == 0:
            allowance = episode.allowance * SAMPLE_TIME
            features = policy_features(
                restrict_belief(belief),
                memory.estimate,
                observation,
                memory.offset / LARGEST_OFFSET,
                np.full(len(allowance), episode.sample * SAMPLE_TIME),
                allowance,
                self.budget,
                memory.seen_classes,
            )
            action = self._policy.action(features)[:, 0].astype(np.float64)
            largest = np.minimum(np.sqrt(allowance), LARGEST_OFFSET)
            memory.offset = np.clip(REACH * self.budget * action, -largest, largest)
        return memory.offset


def _learned_again(training_seed: int) -> type[Learned]:
    """`Learned` with the policy of another training, to show how much of a result is chance."""
    attributes = {
        "__doc__": f"`Learned` with the policy of training seed {training_seed}.",
        "__module__": __name__,
        "name": f"learned_{training_seed}",
        "seed_block": Learned.seed_block + training_seed,
        "training_seed": training_seed,
    }
    return type(f"Learned{training_seed}", (Learned,), attributes)


# by these names pickle finds the classes
Learned1, Learned2, Learned3, Learned4 = map(_learned_again, (1, 2, 3, 4))


class LearnedHeld(Learned):
    """`Learned` with one decision per second, as in its training: what more decisions bring."""

    name = "learned_held"
    seed_block = 15
    samples_per_decision = round(SAMPLE_RATE)
