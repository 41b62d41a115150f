"""Trains the policy of a stimulus: PPO of stable-baselines3, with the budget as a constraint."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger

from diagnosers.filter_bank import FilterBank
from training.active_env.vector import (
    MAX_DECISIONS,
    SCHEDULES,
    ActiveDiagnosisVectorEnv,
)
from training.learning.adam import AdamTraining
from training.learning.agent import Agent
from training.learning.constraint import ConstrainedVecEnv, DualAscent
from training.learning.imitation import demonstrate, imitate
from training.learning.outcomes import figures
from training.learning.reproducible import one_thread, seeded_generators
from training.metrics.records import HORIZON
from training.sb3 import FleetVecEnv
from training.seeds import SPAN, seeds
from training.stimuli.light_bank import light_bank, plant_prior
from training.stimuli.policy import LearnedPolicy

LANES = 512  # vehicles at a time
ROLLOUT = 32  # decisions of each vehicle between two updates of the policy
ROLLOUTS = 8  # per epoch
PASSES = 4  # of an update over its rollout
BATCH = 2048
RATE = 1e-3  # of Adam
DIVERGENCE = 0.02  # nats, of the policy from that before the update, which it ends
DISCOUNT = 0.9  # per decision: a reward 10 s sooner is worth three times as much
LEAST_BUDGET = 0.4  # share of the budget, from which training episodes begin
VALIDATION_LANES = 384
# after so many decisions every delay is known or censored
VALIDATION_DECISIONS = round(SCHEDULES.onset[1] + HORIZON)
SETTINGS = {
    "n_epochs": PASSES,
    "batch_size": BATCH,
    "gamma": DISCOUNT,
    "target_kl": DIVERGENCE,
}
LOGGED = ("value_loss", "approx_kl", "clip_fraction", "std")  # of the scalars of PPO
GLOBAL_SEEDS = 2**32  # seeds of numpy's global generator


class StimulusTrainer:
    """A `training.learning.trainer.Trainer` whose epochs are a few rollouts and updates of PPO.

    Every epoch begins new episodes, whose seeds depend on (seed, epoch) alone, so that an
    interrupted training continues bit for bit. The price of the constraint replaces the
    environment's own price of speed. The light Gaussian bank (`training.stimuli.light_bank`) stands
    for the filter bank. The budget limits the root mean square of the offsets [m/s]; `steps` are
    decisions, rounded up to whole epochs.
    """

    @property
    def data(self) -> str:
        """The episodes of the training and of its validation."""
        return (
            f"training: epochs of {ROLLOUTS * ROLLOUT} decisions on each of {LANES} vehicles, "
            f"episodes of up to {MAX_DECISIONS} s drawn as in auv_fault_env/ActiveDiagnosis-v0, of "
            f"the faults {', '.join(plant_prior())}; validated on {VALIDATION_LANES} such episodes "
            "with seeds of their own"
        )

    def __init__(
        self,
        seed: int,
        budget: float = 0.1,
        diagnoser: str = "filter_bank",
        steps: int = 650_000,
    ):
        self.seed = seed
        self.budget = budget
        self.diagnoser = diagnoser
        self.epochs = math.ceil(steps / self.decisions)
        self.patience = self.epochs
        self.env = self._environment(LANES, MAX_DECISIONS, LEAST_BUDGET)
        self.validation_env = self._environment(VALIDATION_LANES, VALIDATION_DECISIONS, 1.0)
        with seeded_generators(seed % GLOBAL_SEEDS):
            self.model = PPO(Agent, self.env, RATE, n_steps=ROLLOUT, device="cpu", **SETTINGS)
        self.model.set_logger(Logger(None, []))
        self.training = AdamTraining(self.model.policy)
        self.model.policy.optimizer = self.training.optimiser

    def _environment(
        self, n_lanes: int, max_decisions: int, least_share: float
    ) -> ConstrainedVecEnv:
        diagnoser = light_bank() if self.diagnoser == FilterBank.name else self.diagnoser
        env = ActiveDiagnosisVectorEnv(
            n_lanes,
            max_decisions,
            diagnoser=diagnoser,
            budget=self.budget,
            cost_weight=0.0,
            schedules=replace(SCHEDULES, prior=plant_prior()),
        )
        return ConstrainedVecEnv(FleetVecEnv(env), least_share)

    @property
    def decisions(self) -> int:
        """Decisions of an epoch, without its validation."""
        return ROLLOUTS * ROLLOUT * LANES

    @property
    def validation_decisions(self) -> int:
        """Decisions of a validation."""
        return VALIDATION_DECISIONS * VALIDATION_LANES

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes that depend on (seed, number) alone; figures of the noisy policy."""
        if number == 0:
            self._imitate()
        random = np.random.default_rng([self.seed, number])
        first = int(random.integers(SPAN - LANES))
        self.env.seed(seeds("training", LANES, first)[0])
        with one_thread(), seeded_generators(int(random.integers(GLOBAL_SEEDS))):
            self.model.learn(self.decisions, DualAscent(self.env), log_interval=None)
        scalars = figures(self.env.outcomes.ended, self.budget)
        scalars["price"] = self.env.price
        for name in LOGGED:
            scalars[name] = float(self.model.logger.name_to_value[f"train/{name}"])
        return scalars

    def _imitate(self) -> None:
        """Start with the rule of `training.learning.imitation`."""
        self.env.seed(seeds("training", LANES, SPAN - LANES)[0])
        with one_thread(), seeded_generators(self.seed % GLOBAL_SEEDS):
            demonstration = demonstrate(self.env, MAX_DECISIONS, DISCOUNT)
            imitate(self.model.policy, self.training, demonstration)

    def validate(self) -> dict[str, float]:
        """Figures of the policy without noise on the first episode of each validation seed."""
        env = self.validation_env
        env.seed(seeds("validation", VALIDATION_LANES)[0])
        policy = self.policy()
        observation = env.reset()
        with one_thread():
            for _ in range(VALIDATION_DECISIONS):
                observation, *_ = env.step(policy.action(observation))
        # the last one that is put into the dictionary stays: that of the first episode
        first_episodes = {outcome.lane: outcome for outcome in reversed(env.outcomes.ended)}
        return figures(list(first_episodes.values()), self.budget)

    def policy(self) -> LearnedPolicy:
        """The policy so far."""
        tensors = self.model.policy.policy_tensors()
        settings = (self.diagnoser, self.budget, self.env.amplitude, self.env.classes)
        return LearnedPolicy(tensors, *settings)

    def state(self) -> dict[str, np.ndarray]:
        """Weights of actor and critic, moments of Adam, and the price, by name."""
        return self.training.state() | {"price": np.array(self.env.price)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.training.restore(state)
        self.env.price = float(state["price"])

    def finish(self) -> tuple[LearnedPolicy, dict[str, Any]]:
        """The policy, and the price at the end of its training."""
        return self.policy(), {"price": self.env.price}
