"""Trains the policy of a stimulus: PPO of stable-baselines3, one policy for all budgets."""

import math
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger

from diagnosers import Diagnoser
from diagnosers.filter_bank import FilterBank
from training.learning.adam import AdamTraining
from training.learning.agent import LOG_STD, Agent
from training.learning.budgeted import N_DECISIONS, BudgetedVecEnv, speed_dependent_classes
from training.learning.imitation import demonstrate, imitate
from training.learning.outcomes import figures
from training.learning.reproducible import one_thread, seeded_generators
from training.seeds import SPAN, seeds
from training.stimuli.light_bank import light_bank
from training.stimuli.policy import LearnedPolicy
from training.stimuli.policy_inputs import BUDGETS

# vehicles at a time: an offset of one second moves a delay little, so an update needs many
LANES = 2048
ROLLOUTS = 2  # updates per epoch, each after an episode of all vehicles
DEMONSTRATED = 2 * N_DECISIONS  # decisions of each vehicle under the rule that it starts from
PASSES = 6  # of an update over its rollout
BATCH = 8320  # a sixteenth of a rollout
RATE = 2e-4  # of Adam in the first epoch; it falls evenly to `LAST_RATE` of that
LAST_RATE = 0.1
DIVERGENCE = 0.02  # nats, of the policy from that before the update, which it ends
# per decision; with less a cost counts more than the delay later that it shortens
DISCOUNT = 0.99
TRACE = 0.95  # lambda of the generalised advantages
VALIDATION_LANES = 1024
PATIENCE = 10  # epochs without a better validation loss
SETTINGS = {
    "n_epochs": PASSES,
    "batch_size": BATCH,
    "gamma": DISCOUNT,
    "gae_lambda": TRACE,
    "target_kl": DIVERGENCE,
}
LOGGED = ("value_loss", "approx_kl", "clip_fraction", "explained_variance")  # scalars of PPO
GLOBAL_SEEDS = 2**32  # seeds of numpy's global generator


class StimulusTrainer:
    """A `training.learning.trainer.Trainer` whose epochs are a few rollouts and updates of PPO.

    Every epoch begins new episodes, whose seeds depend on (seed, epoch) alone, so that an
    interrupted training continues bit for bit. `training.learning.budgeted` says what is learned.
    The light Gaussian bank (`training.stimuli.light_bank`) stands for the filter bank. `steps` are
    decisions, rounded up to whole epochs.
    """

    @property
    def data(self) -> str:
        """The episodes of the training and of its validation."""
        least, largest = BUDGETS
        return (
            f"training: epochs of {ROLLOUTS * N_DECISIONS} decisions on each of {LANES} vehicles, "
            f"episodes of {N_DECISIONS} s with budgets of {least:g} to {largest:g} m/s and the "
            f"faults {', '.join(speed_dependent_classes())}; validated on {VALIDATION_LANES} such "
            "episodes with seeds of their own. The training loss is that with exploration, the "
            "validation loss that without"
        )

    def __init__(self, seed: int, diagnoser: str = "filter_bank", steps: int = 10_000_000):
        self.seed = seed
        self.diagnoser = diagnoser
        self.epochs = math.ceil(steps / self.decisions)
        self.patience = PATIENCE
        self.env = BudgetedVecEnv(LANES, self._bank(), noise=math.exp(2.0 * LOG_STD))
        self.validation_env = BudgetedVecEnv(VALIDATION_LANES, self._bank())
        network = {"n_truth": self.env.n_truth}
        with seeded_generators(seed % GLOBAL_SEEDS):
            self.model = PPO(
                Agent,
                self.env,
                RATE,
                n_steps=N_DECISIONS,
                policy_kwargs=network,
                device="cpu",
                **SETTINGS,
            )
        self.model.set_logger(Logger(None, []))
        self.training = AdamTraining(self.model.policy)
        self.model.policy.optimizer = self.training.optimiser

    def _bank(self) -> Diagnoser | str:
        return light_bank() if self.diagnoser == FilterBank.name else self.diagnoser

    @property
    def decisions(self) -> int:
        """Decisions of an epoch, without its validation."""
        return ROLLOUTS * N_DECISIONS * LANES

    @property
    def validation_decisions(self) -> int:
        """Decisions of a validation."""
        return N_DECISIONS * VALIDATION_LANES

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes that depend on (seed, number) alone; figures of the noisy policy."""
        if number == 0:
            self._imitate()
        random = np.random.default_rng([self.seed, number])
        first = int(random.integers(SPAN - LANES))
        self.env.seed(seeds("training", LANES, first)[0])
        done_share = number / self.epochs
        self.model.lr_schedule = lambda _: RATE * (1.0 - (1.0 - LAST_RATE) * done_share)
        with one_thread(), seeded_generators(int(random.integers(GLOBAL_SEEDS))):
            self.model.learn(self.decisions, log_interval=None)
        scalars = figures(self.env.outcomes)
        for name in LOGGED:
            scalars[name] = float(self.model.logger.name_to_value[f"train/{name}"])
        return scalars

    def _imitate(self) -> None:
        """Start with the rule of `training.learning.imitation`."""
        self.env.seed(seeds("training", LANES, SPAN - LANES)[0])
        random = np.random.default_rng(self.seed)
        with one_thread(), seeded_generators(self.seed % GLOBAL_SEEDS):
            demonstration = demonstrate(self.env, DEMONSTRATED, DISCOUNT, random)
            imitate(self.model.policy, self.training, demonstration)

    def validate(self) -> dict[str, float]:
        """Figures of the policy without noise on the first episode of each validation seed."""
        env = self.validation_env
        env.seed(seeds("validation", VALIDATION_LANES)[0])
        policy = self.policy()
        observation = env.reset()
        n_features = len(policy.features)
        with one_thread():
            for _ in range(N_DECISIONS):
                observation, *_ = env.step(policy.action(observation[:, :n_features]))
        # the last one that is put into the dictionary stays: that of the first episode
        first_episodes = {outcome.lane: outcome for outcome in reversed(env.outcomes)}
        return figures(list(first_episodes.values()))

    def policy(self) -> LearnedPolicy:
        """The policy so far."""
        tensors = self.model.policy.policy_tensors()
        return LearnedPolicy(tensors, self.diagnoser, self.env.env.classes)

    def state(self) -> dict[str, np.ndarray]:
        """Weights of actor and critic, and moments of Adam, by name."""
        return self.training.state()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.training.restore(state)

    def finish(self) -> tuple[LearnedPolicy, dict[str, Any]]:
        """The policy; it needs no calibration."""
        return self.policy(), {}
