"""Resets of a vector environment over one fleet: seeds, options, some lanes, and ended lanes."""

import dataclasses
import numbers
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from auv_fault_env.env.interface import (
    WithFleet,
    checked_schedule,
    known_options,
    masked,
    need_reset,
)
from auv_fault_env.env.spec import WithSpec
from auv_fault_env.errors import known_name, one_per_lane, refusal, whole_number
from auv_fault_env.missions import Mission, mission_of
from auv_fault_env.schedules import Schedule

MODES = {mode.value: mode for mode in AutoresetMode}
OPTIONS = ("schedule", "mission", "schedules", "missions", "reset_mask")


class AutoresetVectorEnv(WithFleet, WithSpec, gym.vector.VectorEnv):
    """The resets of a vector environment, of which a subclass defines the four steps below.

    Lane k of ``reset(seed=s)`` has the seed s + k. `reset(options=...)` takes `schedule` and
    `mission` for all lanes, or `schedules` and `missions` with one per lane; they hold for the
    episode that this reset starts, and the episodes after it are sampled again.
    ``options["reset_mask"]``, a bool array (num_envs,), resets its lanes only.

    What happens to a lane that ends depends on the mode, as in `gymnasium.vector`:

    * ``"NextStep"``: the next step ignores its action and starts its next episode.
    * ``"SameStep"``: its next episode starts within the same step; ``info["final_obs"]`` and
      ``info["final_info"]`` have its last observation and information, on the lanes that
      ``info["_final_obs"]`` marks.
    * ``"Disabled"``: the caller resets it with a `reset_mask`; a step before that is refused.
    """

    def __init__(
        self,
        num_envs: int,
        max_episode_steps: int,
        sample_time: float,
        autoreset_mode: str | AutoresetMode,
    ):
        self.num_envs = num_envs
        self.max_episode_steps = whole_number("max_episode_steps", max_episode_steps)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        self.autoreset_mode = MODES[known_name("autoreset_mode", mode, MODES)]
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self._end = self.max_episode_steps * sample_time
        self._done: np.ndarray | None = None

    @abstractmethod
    def _start(
        self,
        lanes: np.ndarray,
        seeds: list[int] | None = None,
        schedules: list[Schedule] | None = None,
        missions: list[Mission] | None = None,
    ) -> None:
        """Start episodes on these lanes (m,), with one seed, schedule and mission each."""

    @abstractmethod
    def _advance(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Take the actions: new arrays of reward, terminated and truncated, (num_envs,) each."""

    @abstractmethod
    def _observe(self) -> np.ndarray:
        """A new array of observations (num_envs, n)."""

    @abstractmethod
    def _information(self) -> dict[str, Any]:
        """New arrays (num_envs,), or dictionaries of them."""

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ):
        """Start an episode on every lane, or on those of a `reset_mask`."""
        options = known_options(options, OPTIONS)
        mask = self._reset_mask(options.get("reset_mask"))
        schedules = self._per_lane(options, "schedule", partial(checked_schedule, end=self._end))
        missions = self._per_lane(options, "mission", mission_of)
        if isinstance(seed, numbers.Integral):
            seed = whole_number("seed", seed, 0)
        super().reset(seed=seed if isinstance(seed, int) else None)
        lanes = np.flatnonzero(mask)
        plan = self._seeds(seed), schedules, missions
        of_lanes = [None if values is None else [values[k] for k in lanes] for values in plan]
        self._start(lanes, *of_lanes)
        is_done = np.zeros(self.num_envs, bool) if self._done is None else self._done
        self._done = is_done & ~mask
        return self._observe(), masked(self._information(), mask)

    def step(self, actions):
        """Take the actions (num_envs, n); lanes that end are reset as the mode says."""
        need_reset(self._done is not None, "step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            self._refuse_ended()
        reward, terminated, truncated = self._advance(actions)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._done.any():
            for result in (reward, terminated, truncated):
                result[self._done] = 0
            self._start(np.flatnonzero(self._done))
        self._done = terminated | truncated
        observation = self._observe()
        info = masked(self._information(), np.ones(self.num_envs, bool))
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            final = self._final(observation)
            self._start(np.flatnonzero(self._done))
            observation = self._observe()
            info = masked(self._information(), np.ones(self.num_envs, bool)) | final
        return observation, reward, terminated, truncated, info

    def _final(self, observation: np.ndarray) -> dict[str, Any]:
        """The last observations and information of the lanes that have ended."""
        ended = self._done.copy()
        final_observation = np.full(self.num_envs, None)
        for lane in np.flatnonzero(ended):
            final_observation[lane] = observation[lane]
        final = {"final_obs": final_observation, "final_info": self._information()}
        return masked(final, ended)

    def _refuse_ended(self):
        lanes = np.flatnonzero(self._done).tolist()
        remedy = "call reset(options={'reset_mask': terminated | truncated})"
        message = f"step: got ended episodes on lanes {lanes}; allowed is none; {remedy}"
        raise gym.error.ResetNeeded(message)

    def _true_spec(self, spec: EnvSpec) -> EnvSpec:
        spec = super()._true_spec(spec)
        return dataclasses.replace(spec, max_episode_steps=self.max_episode_steps)

    def _reset_mask(self, mask: Any) -> np.ndarray:
        """The lanes to reset as a mask (num_envs,); all without one."""
        if mask is None:
            return np.ones(self.num_envs, bool)
        is_mask = isinstance(mask, np.ndarray) and mask.dtype == bool
        if not is_mask or mask.shape != (self.num_envs,) or not mask.any():
            allowed = f"a bool array ({self.num_envs},) with a True"
            raise refusal("reset_mask", mask, allowed, "mark the lanes to reset")
        if self._done is None and not mask.all():
            raise refusal("reset_mask", mask, "all lanes at first", "reset without it first")
        return mask

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int] | None:
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
