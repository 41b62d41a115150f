"""The active environment for many vehicles: one fleet, and one diagnoser over all lanes."""

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.env import PropulsionVectorEnv
from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from auv_fault_env.faults import classes
from auv_fault_env.missions import MissionSampler
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import Events, ScheduleSampler
from auv_fault_env.truth import FleetTruth
from diagnosers import Recursive, make
from training.active_env.lane_monitor import LaneMonitor
from training.metrics.declaration import DECLARATION_PROBABILITY
from training.rollouts import label_and_severity
from training.stimuli.base import BUDGET, EPISODE_TIME, LARGEST_OFFSET, MISSION_SPEED
from training.stimuli.declaration import UNDECLARED, Declaration
from training.stimuli.policy_inputs import FLOOR, feature_bounds, policy_features

DECISION = round(SAMPLE_RATE)  # samples of a decision, one second
DECISION_TIME = DECISION * SAMPLE_TIME  # s
MAX_DECISIONS = 120  # of an episode
SCHEDULES = ScheduleSampler(healthy=0.3, onset=(5.0, 40.0))
CONSTANT_SPEEDS = (0.2, 0.5)  # least and most, of the vehicle's largest command
AUTORESET_MODES = {mode.value: mode for mode in (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP)}


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


class ActiveDiagnosisVectorEnv(gym.vector.VectorEnv):
    """`ActiveDiagnosisEnv` for many vehicles at once; what is not said here is as there.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, and its next episodes are
    the same, too. A lane that ends starts its next episode within the same step
    (`AutoresetMode.SAME_STEP`): its observation and information are those of the start;
    ``info["final_obs"]`` and ``info["final_info"]`` hold those of the end, on the lanes that
    ``info["_final_info"]`` marks. With ``autoreset_mode="NextStep"`` it starts on the next step,
    which ignores its action. The entries of `info` are arrays (num_envs,); `truth` is a mapping of
    arrays, valid until the next step.

    `reset(options=...)` takes `schedule` and `mission` for all lanes, or `schedules` and `missions`
    with one per lane.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": [],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = MAX_DECISIONS,
        diagnoser: str | Recursive = "filter_bank",
        amplitude: float = LARGEST_OFFSET,
        budget: float = BUDGET,
        cost_weight: float = 10.0,
        declare: float = DECLARATION_PROBABILITY,
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
    ):
        self.max_episode_steps = whole_number("max_episode_steps", max_episode_steps)
        self.propulsion = PropulsionVectorEnv(num_envs, self.max_episode_steps * DECISION)
        self.num_envs = self.propulsion.num_envs
        self.fleet = self.propulsion.fleet
        self.fleet.schedules = SCHEDULES
        self.fleet.missions = ActiveMissions()
        self.amplitude = finite_in_range("amplitude", amplitude, 0.01, MAXIMUM_COMMAND)
        self.budget = finite_in_range("budget", budget, 0.001, MAXIMUM_COMMAND)
        self.cost_weight = finite_in_range("cost_weight", cost_weight, 0.0, 1e6)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        mode = AUTORESET_MODES[known_name("autoreset_mode", mode, AUTORESET_MODES)]
        self.metadata = self.metadata | {"autoreset_mode": mode}
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        diagnoser = make(diagnoser) if isinstance(diagnoser, str) else diagnoser
        self._monitor = LaneMonitor(diagnoser)
        self.classes = diagnoser.classes
        low, high = feature_bounds(len(self.classes))
        self.single_observation_space = gym.spaces.Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._catalogue_classes = classes()
        self._declaration = Declaration(self.num_envs, declare)
        self._lanes = np.arange(self.num_envs)
        self._readings: np.ndarray | None = None
        # index of the class that is true after each decision
        self._true_class = np.zeros((self.max_episode_steps + 1, self.num_envs), np.int64)
        self._n_decisions = np.zeros(self.num_envs, np.int64)
        self._done = np.zeros(self.num_envs, bool)
        self._last_action = np.zeros(self.num_envs)
        self._total_cost = np.zeros(self.num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict | None = None,
    ):
        """Start an episode on every lane."""
        self._check_catalogue()
        super().reset(seed=seed if isinstance(seed, int) else None)
        self._readings, _ = self.propulsion.reset(seed=seed, options=options)
        self._begin_episodes(self._lanes)
        self._done[:] = False
        cost, energy = np.zeros((2, self.num_envs))
        return self._features(), self._info(cost, energy)

    def _check_catalogue(self):
        """Refuse a catalogue with other classes: the space of the observations cannot change."""
        if self._catalogue_classes != classes():
            got = "other classes than when the environment was made"
            allowed = f"the same {len(self._catalogue_classes)}"
            raise refusal("catalogue", got, allowed, "make the environment anew")

    def step(self, actions):
        """Hold the actions (num_envs, 1) for a second; ended lanes start their next episode."""
        if self._readings is None:
            raise gym.error.ResetNeeded(
                "step: got no reset before; allowed is a step after a reset; call reset()"
            )
        self._last_action = _checked(actions, (self.num_envs, 1))[:, 0]
        score_before = self._score()
        cost, energy, deviation = self._run_decision()
        self._n_decisions += 1
        self._total_cost += cost
        reward = self._score() - score_before - self.cost_weight * deviation
        terminated = self._declaration.declared != UNDECLARED
        truncated = self._n_decisions >= self.max_episode_steps
        mode = self.metadata["autoreset_mode"]
        if mode is AutoresetMode.NEXT_STEP:
            for result in (reward, cost, energy, terminated, truncated):
                result[self._done] = 0
            self._restart(self._done)
        self._done = terminated | truncated
        observation = self._features()
        info = self._info(cost, energy)
        if self._done.any() and mode is AutoresetMode.SAME_STEP:
            observation, info = self._after_restart(observation, info)
        return observation, reward, terminated, truncated, info

    def _run_decision(self) -> np.ndarray:
        """Run a second: mean squared offset, energy [J], mean squared deviation, (3, n_lanes)."""
        sums = np.zeros((3, self.num_envs))
        command = np.zeros((self.num_envs, 3))
        for _ in range(DECISION):
            mission_speed = self._readings[:, MISSION_SPEED].astype(np.float64)
            speed_command = mission_speed + self.amplitude * self._last_action
            command[:, 0] = np.clip(speed_command, 0.0, MAXIMUM_COMMAND)
            self._readings = self.fleet.advance(command)
            self._monitor.update(self._readings)
            self._declaration.update(self._monitor.belief.log_probability)
            _, energy, deviation, _ = self.fleet.outcomes
            squared_offset = np.square(command[:, 0] - mission_speed)
            sums += squared_offset / DECISION, energy, deviation / DECISION
        return sums

    def _score(self) -> np.ndarray:
        """Log probability of the true class, at least `FLOOR`, (n_lanes,)."""
        decision = self._n_decisions.clip(max=self.max_episode_steps)
        true_class = self._true_class[decision, self._lanes]
        log_probability = self._monitor.belief.log_probability[self._lanes, true_class]
        return np.maximum(log_probability, FLOOR)

    def _begin_episodes(self, lanes: np.ndarray):
        """Begin the episodes of these lanes, whose first readings are there."""
        self._monitor.reset(lanes, self._readings)
        self._declaration.reset(lanes)
        plan = self.fleet.plan
        events = Events(plan.fault[lanes], plan.profile[lanes])
        label, _ = label_and_severity(events, self.max_episode_steps * DECISION + 1)
        self._true_class[:, lanes] = label[::DECISION]
        for counter in (self._n_decisions, self._last_action, self._total_cost):
            counter[lanes] = 0

    def _restart(self, ended: np.ndarray):
        """Start the next episode of the lanes that a mask (n_lanes,) marks."""
        lanes = np.flatnonzero(ended)
        if lanes.size:
            self.fleet.reset(lanes=lanes, observations=self._readings)
            self._begin_episodes(lanes)

    def _after_restart(
        self, observation: np.ndarray, info: dict[str, Any]
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Restart the ended lanes: their new observation and information, with the final ones."""
        ended = self._done.copy()
        final_observation = np.full(self.num_envs, None)
        for lane in np.flatnonzero(ended):
            final_observation[lane] = observation[lane]
        masks = {f"_{name}": ended for name in info}
        final_info = info | {"truth": dict(info["truth"])} | masks
        self._restart(ended)
        cost, energy = (np.where(ended, 0.0, info[name]) for name in ("cost", "energy"))
        info = self._info(cost, energy)
        info |= {"final_obs": final_observation, "_final_obs": ended}
        info |= {"final_info": final_info, "_final_info": ended}
        return self._features(), info

    def _features(self) -> np.ndarray:
        allowance = self.budget**2 * EPISODE_TIME - self._total_cost * DECISION_TIME
        left = np.maximum(allowance, 0.0)
        time = self._n_decisions * DECISION_TIME
        monitor = self._monitor
        return policy_features(
            monitor.belief,
            monitor.estimate,
            self._readings,
            self._last_action,
            time,
            left,
        )

    def _info(self, cost: np.ndarray, energy: np.ndarray) -> dict[str, Any]:
        """Information of the last second."""
        return {
            "mission_speed": self._readings[:, MISSION_SPEED].astype(np.float64),
            "energy": energy,
            "cost": cost,
            "declared": np.array(self.classes)[self._declaration.declared],
            "truth": FleetTruth(self.fleet),
        }

    def close_extras(self, **kwargs):
        """End the threads of the fleet."""
        self.propulsion.close()


def lane_info(info: dict[str, Any], lane: int) -> dict[str, Any]:
    """One lane of a vector environment's information as plain numbers and words."""
    plain = {}
    for name, entry in info.items():
        if name.startswith(("_", "final_")):
            continue
        plain[name] = lane_info(entry, lane) if hasattr(entry, "keys") else entry[lane].item()
    return plain


def _checked(actions, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy of the actions, clipped to [-1, 1]; refused if not finite or of this shape."""
    try:
        actions = np.array(actions, np.float64)
    except (TypeError, ValueError):
        allowed = f"numbers of shape {shape}"
        raise refusal("action", actions, allowed, "give the speed offset") from None
    if actions.shape != shape:
        remedy = "give the speed offset, one per lane"
        raise refusal("shape of the action", actions.shape, shape, remedy)
    if not np.isfinite(actions).all():
        raise refusal("action", actions.tolist(), "finite numbers", "check the policy")
    return np.clip(actions, -1.0, 1.0)
