"""The constraints on a learning agent: an allowance per episode, and a price on healthy offsets."""

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from auv_fault_env.schedules import first_onset
from training.learning.outcomes import HEALTHY_SHARE, Outcomes, true_classes
from training.metrics import NORMAL
from training.sb3 import FleetVecEnv
from training.stimuli.base import EPISODE_TIME
from training.stimuli.policy_inputs import allowance_of, compressed_allowance

DECLARATION_REWARD = 10.0  # nats
INITIAL_PRICE = 0.5  # nats per decision at full budget
PRICE_RATE = 0.02  # nats per decision, the largest change of the price after a rollout
ALLOWANCE = -1  # column of the compressed allowance, the feature `left`


class ConstrainedVecEnv(VecEnvWrapper):
    """The active environment within its budget, with a price on offsets of healthy vehicles.

    The second in which the truth changes pays nothing: its reward is large, whatever the agent
    does. A right declaration pays `DECLARATION_REWARD`: between two faults that look alike the
    truth is worth less than a nat, but the declaration depends on it.

    No action goes beyond the allowance, as in `training.stimuli.closed_loop`; the feature `left`
    shows it. An episode begins with the budget, or with a random one from `least_share` of it on,
    so that the agent learns all smaller ones as well.

    The aim is the largest reward subject to a mean cost of healthy vehicles of at most
    ``(HEALTHY_SHARE budget)^2``. The price is a Lagrange multiplier, which dual ascent finds while
    the agent learns (Altman 1999, Constrained Markov Decision Processes, ch. 3; as PPO-Lagrangian
    in Ray, Achiam & Amodei 2019): after each rollout
    ``price = max(0, price + PRICE_RATE overdraft)``, where
    ``overdraft = mean(cost / budget^2) / HEALTHY_SHARE^2 - 1``, at most 1, with the budget of each
    episode. The mean is over the decisions at whose end the vehicle is healthy; the cost is that of
    the policy's mean action, without the noise of exploration.

    The environment's own `cost_weight` should be 0. `price` is in nats per decision at full budget;
    `outcomes` are those of the episodes since the last reset.
    """

    def __init__(self, venv: FleetVecEnv, least_share: float = 1.0):
        super().__init__(venv)
        self.price = INITIAL_PRICE
        self.amplitude = venv.env.amplitude
        self.classes = venv.env.classes
        self._least_share = least_share
        self._largest_squared_budget = venv.env.budget**2
        self._random = np.random.default_rng(0)
        # per decision: squared budgets of the lanes that are healthy at its end, else NaN
        self._healthy_budgets: list[np.ndarray] = []

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Seed vehicles and budgets; counts from the next reset on."""
        self._random = np.random.default_rng(seed)
        return self.venv.seed(seed)

    def reset(self) -> np.ndarray:
        """Start an episode on every lane."""
        self._healthy_budgets = []
        self._squared_budget = self._random_squared_budgets(self.num_envs)
        self._allowance = EPISODE_TIME * self._squared_budget
        observation = self.venv.reset()
        self.outcomes = Outcomes(self._onsets())
        self._true_class = true_classes(self.venv.reset_infos)
        return self._with_allowance(observation)

    def _onsets(self) -> np.ndarray:
        return first_onset(self.venv.env.fleet.plan)

    def _random_squared_budgets(self, n: int) -> np.ndarray:
        share = self._random.uniform(self._least_share, 1.0, n)
        return self._largest_squared_budget * share**2

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions, clipped to the allowance."""
        largest = np.sqrt(self._allowance) / self.amplitude
        largest = largest.astype(np.float32)[:, None]
        self.venv.step_async(np.clip(actions, -largest, largest))

    def step_wait(self) -> VecEnvStepReturn:
        """The environment's step, with the rewards less the priced costs."""
        observation, reward, done, infos = self.venv.step_wait()
        cost, true_class = self.outcomes.update(infos, done, self._onsets())
        is_healthy = true_class == NORMAL
        healthy_budget = np.where(is_healthy, self._squared_budget, np.nan)
        self._healthy_budgets.append(healthy_budget)
        self._allowance = np.maximum(self._allowance - cost, 0.0)
        ended = np.flatnonzero(done)
        for lane in ended:
            last = infos[lane]["terminal_observation"]
            last[ALLOWANCE] = compressed_allowance(self._allowance[lane])
        self._squared_budget[done] = self._random_squared_budgets(len(ended))
        self._allowance[done] = EPISODE_TIME * self._squared_budget[done]
        declared_class = [info["declared_class"] for info in infos]
        is_right = (true_class == declared_class) & ~is_healthy
        is_unchanged = true_class == self._true_class
        priced_cost = self.price * np.nan_to_num(cost / healthy_budget)
        reward = np.where(is_unchanged, reward, 0.0) + DECLARATION_REWARD * is_right
        reward = (reward - priced_cost).astype(np.float32)
        true_class[done] = true_classes([self.venv.reset_infos[lane] for lane in ended])
        self._true_class = true_class
        return self._with_allowance(observation), reward, done, infos

    def _with_allowance(self, observation: np.ndarray) -> np.ndarray:
        observation[:, ALLOWANCE] = compressed_allowance(self._allowance)
        return observation

    def update_price(self, observations: np.ndarray, actions: np.ndarray) -> None:
        """Adapt the price to the costs of actions without noise since the last update.

        Of the observations (n_steps, n_lanes, n_features), and the actions (n_steps, n_lanes).
        """
        allowance = allowance_of(observations[..., ALLOWANCE])
        cost = np.minimum(np.square(self.amplitude * actions), allowance)
        relative_cost = float(np.nanmean(cost / np.array(self._healthy_budgets)))
        overdraft = relative_cost / HEALTHY_SHARE**2 - 1.0
        self.price = max(0.0, self.price + PRICE_RATE * min(overdraft, 1.0))
        self._healthy_budgets = []


class DualAscent(BaseCallback):
    """Updates the price after each rollout."""

    def __init__(self, env: ConstrainedVecEnv):
        super().__init__()
        self._env = env

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        rollout = self.model.rollout_buffer
        actions = self.model.policy.mean_actions(rollout)
        self._env.update_price(rollout.observations, actions)
