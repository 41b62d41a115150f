"""The episodes of a learning agent: a budget each, a price on healthy offsets, the truth beside."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from auv_fault_env.faults import classes
from auv_fault_env.schedules import first_onset, profile_of
from auv_fault_env.unmodelled import plant_faults
from diagnosers import Diagnoser
from training.active_env.rewards import Decision, delay_penalty
from training.active_env.vector import SCHEDULES, ActiveDiagnosisVectorEnv
from training.learning.outcomes import PRICE, Outcome
from training.sb3 import FleetVecEnv
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.policy import REACH
from training.stimuli.policy_inputs import (
    BUDGETS,
    compressed_allowance,
    compressed_budget,
    feature_bounds,
)
from training.stimuli.triggered_surge import is_of_hull_or_propellers

N_DECISIONS = round(EPISODE_TIME)  # of an episode, each of a second
PADDLE_WHEEL = "sensor:speed"
# s: nearly the whole episode, so that the time since its start says nothing about the onset
ONSET = (2.0, 60.0)
NEVER_DECLARED = 1.0  # probability; an episode lasts on after its diagnosis, as those of a suite do
ALLOWANCE = -2  # column of the compressed allowance, the feature `left`
BUDGET = -1  # column of the compressed budget
SLOW = 20.0  # s, unit of the time since the onset


def speed_dependent_classes() -> list[str]:
    """The classes of hull, propellers and paddle wheel: a speed offset separates them."""
    names = np.array(classes())
    return [*names[is_of_hull_or_propellers(classes())].tolist(), PADDLE_WHEEL]


class BudgetedVecEnv(VecEnvWrapper):
    """The active environment with a budget for each episode, and what a critic needs to know.

    Vehicles have the faults of hull, propellers and paddle wheel that a speed offset separates. An
    episode lasts `EPISODE_TIME`. Its budget is drawn from `BUDGETS`, evenly on a log scale, so that
    one policy learns them all.

    An action is an offset in units of `REACH` times the budget, so that exploration grows with what
    may be spent. None goes beyond the allowance, as in `training.stimuli.closed_loop`; the features
    `left` and `budget` show it.

    The reward is `delay_penalty`, less `PRICE` times the squared offset in units of the budget
    where the vehicle is healthy: the Lagrangian of the shortest delay at a given cost (Altman 1999,
    Constrained Markov Decision Processes, ch. 3), with the price of the budget.

    Behind the features of the agent an observation has `n_truth` columns for a critic, which no
    policy may see: the class of the episode's fault one-hot, its severity, and the time since its
    onset (asymmetric actor-critic, Pinto et al. 2017, arXiv:1710.06542).

    `outcomes` are those of the episodes since the last reset.

    Parameters
    ----------
    n_lanes, diagnoser
        As of `ActiveDiagnosisVectorEnv`.
    noise
        Variance of the noise in the actions, which is not charged: else exploration would spend
        what the policy may spend.
    """

    def __init__(self, n_lanes: int, diagnoser: Diagnoser | str, noise: float = 0.0):
        prior = dict.fromkeys(speed_dependent_classes(), 1.0)
        env = ActiveDiagnosisVectorEnv(
            n_lanes,
            N_DECISIONS,
            diagnoser=diagnoser,
            declare=NEVER_DECLARED,
            reward=self._reward,
            schedules=replace(SCHEDULES, prior=prior, onset=ONSET),
        )
        self.env = env
        self.n_truth = len(env.classes) + 2
        self.noise = noise
        self._random = np.random.default_rng(0)
        self.outcomes: list[Outcome] = []
        low, high = feature_bounds(len(env.classes))
        of_truth = np.full(self.n_truth, 2.0, np.float32)
        space = gym.spaces.Box(np.append(low, -of_truth), np.append(high, of_truth))
        super().__init__(FleetVecEnv(env), space)

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Seed vehicles and budgets; counts from the next reset on."""
        self._random = np.random.default_rng(seed)
        return list(self.venv.seed(seed))

    def reset(self) -> np.ndarray:
        """Start an episode on every lane."""
        self.outcomes = []
        observation = self.venv.reset()
        self.budget = np.zeros(self.num_envs)
        self.allowance = np.zeros(self.num_envs)
        self._time = np.zeros(self.num_envs)
        self._delay = np.zeros(self.num_envs)
        self._healthy_time = np.zeros(self.num_envs)
        self._healthy_cost = np.zeros(self.num_envs)
        self._onset = np.zeros(self.num_envs)
        self._class = np.zeros((self.num_envs, len(self.env.classes)))
        self._severity = np.zeros(self.num_envs)
        self._begin(np.arange(self.num_envs))
        return self._with_truth(observation)

    def _begin(self, lanes: np.ndarray) -> None:
        """Draw the budgets of new episodes and read their truth."""
        least, largest = np.log(BUDGETS)
        self.budget[lanes] = np.exp(self._random.uniform(least, largest, len(lanes)))
        self.allowance[lanes] = EPISODE_TIME * self.budget[lanes] ** 2
        for sums in (self._time, self._delay, self._healthy_time, self._healthy_cost):
            sums[lanes] = 0.0
        plan = self.env.fleet.plan
        self._onset[lanes] = first_onset(plan)[lanes]
        fault = plan.fault[lanes].max(axis=1, initial=-1)
        severity = profile_of(plan).severity[lanes].max(axis=1, initial=0.0)
        diagnoses = [self.env.classes.index(fault.diagnosis) for fault in plant_faults().values()]
        of_lane = np.where(fault >= 0, np.array(diagnoses)[fault], 0)
        self._class[lanes] = np.eye(len(self.env.classes))[of_lane]
        self._severity[lanes] = np.where(fault >= 0, severity, 0.0)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (num_envs, 1), clipped to the allowance."""
        self.venv.step_async(self.clipped_offsets(actions) / np.float32(self.env.amplitude))

    def clipped_offsets(self, actions: np.ndarray) -> np.ndarray:
        """The offsets of actions (num_envs, 1), clipped to the allowance, float32 [m/s]."""
        largest = np.minimum(np.sqrt(self.allowance), LARGEST_OFFSET)[:, None]
        offsets = REACH * self.budget[:, None] * actions
        return np.clip(offsets, -largest, largest).astype(np.float32)

    def _reward(self, decision: Decision) -> np.ndarray:
        """The reward of the second that the environment has just run."""
        is_healthy = decision.true_class == 0
        delay = delay_penalty(decision)
        healthy_cost = np.where(is_healthy, decision.cost, 0.0)
        explored = self.noise * np.square(REACH * self.budget)
        self.allowance = np.maximum(self.allowance - (decision.cost - explored), 0.0)
        self._time += 1.0
        self._delay -= delay
        self._healthy_time += is_healthy
        self._healthy_cost += healthy_cost
        return delay - PRICE * healthy_cost / self.budget**2

    def step_wait(self) -> VecEnvStepReturn:
        """The environment's step, with the truth behind the features."""
        observation, reward, done, infos = self.venv.step_wait()
        ended = np.flatnonzero(done)
        if ended.size:
            last = np.zeros_like(observation)
            last[ended] = [infos[lane]["terminal_observation"] for lane in ended]
            last = self._with_truth(last)
            for lane in ended.tolist():
                infos[lane]["terminal_observation"] = last[lane]
                self.outcomes.append(self._outcome(lane))
            self._begin(ended)
        return self._with_truth(observation), reward, done, infos

    def _outcome(self, lane: int) -> Outcome:
        return Outcome(
            lane=lane,
            budget=float(self.budget[lane]),
            is_faulty=bool(np.isfinite(self._onset[lane])),
            delay=float(self._delay[lane]),
            healthy_time=float(self._healthy_time[lane]),
            healthy_cost=float(self._healthy_cost[lane]),
        )

    def _with_truth(self, observation: np.ndarray) -> np.ndarray:
        """The features with the allowance of the lane, and the truth behind them."""
        observation = observation.copy()
        observation[:, ALLOWANCE] = compressed_allowance(self.allowance)
        observation[:, BUDGET] = compressed_budget(self.budget)
        since_onset = np.clip((self._time - self._onset) / SLOW, -2.0, 2.0)
        truth = np.column_stack([self._class, self._severity, since_onset])
        return np.hstack([observation, truth.astype(np.float32)])
