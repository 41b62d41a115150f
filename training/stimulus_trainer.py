"""Trains the stimulus policy: PPO of stable-baselines3 on the active environment, the budget as a constraint."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger

from training.active_vector_env import LIMIT, ActiveDiagnosisVectorEnv
from training.agent import Agent
from training.constraint import DualAscent, PricedVecEnv
from training.learner import Learner
from training.outcomes import figures
from training.policy import LearnedPolicy
from training.seeds import SPAN, seeds
from training.stimulus import BUDGET
from training.train_integrated import one_thread
from training.vec_env import ActiveVecEnv

LANES = 256  # vehicles at a time
ROLLOUT, ROLLOUTS = 64, 4  # decisions of each between two updates of the policy, and such rollouts per epoch
PASSES, BATCH = 10, 512  # of an update over its rollout; the gradient is cheap beside the diagnoser
RATE = 3e-4  # of Adam
STEEPEST_CHANGE = 0.02  # nats, divergence of the policy at which an update ends
DISCOUNT = 0.98  # per decision: what is known 50 s sooner is worth three times as much
TRIED = 128  # vehicles to validate on
SHOWN = ("value_loss", "approx_kl", "clip_fraction", "std")  # of what PPO logs
GLOBAL_SEEDS = 2**32  # seeds of numpy's global generator


class StimulusTrainer:
    """A `training.trainer.Trainer` whose epochs are a few rollouts and updates of PPO.

    Every epoch begins new episodes, whose seeds depend on (seed, epoch) alone, so that a training that was broken off
    goes on bit for bit. The environment's own price of speed is off: that of the constraint takes its place.

    Parameters
    ----------
    seed
        Of all that is random.
    budget
        Root mean square of the offsets that the policy may spend [m/s].
    diagnoser
        Name of the one whose beliefs it sees.
    steps
        Decisions to train on, rounded up to whole epochs.
    """

    data = (
        f"training: epochs of {ROLLOUTS * ROLLOUT} decisions on each of {LANES} vehicles, episodes of up to {LIMIT} s "
        f"drawn as in auv_fault_env/ActiveDiagnosis-v0; validated on {TRIED} such episodes with seeds of their own"
    )

    def __init__(self, seed: int, budget: float = BUDGET, diagnoser: str = "filter_bank", steps: int = 2_000_000):
        self.seed, self.budget, self.diagnoser = seed, budget, diagnoser
        self.epochs = self.patience = math.ceil(steps / self.decisions)
        self.env, self.trial = self._environment(LANES), self._environment(TRIED)
        settings = {"n_epochs": PASSES, "batch_size": BATCH, "gamma": DISCOUNT, "target_kl": STEEPEST_CHANGE}
        with seeded(seed % GLOBAL_SEEDS):
            self.model = PPO(Agent, self.env, RATE, n_steps=ROLLOUT, device="cpu", **settings)
        self.model.set_logger(Logger(None, []))
        self.learner = Learner(self.model.policy)
        self.model.policy.optimizer = self.learner.optimiser

    def _environment(self, n_lanes: int) -> PricedVecEnv:
        settings = {"diagnoser": self.diagnoser, "budget": self.budget, "cost_weight": 0.0}
        return PricedVecEnv(ActiveVecEnv(ActiveDiagnosisVectorEnv(n_lanes, **settings)))

    @property
    def decisions(self) -> int:
        """Environment steps of an epoch, validation not counted."""
        return ROLLOUTS * ROLLOUT * LANES

    @property
    def tried(self) -> int:
        """Environment steps of a validation."""
        return LIMIT * TRIED

    def epoch(self, number: int) -> dict[str, float]:
        """Rollouts and updates on episodes that depend on (seed, number) alone; figures of the exploring policy."""
        random = np.random.default_rng([self.seed, number])
        self.env.seed(seeds("training", LANES, int(random.integers(SPAN - LANES)))[0])
        with one_thread(), seeded(int(random.integers(GLOBAL_SEEDS))):
            self.model.learn(self.decisions, DualAscent(self.env), log_interval=None)
        logged = self.model.logger.name_to_value
        learning = {name: float(logged[f"train/{name}"]) for name in SHOWN}
        return figures(self.env.outcomes.ended, self.budget) | {"price": self.env.price} | learning

    def validate(self) -> dict[str, float]:
        """Figures of the policy without noise on one episode of each of the validation seeds."""
        self.trial.seed(seeds("validation", TRIED)[0])
        policy, observation = self.policy(), self.trial.reset()
        with one_thread():
            for _ in range(LIMIT):
                observation, *_ = self.trial.step(policy.action(observation))
        first = {one.lane: one for one in reversed(self.trial.outcomes.ended)}
        return figures(list(first.values()), self.budget)

    def policy(self) -> LearnedPolicy:
        """What has been learnt so far."""
        return LearnedPolicy(self.model.policy.learned(), self.diagnoser, self.budget, self.env.venv.env.amplitude)

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
