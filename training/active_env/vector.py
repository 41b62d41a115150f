"""The active environment for many vehicles: one fleet, and one diagnoser over all lanes."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.actions import ACTIONS, actions_of, checked_actions
from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.env.autoreset import AutoresetVectorEnv
from auv_fault_env.env.interface import vehicle_of_argument
from auv_fault_env.errors import finite_in_range, refusal
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, MissionDistribution, MissionSampler
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.schedules import Schedule, ScheduleDistribution, ScheduleSampler
from auv_fault_env.thrust_shift import LARGEST_SHIFT
from auv_fault_env.truth import fleet_truth, known_level
from diagnosers import Belief
from training.active_env.beliefs import beliefs_of
from training.active_env.diagnoser_argument import lane_diagnosers
from training.active_env.parameter_estimates import ParameterEstimates
from training.active_env.rewards import (
    Decision,
    Reward,
    checked_reward,
    known_reward,
    log_probability_gain,
)
from training.active_env.spec import with_plain_arguments
from training.active_env.true_classes import DECISION, TrueClasses
from training.metrics.declaration import DECLARATION_PROBABILITY
from training.stimuli.base import BUDGET, EPISODE_TIME, LARGEST_OFFSET, MISSION_SPEED
from training.stimuli.declaration import UNDECLARED, Declaration
from training.stimuli.policy_inputs import feature_bounds, policy_features

DECISION_TIME = DECISION * SAMPLE_TIME  # s
MAX_DECISIONS = 120  # of an episode
SCHEDULES = ScheduleSampler(healthy=0.3, onset=(5.0, 40.0))
CONSTANT_SPEEDS = (0.2, 0.5)  # least and most, of the vehicle's largest command
COST_WEIGHT = 10.0  # s^2/m^2
ELEMENTS = ("the speed offset", "the shift of thrust")  # of an action


class ActiveMissions(MissionSampler):
    """Half of the missions keep one of the `CONSTANT_SPEEDS`, the others change it leg by leg."""

    def sample_legs(
        self, key: np.ndarray, maximum_speed: float = MAXIMUM_COMMAND
    ) -> tuple[np.ndarray, np.ndarray]:
        """Legs (n_lanes, n_legs, 2) and start speeds (n_lanes,) for noise keys (n_lanes,)."""
        legs, start_speed = super().sample_legs(key, maximum_speed)
        chance, place = uniforms(key, STREAMS["constant_speed"], 2).T
        slowest, fastest = CONSTANT_SPEEDS
        speed = maximum_speed * (slowest + (fastest - slowest) * place)
        is_constant = chance < 0.5
        legs[:, :, 1] = np.where(is_constant[:, None], speed[:, None], legs[:, :, 1])
        return legs, np.where(is_constant, speed, start_speed)


class ActiveDiagnosisVectorEnv(AutoresetVectorEnv):
    """`ActiveDiagnosisEnv` for many vehicles at once; what is not said here is as there.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, and its next episodes are
    the same, too. A lane that ends starts its next episode within the same step, unless
    `autoreset_mode` says otherwise: its observation and information are those of the start;
    ``info["final_obs"]`` and ``info["final_info"]`` hold those of the end, on the lanes that
    ``info["_final_info"]`` marks. See `AutoresetVectorEnv` for the modes and the options of a
    reset. `max_episode_steps` truncates, and no fault of a given schedule may begin later.
    `parallel` is that of `Fleet`.

    Values in `info` are arrays, lanes first, or dictionaries of them, each with its mask ``_name``
    as in Gymnasium.

    A `Recursive` diagnoser takes all lanes at once. Of any other there is one for each lane, which
    takes longer.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = MAX_DECISIONS,
        diagnoser: Any = "filter_bank",
        amplitude: float | None = None,
        budget: float | None = None,
        cost_weight: float | None = None,
        declare: float = DECLARATION_PROBABILITY,
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
        preset: str | Vehicle | Mapping = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        parallel: bool | None = None,
        realism: float = 0.0,
        imperfections: Sequence[str] | None = None,
        schedules: ScheduleDistribution | Mapping | None = None,
        missions: MissionDistribution | Mapping | None = None,
        truth: str | bool = "label",
        reward: Reward | str | None = None,
        thrust_shift: bool = False,
    ):
        self.fleet = Fleet(
            num_envs,
            vehicle_of_argument(preset),
            sensor_noise,
            disturbance,
            healthy_band,
            parallel,
            SCHEDULES,
            ActiveMissions(),
            realism,
            imperfections,
        )
        self.set_distributions(schedules, missions)
        super().__init__(self.fleet.n_lanes, max_episode_steps, DECISION_TIME, autoreset_mode)
        vehicle = self.fleet.vehicle
        self._scale = vehicle.maximum_speed / MAXIMUM_COMMAND
        self.amplitude = self._speed("amplitude", amplitude, LARGEST_OFFSET)
        self.budget = self._speed("budget", budget, BUDGET)
        self._reward = known_reward(reward)
        self.cost_weight = self._known_cost_weight(cost_weight)
        self._truth_level = known_level(truth)
        diagnosers = lane_diagnosers(diagnoser, vehicle, self.num_envs)
        self._beliefs = beliefs_of(diagnosers)
        self._estimates = ParameterEstimates(vehicle)
        self.classes = classes()
        n_shifts = len(actions_of(vehicle, thrust_shift)) - len(ACTIONS)
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (1 + n_shifts,), np.float32)
        low, high = feature_bounds(len(self.classes))
        self.single_observation_space = gym.spaces.Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._declaration = Declaration(self.num_envs, declare)
        self._true_classes = TrueClasses(self.fleet, min(self.max_episode_steps, MAX_DECISIONS))
        self._readings = np.zeros(0, np.float32)
        self._n_decisions = np.zeros(self.num_envs, np.int64)
        self._last_action = np.zeros(self.num_envs)
        self._shift = np.zeros((self.num_envs, n_shifts))
        self._total_cost = np.zeros(self.num_envs)
        # of the last decision
        self._cost = np.zeros(self.num_envs)
        self._energy = np.zeros(self.num_envs)
        self._deviation = np.zeros(self.num_envs)

    def _speed(self, name: str, value: float | None, usual: float) -> float:
        """A speed [m/s] up to that of the vehicle; by default as for the usual vehicle."""
        if value is None:
            return usual * self._scale
        return finite_in_range(name, value, 0.001, self.fleet.vehicle.maximum_speed)

    def _known_cost_weight(self, weight: float | None) -> float:
        if weight is None:
            return COST_WEIGHT / self._scale**2
        if self._reward is not None:
            remedy = "charge for the deviation in the reward"
            raise refusal("cost_weight", weight, "None beside a reward of your own", remedy)
        return finite_in_range("cost_weight", weight, 0.0, 1e6)

    @property
    def belief(self) -> Belief:
        """The present belief, (n_lanes, n_classes), with classes in the order of `classes`."""
        return self._beliefs.belief

    def _start(
        self,
        lanes: np.ndarray,
        seeds: list[int] | None = None,
        schedules: list[Schedule] | None = None,
        missions: list[Mission] | None = None,
    ) -> None:
        self._check_catalogue()
        is_some = len(lanes) < self.num_envs
        self._readings = self.fleet.reset(
            seeds,
            lanes if is_some else None,
            schedules,
            missions,
            self.fleet.observations if is_some else None,
        )
        readings = self._readings.astype(np.float64)
        self._beliefs.reset(lanes, readings)
        self._estimates.reset(lanes, readings)
        self._declaration.reset(lanes)
        self._true_classes.begin(lanes)
        of_episode = (self._n_decisions, self._last_action, self._total_cost)
        for values in (*of_episode, self._cost, self._energy, self._deviation):
            values[lanes] = 0

    def _check_catalogue(self):
        """Refuse a catalogue with other classes: the space of the observations cannot change."""
        if self.classes != classes():
            got = "other classes than when the environment was made"
            allowed = f"the same {len(self.classes)}"
            raise refusal("catalogue", got, allowed, "make the environment anew")

    def _advance(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Hold the actions (num_envs, 1 or 2) for a second."""
        actions = checked_action(actions, self.action_space.shape)
        self._last_action = actions[:, 0]
        self._shift = LARGEST_SHIFT * actions[:, 1:]
        belief_before = self.belief
        true_class_before = self._true_classes.after(self._n_decisions)
        self._run_decision()
        self._n_decisions += 1
        self._total_cost += self._cost
        decision = Decision(
            action=self._last_action.copy(),
            time=self._n_decisions * DECISION_TIME,
            belief_before=belief_before,
            belief=self.belief,
            true_class_before=true_class_before,
            true_class=self._true_classes.after(self._n_decisions),
            declared_class=self._declaration.declared.copy(),
            cost=self._cost.copy(),
            deviation=self._deviation.copy(),
            energy=self._energy.copy(),
            shift=self._shift.sum(axis=1),
        )
        terminated = self._declaration.declared != UNDECLARED
        truncated = self._n_decisions >= self.max_episode_steps
        return self._rewards(decision), terminated, truncated

    def _rewards(self, decision: Decision) -> np.ndarray:
        if self._reward is None:
            return log_probability_gain(decision) - self.cost_weight * decision.deviation
        return checked_reward(self._reward(decision), self.num_envs)

    def _run_decision(self) -> None:
        """Run a second: mean squared offset, energy [J] and mean squared deviation of it."""
        for values in (self._cost, self._energy, self._deviation):
            values[:] = 0.0
        command = np.hstack([np.zeros((self.num_envs, len(ACTIONS))), self._shift])
        for _ in range(DECISION):
            mission_speed = self._readings[:, MISSION_SPEED].astype(np.float64)
            speed_command = mission_speed + self.amplitude * self._last_action
            largest = self.fleet.vehicle.maximum_speed
            command[:, 0] = np.clip(speed_command, 0.0, largest)
            self._readings = self.fleet.advance(command)
            readings = self._readings.astype(np.float64)
            self._beliefs.update(readings)
            self._estimates.update(readings)
            self._declaration.update(self.belief.log_probability)
            _, energy, deviation, _ = self.fleet.outcomes
            self._cost += np.square(command[:, 0] - mission_speed) / DECISION
            self._energy += energy
            self._deviation += deviation / DECISION

    def _observe(self) -> np.ndarray:
        """The features, speeds relative to the vehicle's largest speed."""
        allowance = self.budget**2 * EPISODE_TIME - self._total_cost * DECISION_TIME
        return policy_features(
            self.belief,
            self._estimates.estimate,
            self._readings / np.float32(self._scale),
            self._last_action,
            self._n_decisions * DECISION_TIME,
            np.maximum(allowance, 0.0) / self._scale**2,
            self.budget / self._scale,
        )

    def _information(self) -> dict[str, Any]:
        return {
            "mission_speed": self._readings[:, MISSION_SPEED].astype(np.float64),
            "energy": self._energy.copy(),
            "cost": self._cost.copy(),
            "declared_class": self._declaration.declared.copy(),
            "belief": np.exp(self.belief.log_probability),
            "severity_mean": self.belief.severity_mean.copy(),
            "severity_std": self.belief.severity_std.copy(),
        } | fleet_truth(self.fleet, self._truth_level)

    def _true_spec(self, spec: EnvSpec) -> EnvSpec:
        return with_plain_arguments(super()._true_spec(spec))

    def close_extras(self, **kwargs):
        """End the threads of the fleet."""
        self.fleet.close()


def lane_info(info: dict[str, Any], lane: int) -> dict[str, Any]:
    """One lane of a vector environment's information."""
    return {
        name: lane_info(entry, lane) if isinstance(entry, dict) else entry[lane]
        for name, entry in info.items()
        if not name.startswith("_")
    }


def checked_action(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy of the actions, clipped to [-1, 1]; refused if not finite or of this shape."""
    return np.clip(checked_actions(actions, shape, ELEMENTS[: shape[-1]]), -1.0, 1.0)
