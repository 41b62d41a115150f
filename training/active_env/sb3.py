"""The active environment as a `VecEnv` of stable-baselines3: one fleet and one diagnoser, not many environments."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from auv_fault_env.errors import refusal
from training.active_env.vector import ActiveDiagnosisVectorEnv

TOLD = ("mission_speed", "energy", "cost", "declared")
NAMES = (*TOLD, "truth")


class ActiveVecEnv(VecEnv):
    """What ``DummyVecEnv`` over single environments returns, at the speed of a fleet.

    A lane that ends is reset within the same step: its last observation is `terminal_observation`
    in its information, where `TimeLimit.truncated` says whether time ended it, and `reset_infos`
    has the information of its new start. Seeds and options (`seed`, `set_options`) count for the
    next reset, as with any `VecEnv`. Attributes and methods are those of the one vector environment
    behind it, the same for every index.

    Parameters
    ----------
    env
        The vehicles; made with the default reset in the same step.
    """

    def __init__(self, env: ActiveDiagnosisVectorEnv):
        if env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise refusal(
                "autoreset_mode",
                env.metadata["autoreset_mode"].value,
                "SameStep",
                "leave the argument out",
            )
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start an episode on every lane, with the seeds and options given before; observations (n_lanes, n)."""
        seeds = None if all(seed is None for seed in self._seeds) else self._seeds
        observation, info = self.env.reset(seed=seeds, options=_joined(self._options))
        self.reset_infos = _split(info, range(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions (n_lanes, 1)."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Hold the actions for a second; observations, rewards (float32), ends, and information by lane."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        infos = _split(info, range(self.num_envs))
        for lane, by_time in enumerate((truncated & ~terminated).tolist()):
            infos[lane]["TimeLimit.truncated"] = by_time
        if done.any():
            self._end(np.flatnonzero(done).tolist(), infos, info)
        return observation, reward.astype(np.float32), done, infos

    def _end(self, lanes: list[int], infos: list[dict[str, Any]], info: Mapping[str, Any]) -> None:
        """Give the lanes the information of their end, and keep that of their new start."""
        for lane, final in zip(lanes, _split(info["final_info"], lanes), strict=True):
            by_time = infos[lane].pop("TimeLimit.truncated")
            last = {"terminal_observation": info["final_obs"][lane], "TimeLimit.truncated": by_time}
            self.reset_infos[lane] = infos[lane]
            infos[lane] = final | last

    def close(self) -> None:
        """End the fleet's threads."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of the vector environment, once for each index."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set it on the vector environment, whatever the indices."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args, indices: VecEnvIndices = None, **method_kwargs
    ) -> list[Any]:
        """Call the vector environment's method once; its result for each index."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """No lane is wrapped."""
        return [False] * len(list(self._get_indices(indices)))


class LaneView(Mapping):
    """The truth of one lane as plain numbers and words, each made when asked for: all of it costs more than a decision.

    Parameters
    ----------
    truth
        Lists by name, an entry for each lane, or dictionaries of arrays, the lane first.
    lane
        Index of the lane.
    """

    def __init__(self, truth: dict[str, Any], lane: int):
        self._truth = truth
        self._lane = lane

    def __getitem__(self, name: str) -> Any:
        values = self._truth[name]
        if isinstance(values, list):
            return values[self._lane]
        return (
            LaneView(values, self._lane) if isinstance(values, dict) else values[self._lane].item()
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._truth)

    def __len__(self) -> int:
        return len(self._truth)


def _split(info: Mapping[str, Any], lanes: Sequence[int]) -> list[dict[str, Any]]:
    """The information of these lanes, each by itself."""
    truth = {  # read once for all, before the next step makes it unreadable
        name: values if isinstance(values, dict) else values.tolist()
        for name, values in info["truth"].items()
    }
    told = (info[name][lanes].tolist() for name in TOLD)
    return [
        dict(zip(NAMES, one, strict=True))
        for one in zip(*told, (LaneView(truth, k) for k in lanes), strict=True)
    ]


def _joined(options: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Options of the vector environment from those of each lane."""
    names = dict.fromkeys(name for one in options for name in one)
    joined = {}
    for name in names:
        if not all(name in one for one in options):
            raise refusal(
                f"reset option {name}",
                "some lanes",
                "all lanes or none",
                f"give every lane its {name}",
            )
        joined[f"{name}s"] = [one[name] for one in options]
    return joined or None
