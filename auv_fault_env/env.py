"""Gymnasium environments over the fleet: spaces, reset, step and info."""

import math
import numbers
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from auv_fault_env.channels import CHANNELS, COMMANDS
from auv_fault_env.errors import (
    finite_in_range,
    known_name,
    one_per_lane,
    refusal,
    whole_number,
)
from auv_fault_env.fleet import Fleet, checked_actions
from auv_fault_env.missions import Mission, mission_of
from auv_fault_env.parameters import SAMPLE_RATE, Vehicle, channels_of
from auv_fault_env.schedules import Schedule, schedule_of
from auv_fault_env.truth import FleetTruth, SingleLaneTruth

ACTIONS = COMMANDS[1:]


def _box(names: Sequence[str], vehicle: Vehicle) -> gym.spaces.Box:
    """The space of these channels of a vehicle."""
    channels = channels_of(vehicle)
    low = np.array([channels[name].low for name in names], np.float32)
    high = np.array([channels[name].high for name in names], np.float32)
    return gym.spaces.Box(low, high, dtype=np.float32)


def _checked_schedule(value, end: float) -> Schedule:
    """The schedule, if all its faults begin before the end [s] of the episode."""
    schedule = schedule_of(value)
    for event in schedule:
        if event.onset >= end:
            allowed = f"before the episode's end at {end:g} s"
            remedy = "begin earlier, or raise max_episode_steps (single environment: also horizon)"
            raise refusal(f"onset of {event.fault}", event.onset, allowed, remedy)
    return schedule


def _info(outcomes: Sequence, truth: Mapping[str, Any]) -> dict[str, Any]:
    """The information of a step, from the `outcomes` of the fleet."""
    _, energy, cost, mission_speed = outcomes
    return {
        "mission_speed": mission_speed,
        "energy": energy,
        "cost": cost,
        "truth": truth,
    }


def _need_reset(started: bool):
    if not started:
        message = "step: got no reset before; allowed is a step after a reset; call reset() first"
        raise gym.error.ResetNeeded(message)


class PropulsionEnv(gym.Env):
    """An underwater vehicle under way: surge, two propeller shafts, controllers, sensors, faults.

    ## Description
    The vehicle follows the speed of its mission while a fault may strike its hull, propellers,
    shaft seals, motors or sensors. The agent commands speed, rudder and stern plane; a diagnoser
    outside reads the observations and names the fault. The plant is that of the NPS thesis "Neural
    network based propulsion system fault diagnostics for the NPS AUV II" (June 1992); a sample is
    0.1 s. The seed decides healthy vehicle, mission, faults and noise of every episode. The same
    seed with an empty schedule is the exact fault-free twin.

    ## Action Space
    `Box(3)`, float32, in physical units; values outside are clipped, NaN and infinity are refused.
    The largest speed is the vehicle's `maximum_speed`, here that of `thesis1992`.

    | Index | Action | Minimum | Maximum | Unit |
    |---|---|---|---|---|
    | 0 | commanded surge speed | 0 | 1 | m/s |
    | 1 | rudder | -0.4 | 0.4 | rad |
    | 2 | stern plane | -0.4 | 0.4 | rad |

    ## Observation Space
    `Box(12)`, float32, in the order of `auv_fault_env.CHANNELS`. Readings saturate at these limits,
    which grow with the vehicle's largest speed, shaft speed, voltage and current (here those of
    `thesis1992`). A vehicle with one shaft has that of port; its starboard readings are always 0.

    | Index | Channel | Minimum | Maximum | Unit | Noise (1 sigma) |
    |---|---|---|---|---|---|
    | 0 | mission_speed | 0 | 1 | m/s | |
    | 1 | speed_command | 0 | 1 | m/s | |
    | 2 | rudder | -0.4 | 0.4 | rad | |
    | 3 | stern_plane | -0.4 | 0.4 | rad | |
    | 4 | speed | -1 | 5 | m/s | 0.01 |
    | 5 | acceleration | -2 | 2 | m/s^2 | 0.002 |
    | 6, 9 | port_voltage, starboard_voltage | -5 | 30 | V | 0.025 |
    | 7, 10 | port_current, starboard_current | -30 | 30 | A | 0.025 |
    | 8, 11 | port_rpm, starboard_rpm | -500 | 6000 | rpm | 1 |

    Readings are taken at the end of the sample, simultaneously, before the controllers act again;
    channels 1 to 3 are the commands of the sample that ended. A dropped-out reading is 0,
    as a pulled-down input gives, never NaN. Faults show in the readings only: there is no
    fault-free channel, and the controllers too use the faulty readings.

    ## Rewards
    ``-(speed - mission_speed)^2 - 0.01 energy`` with the true speed [m/s] and the electrical energy
    [J] of the sample. It pays for the mission, not for a diagnosis.

    ## Starting State
    In motion at the first speed of the mission, or at rest (one sampled mission in five). The first
    command acts on the first step.

    ## Episode End
    `terminated` stays False; the registration truncates after 600 steps (60 s).

    ## Information
    `mission_speed` [m/s], `energy` [J of the step], `cost` (squared deviation from the mission
    speed, m^2/s^2) and `truth`: `label` (diagnosis class of the largest severity during the step,
    else `normal`), `severity` (by class), `onset` [s] of the first fault of the schedule (infinite
    if none), `parameters` (by name, under the faults), `state` (noise-free, by name). The truth
    contains a future onset: it is for scoring, not for agents.

    ## Arguments
    ```python
    arguments = dict(preset="thesis1992", sensor_noise=1.0, disturbance=1.0, healthy_band=1.0)
    gym.make("auv_fault_env/Propulsion-v0", **arguments)
    ```
    `preset`: a name in `auv_fault_env.PRESETS` or a `Vehicle`. `sensor_noise`, `disturbance`,
    `healthy_band`: factors on the default noise, the disturbing acceleration and the healthy band;
    0 switches off. `horizon`: end of the episode [s], before which every fault of a schedule must
    begin; raise it together with `max_episode_steps`. `realism`: factor on the imperfections of
    real sensors and surroundings, from 0, the default, to 10; `imperfections`: names of those that
    act (`auv_fault_env.realism.EFFECTS`), None for all.

    `reset(options={"schedule": ..., "mission": ...})`: the schedule is a sequence of `FaultEvent`
    or of mappings with their fields, or the path of a JSON file; empty means healthy; without it
    one is sampled. The mission is a name (`thesis`, `acceleration`, `cruise`), a speed [m/s], a
    list of legs (start [s], speed [m/s]) or a `Mission`.

    >>> import gymnasium as gym
    >>> import auv_fault_env
    >>> env = gym.make("auv_fault_env/Propulsion-v0")
    >>> fault = {"fault": "propeller_loss:port", "onset": 1.0, "severity": 1.0}
    >>> observation, info = env.reset(seed=1, options={"schedule": [fault], "mission": "thesis"})
    >>> for _ in range(11):
    ...     observation, reward, terminated, truncated, info = env.step([observation[0], 0.0, 0.0])
    >>> print(info["truth"]["label"], info["truth"]["parameters"]["port_beta"])
    propeller_loss:port 0.0

    ## Version History
    * v0: first version
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 10}

    def __init__(
        self,
        render_mode: str | None = None,
        preset: str | Vehicle = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        horizon: float = 60.0,
        realism: float = 0.0,
        imperfections: Sequence[str] | None = None,
    ):
        if render_mode is not None:
            known_name("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._horizon = finite_in_range("horizon", horizon, 0.0, math.inf)
        self.fleet = Fleet(
            1,
            preset,
            sensor_noise,
            disturbance,
            healthy_band,
            realism=realism,
            imperfections=imperfections,
        )
        self.action_space = _box(ACTIONS, self.fleet.vehicle)
        self.observation_space = _box(tuple(CHANNELS), self.fleet.vehicle)
        self._truth = SingleLaneTruth(self.fleet)
        self._observation: np.ndarray | None = None
        self._renderer = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start the first episode of the seed; without a seed the next episode of the last one."""
        options = _known_options(options, ("schedule", "mission"))
        schedules = missions = None
        if options.get("schedule") is not None:
            schedules = [_checked_schedule(options["schedule"], self._horizon)]
        if options.get("mission") is not None:
            missions = [mission_of(options["mission"])]
        super().reset(seed=seed)
        is_first_episode = seed is not None or self._observation is None
        seeds = [self.np_random_seed] if is_first_episode else None
        self._observation = self.fleet.reset(seeds, schedules=schedules, missions=missions)[0]
        if self._renderer is not None:
            self._renderer.clear()
        return self._observation_and_info()

    def step(self, action):
        """Apply the action for one sample of 0.1 s."""
        _need_reset(self._observation is not None)
        self._observation = self.fleet.advance(checked_actions(action, (3,))[None])[0]
        observation, info = self._observation_and_info()
        return observation, self.fleet.outcomes.item(0), False, False, info

    def _observation_and_info(self):
        info = _info(self.fleet.outcomes[:, 0].tolist(), self._truth.read())
        if self.render_mode is not None:
            self._record(info)
        return self._observation, info

    def _record(self, info: dict[str, Any]):
        if self._renderer is None:
            from auv_fault_env.rendering import Renderer

            fps = self.metadata["render_fps"]
            self._renderer = Renderer(self.render_mode, fps, self.fleet.vehicle)
        self._renderer.record(float(self.fleet.time[0]), self._observation, info["truth"])
        if self.render_mode == "human":
            self._renderer.show()

    def render(self) -> np.ndarray | None:
        """The frame (height, width, 3) uint8 in mode `rgb_array`, None in mode `human`."""
        _need_reset(self._observation is not None)
        return self._renderer.frame() if self.render_mode == "rgb_array" else None

    def __getstate__(self):
        return self.__dict__ | {"_renderer": None}

    def close(self):
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class PropulsionVectorEnv(gym.vector.VectorEnv):
    """`PropulsionEnv` for many vehicles at once, with the same spaces, rewards and information.

    Lane k of ``reset(seed=s)`` is the single environment with seed s + k, bit for bit. A finished
    lane resets itself on the next step, whose action it ignores (`AutoresetMode.NEXT_STEP`). Values
    in `info` are arrays (num_envs,); `truth` is a mapping of arrays, valid until the next step.
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
        self.single_action_space = _box(ACTIONS, self.fleet.vehicle)
        self.single_observation_space = _box(tuple(CHANNELS), self.fleet.vehicle)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._terminated = np.zeros(self.num_envs, bool)
        self._done: np.ndarray | None = None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ):
        """Start an episode on every lane."""
        options = _known_options(options, ("schedule", "mission", "schedules", "missions"))
        end = self.max_episode_steps / SAMPLE_RATE
        schedules = self._per_lane(options, "schedule", partial(_checked_schedule, end=end))
        missions = self._per_lane(options, "mission", mission_of)
        if isinstance(seed, numbers.Integral):
            seed = whole_number("seed", seed, 0)
        super().reset(seed=seed if isinstance(seed, int) else None)
        observations = self.fleet.reset(self._seeds(seed), schedules=schedules, missions=missions)
        self._done = np.zeros(self.num_envs, bool)
        return observations, self._info()

    def step(self, actions):
        """Apply the actions (num_envs, 3) for 0.1 s; finished lanes start their next episode."""
        _need_reset(self._done is not None)
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
        return _info(self.fleet.outcomes, FleetTruth(self.fleet))

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


def _known_options(options: dict[str, Any] | None, names: Sequence[str]) -> dict[str, Any]:
    """The options of a reset, if all have one of these names."""
    if not isinstance(options, Mapping | None):
        raise refusal("reset options", options, "a mapping", f"give some of {', '.join(names)}")
    for name in options or {}:
        known_name("reset option", name, names)
    return options or {}
