"""The environment of one vehicle."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from auv_fault_env.actions import checked_actions
from auv_fault_env.channels import CHANNELS
from auv_fault_env.env.actions import KINDS, action_space, commands
from auv_fault_env.env.interface import (
    WithFleet,
    box,
    known_options,
    need_reset,
    outcome_info,
    vehicle_of_argument,
)
from auv_fault_env.env.recording import METADATA, Recording, known_render_mode
from auv_fault_env.env.rewards import RewardWeights, rewards
from auv_fault_env.env.spec import WithSpec
from auv_fault_env.errors import known_name
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionDistribution, mission_of
from auv_fault_env.parameters import Vehicle
from auv_fault_env.schedules import ScheduleDistribution, schedule_of
from auv_fault_env.truth import SingleLaneTruth, known_level


class PropulsionEnv(WithFleet, WithSpec, gym.Env):
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

    With ``action="residual"`` the space is -1 to 1, and 0 follows the mission: the first element
    changes the commanded speed from the mission speed, by a quarter of the largest speed at 1; the
    others are rudder and stern plane in units of their largest.

    | Index | Action | Minimum | Maximum | Unit |
    |---|---|---|---|---|
    | 0 | commanded surge speed | 0 | 1 | m/s |
    | 1 | rudder | -0.4 | 0.4 | rad |
    | 2 | stern plane | -0.4 | 0.4 | rad |

    With ``thrust_shift=True`` the space is `Box(4)` and the last element, -0.8 to 0.8, shifts
    thrust from starboard to port: at s the port propeller has 1 + s and the starboard one 1 - s
    times its share, and speed and total thrust stay. The rudder that holds the heading is added to
    that of the action. For vehicles with two shafts.

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
    [J] of the sample. It pays for the mission, not for a diagnosis. The fins are free, so that an
    agent brakes with them: ``reward_weights={"deflection": 0.1}`` charges rudder^2 + stern_plane^2
    [rad^2] as well; `speed` and `energy` replace the weights 1.0 and 0.01 of the formula.

    ## Starting State
    In motion at the first speed of the mission, or at rest (one sampled mission in five). The first
    command acts on the first step.

    ## Episode End
    `terminated` stays False; the registration truncates after 600 steps (60 s).

    ## Information
    `mission_speed` [m/s], `energy` [J of the step], `cost` (squared deviation from the mission
    speed, m^2/s^2), and of the truth as much as the argument `truth` says, for scoring, not for
    agents:

    * ``"label"``, the default: `true_class`, the index in `auv_fault_env.classes()` of the
      diagnosis class of the largest severity during the step, 0 for `normal`. Only numbers, so that
      libraries can collect the information as arrays and tensors.
    * ``"full"``: that, and a dictionary `truth` of `label` (the class by name), `severity` (by
      class), `onset` [s] of the first fault of the schedule (infinite if none, maybe in the
      future), `parameters` (by name, under the faults) and `state` (noise-free, by name).
    * ``False``: nothing.

    ## Arguments
    ```python
    arguments = dict(preset="thesis1992", sensor_noise=1.0, disturbance=1.0, healthy_band=1.0)
    gym.make("auv_fault_env/Propulsion-v0", **arguments)
    ```
    * `preset`: a name in `auv_fault_env.PRESETS`, a `Vehicle` or its fields. That of a vehicle file
      is ``training.field.vehicle_file.read_vehicle(path).vehicle``; the environment cannot read the
      file itself, as its other parts belong to diagnosers.
    * `sensor_noise`, `disturbance`, `healthy_band`: factors on the default noise, the disturbing
      acceleration and the healthy band; 0 switches off.
    * `realism`: factor on the imperfections of real sensors and surroundings, from 0, the default,
      to 10; `imperfections`: names of those that act (`auv_fault_env.realism.EFFECTS`), None for
      all.
    * `schedules`, `missions`: what episodes are drawn from, by default
      `auv_fault_env.ScheduleSampler()` and `MissionSampler()`: one of these or of another subclass
      of `ScheduleDistribution` or `MissionDistribution`, or its fields as a dictionary;
      `set_distributions` changes them from the next episode on.
    * `action`: ``"command"`` or ``"residual"``, see Action Space.
    * `thrust_shift`: whether there is a fourth action, see Action Space.
    * `reward_weights`: some of `speed`, `energy`, `deflection`, see Rewards.
    * `truth`: ``"label"``, ``"full"`` or False, see Information.

    `reset(options={"schedule": ..., "mission": ...})`: the schedule is a sequence of `FaultEvent`
    or of mappings with their fields, or the path of a JSON file; empty means healthy; without it
    one is sampled. The mission is a name (`thesis`, `acceleration`, `cruise`), a speed [m/s], a
    list of legs (start [s], speed [m/s]) or a `Mission`. Both hold for the episode that this reset
    starts. A fault that begins after the last step of the registration's time limit never comes:
    one environment does not know the limit, the vector form does and refuses it.

    ## Version History
    * v0: first version

    Examples
    --------
    >>> import gymnasium as gym
    >>> import auv_fault_env
    >>> env = gym.make("auv_fault_env/Propulsion-v0", truth="full")
    >>> fault = {"fault": "propeller_loss:port", "onset": 1.0, "severity": 1.0}
    >>> observation, info = env.reset(seed=1, options={"schedule": [fault], "mission": "thesis"})
    >>> for _ in range(11):
    ...     observation, reward, terminated, truncated, info = env.step([observation[0], 0.0, 0.0])
    >>> print(info["truth"]["label"], info["truth"]["parameters"]["port_beta"])
    propeller_loss:port 0.0
    """

    metadata = METADATA

    def __init__(
        self,
        render_mode: str | None = None,
        preset: str | Vehicle | Mapping = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        realism: float = 0.0,
        imperfections: Sequence[str] | None = None,
        schedules: ScheduleDistribution | Mapping | None = None,
        missions: MissionDistribution | Mapping | None = None,
        truth: str | bool = "label",
        action: str = "command",
        reward_weights: Mapping[str, float] | None = None,
        thrust_shift: bool = False,
    ):
        self.render_mode = known_render_mode(render_mode)
        self.fleet = Fleet(
            1,
            vehicle_of_argument(preset),
            sensor_noise,
            disturbance,
            healthy_band,
            realism=realism,
            imperfections=imperfections,
        )
        self.set_distributions(schedules, missions)
        self.action_space = action_space(action, self.fleet.vehicle, thrust_shift)
        self.observation_space = box(tuple(CHANNELS), self.fleet.vehicle)
        self._action_kind = known_name("action", action, KINDS)
        self._weights = RewardWeights.of(reward_weights)
        self._truth_level = known_level(truth)
        self._truth = SingleLaneTruth(self.fleet)
        self._observation: np.ndarray | None = None
        self._recording = None if render_mode is None else Recording(render_mode, self.fleet)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start the first episode of the seed; without a seed the next episode of the last one."""
        options = known_options(options, ("schedule", "mission"))
        schedules = missions = None
        if options.get("schedule") is not None:
            schedules = [schedule_of(options["schedule"])]
        if options.get("mission") is not None:
            missions = [mission_of(options["mission"])]
        super().reset(seed=seed)
        is_first_episode = seed is not None or self._observation is None
        seeds = [self.np_random_seed] if is_first_episode else None
        self._observation = self.fleet.reset(seeds, schedules=schedules, missions=missions)[0]
        if self._recording is not None:
            self._recording.clear()
        return self._observation_and_info()

    def step(self, action):
        """Apply the action for one sample of 0.1 s."""
        need_reset(self._observation is not None, "step")
        actions = checked_actions(action, self.action_space.shape)[None]
        self._observation = self.fleet.advance(commands(self._action_kind, self.fleet, actions))[0]
        observation, info = self._observation_and_info()
        return observation, rewards(self._weights, self.fleet).item(), False, False, info

    def _observation_and_info(self):
        info = outcome_info(self.fleet.outcomes[:, 0])
        info |= self._truth.of_level(self._truth_level)
        if self._recording is not None:
            self._recording.record(self._observation)
        return self._observation, info

    def render(self) -> np.ndarray | None:
        """The frame (height, width, 3) uint8 in mode `rgb_array`, None in mode `human`."""
        need_reset(self._observation is not None, "render")
        return None if self._recording is None else self._recording.frame()

    def close(self):
        """Close the window, if there is one."""
        if self._recording is not None:
            self._recording.close()
