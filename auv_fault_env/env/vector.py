"""The environment of many vehicles at once."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.actions import checked_actions
from auv_fault_env.channels import CHANNELS
from auv_fault_env.env.actions import KINDS, action_space, commands
from auv_fault_env.env.autoreset import AutoresetVectorEnv
from auv_fault_env.env.interface import (
    box,
    need_reset,
    outcome_info,
    vehicle_of_argument,
)
from auv_fault_env.env.recording import METADATA, Recording, known_render_mode
from auv_fault_env.env.rewards import RewardWeights, rewards
from auv_fault_env.errors import known_name
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, MissionDistribution
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.schedules import Schedule, ScheduleDistribution
from auv_fault_env.truth import fleet_truth, known_level


class PropulsionVectorEnv(AutoresetVectorEnv):
    """`PropulsionEnv` for many vehicles at once, with the same spaces, rewards and information.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, bit for bit, and so are
    its next episodes. `max_episode_steps` truncates, and no fault of a given schedule may begin
    later. `autoreset_mode` says what happens to a lane that ends, see `AutoresetVectorEnv`.
    `parallel` is that of `Fleet`. The other arguments are those of `PropulsionEnv`; `render`
    gives a frame of each lane, and in mode ``"human"`` the window shows the first.

    Values in `info` are arrays (num_envs,) or dictionaries of them, each with its mask ``_name`` as
    in Gymnasium. ``truth="full"`` costs more time than a step: `auv_fault_env.truth.FleetTruth` of
    `fleet` computes what is read of it only.
    """

    metadata = METADATA | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = 600,
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
        action: str = "command",
        reward_weights: Mapping[str, float] | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        thrust_shift: bool = False,
    ):
        self.fleet = Fleet(
            num_envs,
            vehicle_of_argument(preset),
            sensor_noise,
            disturbance,
            healthy_band,
            parallel,
            realism=realism,
            imperfections=imperfections,
        )
        self.set_distributions(schedules, missions)
        super().__init__(self.fleet.n_lanes, max_episode_steps, SAMPLE_TIME, autoreset_mode)
        self.render_mode = known_render_mode(render_mode)
        self.single_action_space = action_space(action, self.fleet.vehicle, thrust_shift)
        self.single_observation_space = box(tuple(CHANNELS), self.fleet.vehicle)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._action_kind = known_name("action", action, KINDS)
        self._weights = RewardWeights.of(reward_weights)
        self._truth_level = known_level(truth)
        self._observations = np.empty(self.observation_space.shape, np.float32)
        n_recorded = {None: 0, "rgb_array": self.num_envs, "human": 1}[render_mode]
        lanes = range(n_recorded)
        self._recordings = [Recording(render_mode, self.fleet, lane) for lane in lanes]

    def _start(
        self,
        lanes: np.ndarray,
        seeds: list[int] | None = None,
        schedules: list[Schedule] | None = None,
        missions: list[Mission] | None = None,
    ) -> None:
        is_some = len(lanes) < self.num_envs
        self._observations = self.fleet.reset(
            seeds,
            lanes if is_some else None,
            schedules,
            missions,
            self.fleet.observations if is_some else None,
        )
        for lane in lanes[lanes < len(self._recordings)]:
            self._recordings[lane].clear()

    def _advance(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        actions = checked_actions(actions, self.action_space.shape)
        self._observations = self.fleet.advance(commands(self._action_kind, self.fleet, actions))
        terminated = np.zeros(self.num_envs, bool)
        truncated = self.fleet.state.step >= self.max_episode_steps
        return rewards(self._weights, self.fleet), terminated, truncated

    def _observe(self) -> np.ndarray:
        for lane, recording in enumerate(self._recordings):
            recording.record(self._observations[lane])
        return self._observations

    def _information(self) -> dict[str, Any]:
        return outcome_info(self.fleet.outcomes) | fleet_truth(self.fleet, self._truth_level)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A frame (height, width, 3) uint8 of each lane in mode `rgb_array`."""
        need_reset(self._done is not None, "render")
        if self.render_mode != "rgb_array":
            return None
        return tuple(recording.frame() for recording in self._recordings)

    def close_extras(self, **kwargs):
        """End the fleet's threads, and close the window, if there is one."""
        self.fleet.close()
        for recording in self._recordings:
            recording.close()
