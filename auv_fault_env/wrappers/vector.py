"""Faults on a vector environment."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from auv_fault_env.env.interface import masked
from auv_fault_env.errors import one_per_lane, refusal
from auv_fault_env.schedules import Event, Schedule, ScheduleSampler
from auv_fault_env.truth import known_level
from auv_fault_env.wrappers.injection import Injection, schedule_of_faults
from auv_fault_env.wrappers.options import inner_options, need_no_other_truth
from auv_fault_env.wrappers.signal_faults import SignalFault


class FaultInjectionVector(VectorWrapper, gym.utils.RecordConstructorArgs):
    """`FaultInjection` for a vector environment, with the same arguments.

    Lane k of ``reset(seed=s)`` has the faults of the single environment with seed s + k, bit for
    bit, and so have its next episodes. Its clock starts again with its episode, in every autoreset
    mode: the environment's ``metadata["autoreset_mode"]`` must say which. In mode ``"SameStep"``
    ``final_obs`` and ``final_info`` are those of the episode that has ended, faults included.

    ``reset(options=...)`` takes `schedule` for all lanes, or `schedules` with one per lane; with a
    `reset_mask` they are for the lanes that it resets.
    """

    def __init__(
        self,
        env: VectorEnv,
        faults: Mapping[str, SignalFault | Mapping],
        schedules: Sequence[Event | Mapping] | str | Path | Mapping | ScheduleSampler = (),
        sample_time: float = 1.0,
        truth: str | bool = "label",
    ):
        VectorWrapper.__init__(self, env)
        self._mode = env.metadata.get("autoreset_mode")
        if not isinstance(self._mode, AutoresetMode):
            remedy = "let the environment's metadata tell it"
            raise refusal("autoreset_mode", self._mode, "one of AutoresetMode", remedy)
        self._injection = Injection(
            env.num_envs,
            faults,
            env.single_observation_space,
            env.single_action_space,
            schedules,
            sample_time,
        )
        self._level = known_level(truth)
        plain = self._injection.plain()
        gym.utils.RecordConstructorArgs.__init__(self, truth=truth, **plain)
        self._done = np.zeros(env.num_envs, bool)

    @property
    def classes(self) -> tuple[str, ...]:
        """``"normal"`` and the names of the faults."""
        return self._injection.classes

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ):
        """Start an episode on every lane, or on those of a `reset_mask`."""
        given, options = inner_options(options, ("schedule", "schedules"))
        schedules = self._schedules(given)
        mask = np.ones(self.num_envs, bool)
        if options and options.get("reset_mask") is not None:
            mask = np.array(options["reset_mask"])
        observations, infos = self.env.reset(seed=seed, options=options)
        need_no_other_truth(infos)
        seeds = self._seeds(seed)
        lanes = np.flatnonzero(mask)
        of_lanes = schedules and [schedules[lane] for lane in lanes]
        self._injection.start(lanes, [seeds[lane] for lane in lanes], of_lanes)
        self._done[mask] = False
        return self._injection.observed(observations), infos | self._information(mask)

    def step(self, actions):
        """Take the actions as they arrive; lanes that end are reset as the environment does it."""
        actions = self._injection.acted(actions)
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        self._injection.advance()
        if self._mode is AutoresetMode.NEXT_STEP:
            self._start(self._done)
        self._done = terminated | truncated
        if self._mode is AutoresetMode.SAME_STEP and self._done.any():
            infos = infos | self._final(observations, infos)
            self._start(self._done)
        observations = self._injection.observed(observations)
        infos = infos | self._information(np.ones(self.num_envs, bool))
        return observations, rewards, terminated, truncated, infos

    def _start(self, is_started: np.ndarray) -> None:
        """Start the next episodes of the lanes of a mask (num_envs,)."""
        if is_started.any():
            lanes = np.flatnonzero(is_started)
            self._injection.start(lanes, [None] * len(lanes))

    def _final(self, observations: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """The last observations and information of the lanes that have ended."""
        lanes = np.flatnonzero(self._done)
        last = np.array(observations)
        final = infos["final_obs"].copy()
        for lane in lanes:
            last[lane] = final[lane]
        last = self._injection.observed(last)
        for lane in lanes:
            final[lane] = last[lane]
        final_info = infos.get("final_info", {}) | self._information(self._done.copy())
        return {"final_obs": final, "final_info": final_info}

    def _information(self, mask: np.ndarray) -> dict[str, Any]:
        return masked(self._injection.truth(self._level), mask)

    def _schedules(self, given: dict[str, Any]) -> list[Schedule] | None:
        """The schedules of all lanes, from the options `schedule` or `schedules`."""
        if len(given) == 2:
            allowed = "either schedule or schedules"
            raise refusal("reset option", list(given), allowed, "leave one out")
        convert = partial(schedule_of_faults, faults=self._injection.faults)
        if "schedule" in given:
            return [convert(given["schedule"])] * self.num_envs
        if "schedules" in given:
            remedy = "or give one 'schedule'"
            return list(
                map(convert, one_per_lane("schedules", given["schedules"], self.num_envs, remedy))
            )
        return None

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        """One seed per lane, None for the next episode."""
        seeds = seed
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, int):
            seeds = [seed + lane for lane in range(self.num_envs)]
        if self._injection.changes:
            return seeds
        drawn = self.env.np_random_seed
        if isinstance(drawn, int):
            drawn = [drawn + lane for lane in range(self.num_envs)]
        return [other if own is None else own for own, other in zip(seeds, drawn, strict=True)]
