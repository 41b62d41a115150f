"""A fleet as the `VecEnv` of stable-baselines3: one environment of many lanes, not many of one."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvStepReturn,
)

from auv_fault_env.errors import refusal

BY_TIME = "TimeLimit.truncated"  # stable-baselines3's name for an end by time
# attributes of one lane that the vector environment has under another name
OF_ONE_LANE = {
    "action_space": "single_action_space",
    "observation_space": "single_observation_space",
}


class FleetVecEnv(VecEnv):
    """The interface of `DummyVecEnv` over single environments, at the speed of a fleet.

    Each lane gives what `DummyVecEnv` gives of the single environment: a lane that ends is reset
    within the same step; its information has its last observation as `terminal_observation`, and
    `TimeLimit.truncated` says whether time alone ended it; `reset_infos` has the information of its
    new start. Seeds and options (`seed`, `set_options`) count for the next reset only, which
    otherwise goes on with the next episodes.

    The lanes share one environment. So `get_attr` gives its attribute for each index (of spaces
    those of one lane), and `set_attr` and `env_method` are for all lanes at once: some of the
    indices are refused. Options of a reset that differ from lane to lane name the same things.

    Parameters
    ----------
    env
        A vector environment that resets within the same step, as ``gym.make_vec(name, n_lanes,
        "vector_entry_point", autoreset_mode="SameStep")``.

    Raises
    ------
    InputError
        For an environment that resets otherwise.
    """

    def __init__(self, env: gym.vector.VectorEnv):
        if not isinstance(env, gym.vector.VectorEnv):
            remedy = "make one with gym.make_vec"
            raise refusal("environment", type(env).__name__, "a gym.vector.VectorEnv", remedy)
        mode = env.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            got = getattr(mode, "value", mode)
            remedy = "make the environment with autoreset_mode='SameStep'"
            raise refusal("autoreset_mode", got, "SameStep", remedy)
        self.env = env
        self._listed = DictInfoToList(env)
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start an episode on every lane, with the current seeds and options; (n_lanes, n)."""
        seeds = None if set(self._seeds) == {None} else self._seeds
        options = _joined(self._options)
        observation, self.reset_infos = self._listed.reset(seed=seeds, options=options)
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (n_lanes, n) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step all lanes; observations, rewards (float32), ends and information."""
        observation, reward, terminated, truncated, infos = self._listed.step(self._actions)
        done = terminated | truncated
        for lane in np.flatnonzero(done).tolist():
            infos[lane] = self._ended(lane, infos[lane])
        for info, by_time in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            info[BY_TIME] = by_time
        return observation, reward.astype(np.float32), done, infos

    def _ended(self, lane: int, info: dict[str, Any]) -> dict[str, Any]:
        """The information of the end of a lane; that of its new start goes to `reset_infos`."""
        final = info.pop("final_info")
        final["terminal_observation"] = info.pop("final_obs")
        self.reset_infos[lane] = info
        return final

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_images(self) -> list[np.ndarray]:
        """A frame (height, width, 3) uint8 of each lane."""
        return list(self.env.render())

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of the environment, once for each index."""
        value = self._attribute(OF_ONE_LANE.get(attr_name, attr_name))
        return [value] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set it on the environment, for all lanes."""
        self._require_all(f"set_attr({attr_name!r})", indices)
        setattr(self.env.unwrapped, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args,
        indices: VecEnvIndices = None,
        **method_kwargs,
    ) -> list[Any]:
        """Call the environment's method once, for all lanes; its result for each of them."""
        self._require_all(f"env_method({method_name!r})", indices)
        result = self._attribute(method_name)(*method_args, **method_kwargs)
        return [result] * self.num_envs

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """No lane is wrapped by itself."""
        return [False] * len(list(self._get_indices(indices)))

    def _attribute(self, name: str) -> Any:
        """That of the environment, or of the one within its wrappers, which pass nothing on."""
        return getattr(self.env if hasattr(self.env, name) else self.env.unwrapped, name)

    def _require_all(self, thing: str, indices: VecEnvIndices) -> None:
        lanes = list(self._get_indices(indices))
        if sorted(lanes) != list(range(self.num_envs)):
            allowed = "all lanes, as they share one environment"
            raise refusal(f"indices of {thing}", lanes, allowed, "leave indices out")


def _joined(options: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Options of the vector environment from those of each lane."""
    first = options[0]
    if all(of_lane is first for of_lane in options):
        return first or None
    names = dict.fromkeys(name for of_lane in options for name in of_lane)
    joined = {}
    for name in names:
        if not all(name in of_lane for of_lane in options):
            remedy = f"give every lane its {name}"
            raise refusal(f"reset option {name}", "some lanes", "all lanes or none", remedy)
        joined[f"{name}s"] = [of_lane[name] for of_lane in options]
    return joined or None
