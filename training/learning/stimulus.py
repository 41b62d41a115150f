"""Trains the stimulus policy: PPO of stable-baselines3 on the active environment, the budget as a constraint."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger

from diagnosers.filter_bank import FilterBank
from training.active_env.sb3 import ActiveVecEnv
from training.active_env.vector import MAX_DECISIONS, SCHEDULES, ActiveDiagnosisVectorEnv
from training.learning.adam import AdamTraining
from training.learning.agent import Agent
from training.learning.constraint import ConstrainedVecEnv, DualAscent
from training.learning.imitation import demonstrate, imitate
from training.learning.integrated import one_thread
from training.learning.outcomes import figures
from training.metrics.records import HORIZON
from training.seeds import SPAN, seeds
from training.stimuli.light_bank import PRIOR, light_bank
from training.stimuli.policy import LearnedPolicy

LANES = 512  # vehicles at a time
# decisions of each between two updates of the policy, and such rollouts per epoch
ROLLOUT = 32
ROLLOUTS = 8
# of an update over its rollout
PASSES = 4
BATCH = 2048
RATE = 1e-3  # of Adam
STEEPEST_CHANGE = 0.02  # nats, divergence of the policy at which an update ends
DISCOUNT = 0.9  # per decision: what is known 10 s sooner is worth three times as much
LEAST_BUDGET = 0.4  # share of the budget, from which episodes of the training begin
VALIDATION_LANES = 384  # vehicles to validate on
VALIDATION_DECISIONS = round(
    SCHEDULES.onset[1] + HORIZON
)  # decisions, by which delays are known or censored
# of PPO
SETTINGS = {
    "n_epochs": PASSES,
    "batch_size": BATCH,
    "gamma": DISCOUNT,
    "target_kl": STEEPEST_CHANGE,
}
SHOWN = ("value_loss", "approx_kl", "clip_fraction", "std")  # of what PPO logs
GLOBAL_SEEDS = 2**32  # seeds of numpy's global generator


class StimulusTrainer:
    """A `training.learning.trainer.Trainer` whose epochs are a few rollouts and updates of PPO.

    Every epoch begins new episodes, whose seeds depend on (seed, epoch) alone, so that a training
    that was broken off goes on bit for bit. The environment's own price of speed is off: that of
    the constraint takes its place. Where the diagnoser is the filter bank, a lighter one stands in
    (`training.stimuli.light_bank`).

    Parameters
    ----------
    seed
        Of all that is random.
    budget
        Largest root mean square of the offsets that the policy may spend [m/s].
    diagnoser
        Name of the one whose beliefs it sees.
    steps
        Decisions to train on, rounded up to whole epochs.
    """

    data = (
        f"training: epochs of {ROLLOUTS * ROLLOUT} decisions on each of {LANES} vehicles, episodes of up to {MAX_DECISIONS} s "
        f"drawn as in auv_fault_env/ActiveDiagnosis-v0, of the faults {', '.join(PRIOR)}; validated on {VALIDATION_LANES} such "
        "episodes with seeds of their own"
    )

    def __init__(
        self, seed: int, budget: float = 0.1, diagnoser: str = "filter_bank", steps: int = 650_000
    ):
        self.seed = seed
        self.budget = budget
        self.diagnoser = diagnoser
        self.epochs = self.patience = math.ceil(steps / self.decisions)
        self.env, self.trial = (
            self._environment(LANES, MAX_DECISIONS, LEAST_BUDGET),
            self._environment(VALIDATION_LANES, VALIDATION_DECISIONS, 1.0),
        )
        with seeded(seed % GLOBAL_SEEDS):
            self.model = PPO(Agent, self.env, RATE, n_steps=ROLLOUT, device="cpu", **SETTINGS)
        self.model.set_logger(Logger(None, []))
        self.learner = AdamTraining(self.model.policy)
        self.model.policy.optimizer = self.learner.optimiser

    def _environment(self, n_lanes: int, limit: int, least: float) -> ConstrainedVecEnv:
        diagnoser = light_bank() if self.diagnoser == FilterBank.name else self.diagnoser
        env = ActiveDiagnosisVectorEnv(
            n_lanes, limit, diagnoser=diagnoser, budget=self.budget, cost_weight=0.0
        )
        env.fleet.schedules = replace(SCHEDULES, prior=PRIOR)
        return ConstrainedVecEnv(ActiveVecEnv(env), least)

    @property
    def decisions(self) -> int:
        """Environment steps of an epoch, validation not counted."""
        return ROLLOUTS * ROLLOUT * LANES

    @property
    def tried(self) -> int:
        """Environment steps of a validation."""
        return VALIDATION_DECISIONS * VALIDATION_LANES

    def epoch(self, number: int) -> dict[str, float]:
        """Rollouts and updates on episodes that depend on (seed, number) alone; figures of the exploring policy."""
        if number == 0:
            self._imitate()
        random = np.random.default_rng([self.seed, number])
        self.env.seed(seeds("training", LANES, int(random.integers(SPAN - LANES)))[0])
        with one_thread(), seeded(int(random.integers(GLOBAL_SEEDS))):
            self.model.learn(self.decisions, DualAscent(self.env), log_interval=None)
        logged = self.model.logger.name_to_value
        learning = {name: float(logged[f"train/{name}"]) for name in SHOWN}
        return figures(self.env.outcomes.ended, self.budget) | {"price": self.env.price} | learning

    def _imitate(self) -> None:
        """Teach the actor to go ahead on suspicion, and the critic what that is worth."""
        self.env.seed(seeds("training", LANES, SPAN - LANES)[0])
        with one_thread(), seeded(self.seed % GLOBAL_SEEDS):
            imitate(self.model.policy, self.learner, demonstrate(self.env, MAX_DECISIONS, DISCOUNT))

    def validate(self) -> dict[str, float]:
        """Figures of the policy without noise on the first episode of each of the validation seeds."""
        self.trial.seed(seeds("validation", VALIDATION_LANES)[0])
        policy = self.policy()
        observation = self.trial.reset()
        with one_thread():
            for _ in range(VALIDATION_DECISIONS):
                observation, *_ = self.trial.step(policy.action(observation))
        first_episodes = {one.lane: one for one in reversed(self.trial.outcomes.ended)}
        return figures(list(first_episodes.values()), self.budget)

    def policy(self) -> LearnedPolicy:
        """What has been learnt so far."""
        return LearnedPolicy(
            self.model.policy.learned(), self.diagnoser, self.budget, self.env.amplitude
        )

    def state(self) -> dict[str, np.ndarray]:
        """Weights of actor and critic, moments of Adam, and the price, by name."""
        return self.learner.state() | {"price": np.array(self.env.price)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over what `state` gave."""
        self.learner.restore(state)
        self.env.price = float(state["price"])

    def finish(self) -> tuple[LearnedPolicy, dict[str, Any]]:
        """The policy, and the price at which it was learnt."""
        return self.policy(), {"price": self.env.price}


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Seed the global generators of torch and numpy, from which stable-baselines3 draws; afterwards as they were."""
    before = np.random.get_state()  # noqa: NPY002
    try:
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            np.random.seed(seed)  # noqa: NPY002
            yield
    finally:
        np.random.set_state(before)  # noqa: NPY002
