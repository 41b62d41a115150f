"""The budget of speed deviation as a constraint on learning: a price on it that rises while it is overdrawn."""

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from training.outcomes import Outcomes
from training.vec_env import ActiveVecEnv

RATE = 0.02  # nats per decision, by which the price rises or falls at most after a rollout


class PricedVecEnv(VecEnvWrapper):
    """The active environment whose rewards are less what the decisions cost at the price of the moment.

    To gain most subject to ``E[cost] <= budget^2`` is to gain most of ``E[gain - price (cost / budget^2 - 1)]`` at the
    price, a Lagrange multiplier, at which the constraint just holds, or 0. Dual ascent finds it while the policy learns
    (Altman 1999, Constrained Markov Decision Processes, ch. 3; as PPO-Lagrangian in Ray, Achiam & Amodei 2019): after
    each rollout ``price = max(0, price + RATE overdraft)``, where ``overdraft = mean cost / budget^2 - 1``, at
    most 1. The mean is over all decisions, those of the exploring policy: one episode may overdraw what another saves.

    Attributes
    ----------
    price
        In nats per decision at full budget; rewards are in nats.
    outcomes
        Of the episodes since the last reset.
    """

    def __init__(self, venv: ActiveVecEnv):
        super().__init__(venv)
        self.price = 0.0
        self._allowed = venv.env.budget**2
        self._costs: list[float] = []

    def reset(self) -> np.ndarray:
        """Start an episode on every lane."""
        self.outcomes, self._costs = Outcomes(self.num_envs), []
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """The environment's step, its rewards less the priced costs."""
        observation, reward, done, infos = self.venv.step_wait()
        cost = self.outcomes.note(infos, done)
        self._costs.append(float(cost.mean()))
        return observation, (reward - self.price * cost / self._allowed).astype(np.float32), done, infos

    def ascend(self) -> None:
        """Adapt the price to the steps since the last time."""
        overdraft = float(np.mean(self._costs)) / self._allowed - 1.0
        self.price = max(0.0, self.price + RATE * min(overdraft, 1.0))
        self._costs = []


class DualAscent(BaseCallback):
    """Adapts the price after each rollout."""

    def __init__(self, env: PricedVecEnv):
        super().__init__()
        self._env = env

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self._env.ascend()
