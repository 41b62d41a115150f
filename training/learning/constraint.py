"""What binds a learning agent: an allowance that no episode can overdraw, and a price on moving a healthy vehicle."""

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from auv_fault_env.faults import NORMAL
from training.active_env.sb3 import ActiveVecEnv
from training.learning.outcomes import HEALTHY_SHARE, Outcomes
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.policy_inputs import FEATURES, compressed_allowance

DECLARATION_REWARD = 10.0  # nats
PRICE = 0.5  # nats per decision at full budget, at first
RATE = 0.02  # nats per decision, by which the price rises or falls at most after a rollout
ALLOWANCE = FEATURES.index("left")


class ConstrainedVecEnv(VecEnvWrapper):
    """The active environment within its budget, in which offsets have a price as long as the vehicle is healthy.

    The second in which the truth changes pays nothing: what it would pay is large, whatever the
    agent does. A right declaration pays `DECLARATION_REWARD`: between two faults that look alike the truth is
    worth less than a nat, to whoever waits for the declaration it is all.

    No action goes beyond what is left of an episode's squared offsets, as in
    `training.stimuli.closed_loop`; the feature `left` tells it. An episode begins with the budget,
    or with a random one from `least` of it on: the agent then learns all smaller ones as well.

    To gain most subject to a mean cost of healthy vehicles of at most ``(HEALTHY_SHARE budget)^2``
    is to gain most of what is left of the rewards after paying the price, a Lagrange multiplier, at
    which the constraint just holds. Dual ascent finds it while the agent learns (Altman 1999,
    Constrained Markov Decision Processes, ch. 3; as PPO-Lagrangian in Ray, Achiam & Amodei 2019):
    after each rollout ``price = max(0, price + RATE overdraft)``, ``overdraft = mean(cost /
    budget^2) / HEALTHY_SHARE^2 - 1``, at most 1, with the budget of each episode. The mean is over
    the decisions at whose end nothing was wrong; the cost is that of the policy's own choice,
    without the noise of exploration.

    Attributes
    ----------
    price
        In nats per decision at full budget; rewards are in nats.
    outcomes
        Of the episodes since the last reset.
    """

    def __init__(self, venv: ActiveVecEnv, least: float = 1.0):
        super().__init__(venv)
        self.price = PRICE
        self._least = least
        self._largest = venv.env.budget**2
        self.amplitude = venv.env.amplitude
        self._random = np.random.default_rng(0)
        # squared budgets of the lanes on which nothing was wrong, else NaN
        self._sound: list[np.ndarray] = []

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Seed vehicles and budgets; counts from the next reset on."""
        self._random = np.random.default_rng(seed)
        return self.venv.seed(seed)

    def reset(self) -> np.ndarray:
        """Start an episode on every lane."""
        self.outcomes = Outcomes(self.num_envs)
        self._sound = []
        self._allowed = self._drawn(self.num_envs)
        self._left = EPISODE_TIME * self._allowed
        observation = self.venv.reset()
        self._label = np.array([info["truth"]["label"] for info in self.venv.reset_infos], object)
        return self._told(observation)

    def _drawn(self, n: int) -> np.ndarray:
        """Squared budgets."""
        return self._largest * self._random.uniform(self._least, 1.0, n) ** 2

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions as far as the allowance goes."""
        most = (np.sqrt(self._left) / self.amplitude).astype(np.float32)[:, None]
        self.venv.step_async(np.clip(actions, -most, most))

    def step_wait(self) -> VecEnvStepReturn:
        """The environment's step, its rewards less the priced costs."""
        observation, reward, done, infos = self.venv.step_wait()
        cost, label = self.outcomes.note(infos, done)
        sound = np.where(label == NORMAL, self._allowed, np.nan)
        self._sound.append(sound)
        self._left = np.maximum(self._left - cost, 0.0)
        for lane in np.flatnonzero(done):
            infos[lane]["terminal_observation"][ALLOWANCE] = compressed_allowance(self._left[lane])
        self._allowed[done] = self._drawn(int(done.sum()))
        self._left[done] = EPISODE_TIME * self._allowed[done]
        right = (label == [info["declared"] for info in infos]) & (label != NORMAL)
        gain = np.where(label == self._label, reward, 0.0) + DECLARATION_REWARD * right
        label[done] = [
            self.venv.reset_infos[lane]["truth"]["label"] for lane in np.flatnonzero(done)
        ]
        self._label = label
        reward = gain - self.price * np.nan_to_num(cost / sound)
        return self._told(observation), reward.astype(np.float32), done, infos

    def _told(self, observation: np.ndarray) -> np.ndarray:
        observation[:, ALLOWANCE] = compressed_allowance(self._left)
        return observation

    def ascend(self, observations: np.ndarray, actions: np.ndarray) -> None:
        """Adapt the price to what would have been done without noise since the last time.

        Observations (n_steps, n_lanes, n_features) and the actions (n_steps, n_lanes) that the
        policy means.
        """
        left = np.expm1(observations[..., ALLOWANCE]) * LARGEST_OFFSET**2
        cost = np.minimum(np.square(self.amplitude * actions), left)
        overdraft = float(np.nanmean(cost / np.array(self._sound))) / HEALTHY_SHARE**2 - 1.0
        self.price = max(0.0, self.price + RATE * min(overdraft, 1.0))
        self._sound = []


class DualAscent(BaseCallback):
    """Adapts the price after each rollout."""

    def __init__(self, env: ConstrainedVecEnv):
        super().__init__()
        self._env = env

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        rollout = self.model.rollout_buffer
        self._env.ascend(rollout.observations, self.model.policy.meant(rollout))
