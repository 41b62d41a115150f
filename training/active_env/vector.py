"""The active environment for many vehicles at once: a fleet of them, and one diagnoser that watches all."""

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.env import PropulsionVectorEnv
from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from auv_fault_env.missions import MissionSampler
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import Events, ScheduleSampler
from auv_fault_env.truth import FleetTruth
from diagnosers import Recursive, make
from training.active_env.watch import Watch
from training.rollouts import label_and_severity
from training.stimuli.base import BUDGET, EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.declaration import DECLARE, NONE, Declaration
from training.stimuli.policy_inputs import FLOOR, HIGH, LOW, MISSION_SPEED, features

DECISION = round(SAMPLE_RATE)  # samples of a decision, one second
MAX_DECISIONS = 120  # decisions of an episode at most
SCHEDULES = ScheduleSampler(healthy=0.3, onset=(5.0, 40.0))
CONSTANT_SPEEDS = (0.2, 0.5)  # [m/s]
MODES = {mode.value: mode for mode in (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP)}


class Missions(MissionSampler):
    """Half of the missions keep one speed of `CONSTANT_SPEEDS`, the others change it leg by leg."""

    def sample_legs(self, key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Legs (n_lanes, n_legs, 2) and start speeds (n_lanes,) for lanes with the given noise keys (n_lanes,)."""
        legs, start_speed = super().sample_legs(key)
        chance, place = uniforms(key, STREAMS["constant_speed"], 2).T
        speed = CONSTANT_SPEEDS[0] + (CONSTANT_SPEEDS[1] - CONSTANT_SPEEDS[0]) * place
        legs[:, :, 1] = np.where(chance[:, None] < 0.5, speed[:, None], legs[:, :, 1])
        return legs, np.where(chance < 0.5, speed, start_speed)


class ActiveDiagnosisVectorEnv(gym.vector.VectorEnv):
    """`ActiveDiagnosisEnv` for many vehicles at once, with one diagnoser over all: see there for all but what follows.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, and its next episodes are
    that one's next. A lane that ends starts its next episode within the same step
    (`AutoresetMode.SAME_STEP`): its observation and information are those of the start;
    ``info["final_obs"]`` and ``info["final_info"]`` hold those of the end, on the lanes that
    ``info["_final_info"]`` marks. With ``autoreset_mode="NextStep"`` it starts on the next step,
    whose action it ignores. Values in `info` are arrays (num_envs,); `truth` is a mapping of
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
        declare: float = DECLARE,
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
    ):
        self.max_episode_steps = whole_number("max_episode_steps", max_episode_steps)
        self.propulsion = PropulsionVectorEnv(num_envs, self.max_episode_steps * DECISION)
        self.num_envs = self.propulsion.num_envs
        self.fleet = self.propulsion.fleet
        self.fleet.schedules = SCHEDULES
        self.fleet.missions = Missions()
        self.amplitude = finite_in_range("amplitude", amplitude, 0.01, MAXIMUM_COMMAND)
        self.budget = finite_in_range("budget", budget, 0.001, MAXIMUM_COMMAND)
        self.cost_weight = finite_in_range("cost_weight", cost_weight, 0.0, 1e6)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        self.metadata = self.metadata | {
            "autoreset_mode": MODES[known_name("autoreset_mode", mode, MODES)]
        }
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.single_observation_space = gym.spaces.Box(LOW, HIGH, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        diagnoser = make(diagnoser) if isinstance(diagnoser, str) else diagnoser
        self._watch, self._declaration = Watch(diagnoser), Declaration(self.num_envs, declare)
        self._classes = np.array(diagnoser.classes)
        self._allocate(self.num_envs)

    def _allocate(self, n: int):
        self._lanes = np.arange(n)
        self._readings = None
        # class that is true after each decision
        self._label = np.zeros((self.max_episode_steps + 1, n), np.int64)
        self._steps = np.zeros(n, np.int64)
        self._done = np.zeros(n, bool)
        self._action = np.zeros(n)  # the last one
        self._spent = np.zeros(n)  # sum of the costs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ):
        """Start an episode on every lane."""
        super().reset(seed=seed if isinstance(seed, int) else None)
        self._readings, _ = self.propulsion.reset(seed=seed, options=options)
        self._begin(self._lanes)
        self._done[:] = False
        return self._features(), self._info(np.zeros((2, self.num_envs)))

    def step(self, actions):
        """Hold the actions (num_envs, 1) for a second; lanes that have ended start their next episode."""
        if self._readings is None:
            raise gym.error.ResetNeeded(
                "step: got no reset before; allowed is a step after a reset; call reset()"
            )
        self._action, before = _checked(actions, (self.num_envs, 1))[:, 0], self._score()
        cost, energy, deviation = self._drive()
        self._steps += 1
        self._spent += cost
        reward = self._score() - before - self.cost_weight * deviation
        ends = np.stack([self._declaration.declared != NONE, self._steps >= self.max_episode_steps])
        if self.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP:
            for values in (reward, cost, energy, *ends):
                values[self._done] = 0
            self._restart(self._done)
        self._done = ends.any(axis=0)
        observation = self._features()
        info = self._info(np.stack([cost, energy]))
        if self._done.any() and self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP:
            observation, info = self._renewed(observation, info)
        return observation, reward, *ends, info

    def _drive(self) -> np.ndarray:
        """Run a second; mean squared command offset, energy [J], mean squared true deviation, (3, n_lanes)."""
        sums = np.zeros((3, self.num_envs))
        command = np.zeros((self.num_envs, 3))
        for _ in range(DECISION):
            mission = self._readings[:, MISSION_SPEED].astype(np.float64)
            command[:, 0] = np.clip(mission + self.amplitude * self._action, 0.0, MAXIMUM_COMMAND)
            self._readings = self.fleet.advance(command)
            self._watch.update(self._readings)
            self._declaration.note(self._watch.belief.log_probability)
            _, energy, deviation, _ = self.fleet.outcomes
            sums += np.square(command[:, 0] - mission) / DECISION, energy, deviation / DECISION
        return sums

    def _score(self) -> np.ndarray:
        """Log probability of what is true, not below `FLOOR`, (n_lanes,)."""
        true = self._label[self._steps.clip(max=self.max_episode_steps), self._lanes]
        return np.maximum(self._watch.belief.log_probability[self._lanes, true], FLOOR)

    def _begin(self, lanes: np.ndarray):
        """Start counting, watching and telling the truth anew on these lanes, whose first readings are there."""
        self._watch.begin(lanes, self._readings)
        self._declaration.begin(lanes)
        events = Events(self.fleet.plan.fault[lanes], self.fleet.plan.profile[lanes])
        self._label[:, lanes] = label_and_severity(events, self.max_episode_steps * DECISION + 1)[
            0
        ][::DECISION]
        for values in (self._steps, self._action, self._spent):
            values[lanes] = 0

    def _restart(self, ended: np.ndarray):
        lanes = np.flatnonzero(ended)
        if lanes.size:
            self.fleet.reset(lanes=lanes, observations=self._readings)
            self._begin(lanes)

    def _renewed(
        self, observation: np.ndarray, info: dict[str, Any]
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Observation and information after the lanes that have ended are restarted, those of the end beside them."""
        ended = self._done.copy()
        last = np.full(self.num_envs, None)
        for lane in np.flatnonzero(ended):
            last[lane] = observation[lane]
        final = info | {"truth": dict(info["truth"])} | {f"_{name}": ended for name in info}
        self._restart(ended)
        info = self._info(np.where(ended, 0.0, np.stack([info["cost"], info["energy"]])))
        ending = {"final_obs": last, "_final_obs": ended, "final_info": final, "_final_info": ended}
        return self._features(), info | ending

    def _features(self) -> np.ndarray:
        time = self._steps * (DECISION * SAMPLE_TIME)
        left = np.maximum(
            self.budget**2 * EPISODE_TIME - self._spent * (DECISION * SAMPLE_TIME), 0.0
        )
        return features(
            self._watch.belief, self._watch.estimate, self._readings, self._action, time, left
        )

    def _info(self, paid: np.ndarray) -> dict[str, Any]:
        """Information of the last second; paid (2, n_lanes): cost and energy."""
        return {
            "mission_speed": self._readings[:, MISSION_SPEED].astype(np.float64),
            "energy": paid[1],
            "cost": paid[0],
            "declared": self._classes[self._declaration.declared],
            "truth": FleetTruth(self.fleet),
        }

    def close_extras(self, **kwargs):
        """End the fleet's threads."""
        self.propulsion.close()


def lane_info(info: dict[str, Any], lane: int) -> dict[str, Any]:
    """One lane of a vector environment's information as plain numbers and words, `truth` in full."""
    return {
        name: lane_info(values, lane) if hasattr(values, "keys") else values[lane].item()
        for name, values in info.items()
        if not name.startswith(("_", "final_"))
    }


def _checked(actions, shape: tuple[int, ...]) -> np.ndarray:
    """The actions as float64 of their own in [-1, 1], if they are finite numbers of that shape, else a refusal."""
    try:
        actions = np.array(actions, np.float64)
    except (TypeError, ValueError):
        raise refusal(
            "action", actions, f"numbers of shape {shape}", "give the speed offset"
        ) from None
    if actions.shape != shape:
        raise refusal(
            "shape of the action", actions.shape, shape, "give the speed offset, one per lane"
        )
    if not np.isfinite(actions).all():
        raise refusal("action", actions.tolist(), "finite numbers", "check the policy")
    return np.clip(actions, -1.0, 1.0)
