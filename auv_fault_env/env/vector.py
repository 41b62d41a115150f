"""The environment of many vehicles at once."""

import numbers
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.channels import CHANNELS
from auv_fault_env.env.interface import (
    box,
    checked_schedule,
    known_options,
    masked,
    need_reset,
    outcome_info,
)
from auv_fault_env.errors import one_per_lane, refusal, whole_number
from auv_fault_env.fleet import ACTIONS, Fleet
from auv_fault_env.missions import Mission, mission_of
from auv_fault_env.parameters import SAMPLE_RATE, Vehicle
from auv_fault_env.schedules import Schedule
from auv_fault_env.truth import fleet_truth, known_level


class PropulsionVectorEnv(gym.vector.VectorEnv):
    """`PropulsionEnv` for many vehicles at once, with the same spaces, rewards and information.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, bit for bit. A finished
    lane resets itself on the next step, whose action it ignores (`AutoresetMode.NEXT_STEP`). Values
    in `info` are arrays (num_envs,) or dictionaries of them, each with its mask ``_name`` as in
    Gymnasium. ``truth="full"`` costs more time than a step: `auv_fault_env.truth.FleetTruth` of
    `fleet` computes what is read of it only.
    `reset(options=...)` takes `schedule` and `mission` for all lanes, or `schedules` and `missions`
    with one per lane.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = 600,
        preset: str | Vehicle = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        parallel: bool | None = None,
        realism: float = 0.0,
        imperfections: Sequence[str] | None = None,
        truth: str | bool = "label",
    ):
        self.fleet = Fleet(
            num_envs,
            preset,
            sensor_noise,
            disturbance,
            healthy_band,
            parallel,
            realism=realism,
            imperfections=imperfections,
        )
        self.num_envs = self.fleet.n_lanes
        self.max_episode_steps = whole_number("max_episode_steps", max_episode_steps)
        self.single_action_space = box(ACTIONS, self.fleet.vehicle)
        self.single_observation_space = box(tuple(CHANNELS), self.fleet.vehicle)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._truth_level = known_level(truth)
        self._terminated = np.zeros(self.num_envs, bool)
        self._done: np.ndarray | None = None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ):
        """Start an episode on every lane."""
        options = known_options(options, ("schedule", "mission", "schedules", "missions"))
        end = self.max_episode_steps / SAMPLE_RATE
        schedules = self._per_lane(options, "schedule", partial(checked_schedule, end=end))
        missions = self._per_lane(options, "mission", mission_of)
        if isinstance(seed, numbers.Integral):
            seed = whole_number("seed", seed, 0)
        super().reset(seed=seed if isinstance(seed, int) else None)
        observations = self.fleet.reset(self._seeds(seed), schedules=schedules, missions=missions)
        self._done = np.zeros(self.num_envs, bool)
        return observations, self._info()

    def step(self, actions):
        """Apply the actions (num_envs, 3) for 0.1 s; finished lanes start their next episode."""
        need_reset(self._done is not None)
        observations = self.fleet.step(actions)
        if self._done.any():
            self.fleet.reset(lanes=np.flatnonzero(self._done), observations=observations)
        self._done = self.fleet.time * SAMPLE_RATE >= self.max_episode_steps
        reward = self.fleet.outcomes[0]
        return (
            observations,
            reward,
            self._terminated.copy(),
            self._done.copy(),
            self._info(),
        )

    def close_extras(self, **kwargs):
        """End the fleet's threads."""
        self.fleet.close()

    def _info(self) -> dict[str, Any]:
        info = outcome_info(self.fleet.outcomes) | fleet_truth(self.fleet, self._truth_level)
        return masked(info, np.ones(self.num_envs, bool))

    def _seeds(self, seed) -> list[int] | None:
        """One seed per lane; None to go on with the next episodes."""
        if seed is None and self._done is not None:
            return None
        if seed is None or isinstance(seed, int):
            first = self.np_random_seed if seed is None else seed
            return [first + lane for lane in range(self.num_envs)]
        seeds = one_per_lane("seeds", seed, self.num_envs, "give one int for all")
        return [self.np_random.integers(2**63) if seed is None else seed for seed in seeds]

    def _per_lane(
        self, options: dict[str, Any], name: str, convert: Callable[[Any], Any]
    ) -> list[Schedule | Mission] | None:
        """The schedules or missions of all lanes, from the option `name` or from its plural."""
        plural = f"{name}s"
        for_all = options.get(name)
        for_each = options.get(plural)
        if for_all is not None and for_each is not None:
            allowed = f"either {name} or {plural}"
            raise refusal("reset option", [name, plural], allowed, "leave one out")
        if for_all is not None:
            return [convert(for_all)] * self.num_envs
        if for_each is None:
            return None
        for_each = one_per_lane(plural, for_each, self.num_envs, f"or give one {name!r}")
        return [convert(value) for value in for_each]
