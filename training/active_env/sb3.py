"""The active environment as a `VecEnv` of stable-baselines3: one fleet, not many environments."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvStepReturn,
)

from auv_fault_env.errors import refusal
from training.active_env.vector import ActiveDiagnosisVectorEnv

PLAIN_NAMES = (
    "mission_speed",
    "energy",
    "cost",
    "declared",
)  # information beside the truth
BY_TIME = "TimeLimit.truncated"  # stable-baselines3's name for an end by time


class ActiveVecEnv(VecEnv):
    """The interface of ``DummyVecEnv`` over single environments, at the speed of a fleet.

    A lane that ends is reset within the same step: its information has its last observation as
    `terminal_observation`, and `TimeLimit.truncated` says whether time ended it; `reset_infos` has
    the information of its new start. Seeds and options (`seed`, `set_options`) count for the next
    reset, as with any `VecEnv`. Attributes and methods are those of the one vector environment, the
    same for every index; it must reset within the same step, its default.
    """

    def __init__(self, env: ActiveDiagnosisVectorEnv):
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise refusal("autoreset_mode", mode.value, "SameStep", "leave the argument out")
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start an episode on every lane, with the current seeds and options; (n_lanes, n)."""
        seeds = None if set(self._seeds) == {None} else self._seeds
        observation, info = self.env.reset(seed=seeds, options=_joined(self._options))
        self.reset_infos = _split(info, range(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (n_lanes, 1) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Hold the actions for a second; observations, rewards (float32), ends and information."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        infos = _split(info, range(self.num_envs))
        for lane, by_time in enumerate((truncated & ~terminated).tolist()):
            infos[lane][BY_TIME] = by_time
        if done.any():
            self._end(np.flatnonzero(done).tolist(), infos, info)
        return observation, reward.astype(np.float32), done, infos

    def _end(self, lanes: list[int], infos: list[dict[str, Any]], info: Mapping[str, Any]) -> None:
        """Put the information of the end into `infos`, and that of the start into `reset_infos`."""
        for lane, final in zip(lanes, _split(info["final_info"], lanes), strict=True):
            final[BY_TIME] = infos[lane].pop(BY_TIME)
            final["terminal_observation"] = info["final_obs"][lane]
            self.reset_infos[lane] = infos[lane]
            infos[lane] = final

    def close(self) -> None:
        """End the threads of the fleet."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of the vector environment, once for each index."""
        return [getattr(self.env, attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set it on the vector environment, whatever the indices."""
        setattr(self.env, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args,
        indices: VecEnvIndices = None,
        **method_kwargs,
    ) -> list[Any]:
        """Call the vector environment's method once; its result for each index."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result] * self._count(indices)

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """No lane is wrapped."""
        return [False] * self._count(indices)

    def _count(self, indices: VecEnvIndices) -> int:
        return len(list(self._get_indices(indices)))


class LaneView(Mapping):
    """The truth of one lane as plain numbers and words, each converted only when it is read.

    To convert all of it would take longer than a decision. By name the truth has lists with an
    entry for each lane, or dictionaries of arrays, lanes first.
    """

    def __init__(self, truth: dict[str, Any], lane: int):
        self._truth = truth
        self._lane = lane

    def __getitem__(self, name: str) -> Any:
        entry = self._truth[name]
        if isinstance(entry, dict):
            return LaneView(entry, self._lane)
        if isinstance(entry, list):
            return entry[self._lane]
        return entry[self._lane].item()

    def __iter__(self) -> Iterator[str]:
        return iter(self._truth)

    def __len__(self) -> int:
        return len(self._truth)


def _split(info: Mapping[str, Any], lanes: Sequence[int]) -> list[dict[str, Any]]:
    """The information of each of these lanes by itself."""
    # copied before the next step makes the truth invalid
    truth = {
        name: entry if isinstance(entry, dict) else entry.tolist()
        for name, entry in info["truth"].items()
    }
    columns = [info[name][lanes].tolist() for name in PLAIN_NAMES]
    infos = [dict(zip(PLAIN_NAMES, row, strict=True)) for row in zip(*columns, strict=True)]
    for lane, plain in zip(lanes, infos, strict=True):
        plain["truth"] = LaneView(truth, lane)
    return infos


def _joined(options: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Options of the vector environment from those of each lane."""
    names = dict.fromkeys(name for lane_options in options for name in lane_options)
    joined = {}
    for name in names:
        if not all(name in lane_options for lane_options in options):
            remedy = f"give every lane its {name}"
            raise refusal(f"reset option {name}", "some lanes", "all lanes or none", remedy)
        joined[f"{name}s"] = [lane_options[name] for lane_options in options]
    return joined or None
