"""The active environment for one vehicle."""

from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from auv_fault_env.env.interface import WithFleet, known_options, need_reset
from auv_fault_env.env.spec import WithSpec
from diagnosers import Belief
from training.active_env.spec import with_plain_arguments
from training.active_env.vector import ActiveDiagnosisVectorEnv, checked_action, lane_info

NO_LIMIT = 2**31  # decisions: the time limit is that of the registration


class ActiveDiagnosisEnv(WithFleet, WithSpec, gym.Env):
    """A vehicle with a diagnoser in the loop; an agent departs from the mission speed.

    ## Description
    Every second the agent chooses the offset of the commanded speed from the mission speed for that
    second, ten samples of 0.1 s; the diagnoser is updated after each. The vehicle is that of
    `auv_fault_env/Propulsion-v0`, the NPS AUV II by default, with its noise, disturbance and
    healthy band. The seed of an episode determines its faults (none in three of ten; onset 5 to
    40 s) and its mission (half keep one speed of 0.2 to 0.5 of the vehicle's largest speed, half
    change it leg by leg).

    ## Action Space
    `Box(1)`, float32, -1 to 1: the speed offset in units of `amplitude`. Values outside are
    clipped, NaN and infinity are refused. The command stays within 0 and the vehicle's largest
    speed, 1 m/s on the NPS AUV II. With ``thrust_shift=True`` the space is `Box(2)` and the second
    element shifts thrust to port, by 0.8 at 1, as in `auv_fault_env/Propulsion-v0`; observations
    do not repeat it.

    ## Observation Space
    `Box(31)`, float32, named by `FEATURES`, bounded by `training.stimuli.policy_inputs.BOUNDS`.
    A class that joins the catalogue before adds one `log_odds:CLASS`, before that of `unknown`. A
    policy of a training with fewer classes takes its features by name. Speeds are relative to the
    vehicle's largest speed.

    | Names | Meaning |
    |---|---|
    | `log_odds:CLASS` | asinh of the log odds of each class, within +-20 |
    | `severity` | mean severity of the most probable fault |
    | `alpha`, `alpha_std`, `beta`, `beta_std` | estimated drag and thrust over nominal |
    | `mission_speed` | relative |
    | `speed_error` | measured speed minus mission speed, relative |
    | `last_offset` | the last action, 0 at the start |
    | `time` | log(1 + time since the start [s]) |
    | `left` | log(1 + time [s]) for which the allowance covers a relative offset of 0.25 |
    | `budget` | log of the relative budget in units of 0.0762, within those of 0.02 to 0.4 |

    ## Rewards
    ``l(after) - l(before) - cost_weight * (mean squared deviation of the true speed from the
    mission speed)``. l(t) is the log probability, at least -20, in the belief of time t of what is
    true *at time t*: `normal` before the onset and after a repair, else the class of the worst
    fault (an intermittent one also between its bursts). So the rewards of an episode sum to
    l(end) - l(start) minus the cost. The second in which the truth changes pays about -9, whatever
    the agent does: for a learner that is noise, but no bias. The argument `reward` replaces it.

    ## Starting State
    As `auv_fault_env/Propulsion-v0`; the diagnoser has had the first sample. `reset` without a seed
    starts the next episode of the last seed, so that environments with one seed have the same
    episodes; without any seed before it draws one, which `np_random_seed` names.

    ## Episode End
    Terminated at the end of the second in which a fault is declared: one class with a probability
    of at least `declare` for 1 s, be it the right one or not. A step after that is refused with
    `gymnasium.error.ResetNeeded`. Truncated by the registration after 120 decisions (120 s).

    ## Information
    Numpy numbers and arrays; classes in the order of `auv_fault_env.classes()`:

    * `belief`: the probability of each class, (n_classes,); `severity_mean`, `severity_std`: of
      each class if that is the fault, (n_classes,).
    * `declared_class`: the index of the declared class, 0 for none.
    * `cost`: mean squared offset of the commands of the second [m^2/s^2]; its mean over an episode
      compares with the squared budget.
    * `mission_speed` [m/s], `energy` [J of the second].
    * of the truth as much as the argument `truth` says, as in `auv_fault_env/Propulsion-v0`: there
      an intermittent fault is not true between its bursts.

    ## Arguments
    All by name; their types are those of `ActiveDiagnosisVectorEnv`.

    * `diagnoser`: a name of `diagnosers.NAMES`, made for the vehicle, by default
      ``"filter_bank"``; a mapping of such a `name`
      and of settings; ``"module:Class"`` or ``"file.py:Class"``; a `diagnosers.Diagnoser`; or a
      class or function that makes one. It is not told the truth, be it the `oracle`.
    * `amplitude`: offset [m/s] of the action 1, by default a quarter of the vehicle's largest
      speed.
    * `budget`: root mean square of the offsets over 65 s [m/s], which `left` counts down, by
      default 0.0762 of the largest speed; the environment does not enforce it.
    * `cost_weight` [s^2/m^2], by default 10 over the square of the largest speed [m/s].
    * `declare`: probability, 0.5 or more, by default 0.9.
    * `reward`: a function of a `training.active_env.Decision` that returns the reward of each lane,
      or its place ``"module:function"``. `training.active_env.log_probability_gain` is the reward
      without the cost, `training.active_env.delay_penalty` minus the time without a diagnosis.
    * `thrust_shift`: whether there is a second action, see Action Space.
    * `preset`, `sensor_noise`, `disturbance`, `healthy_band`, `realism`, `imperfections`,
      `schedules`, `missions`, `truth` as in `auv_fault_env/Propulsion-v0`; those that are sampled
      by default are `training.active_env.vector.SCHEDULES` and `ActiveMissions()`.

    `env.spec.to_json()` has them all, but for a diagnoser or reward that no name, setting or place
    describes. `reset(options={"schedule": ..., "mission": ...})` as in
    `auv_fault_env/Propulsion-v0`.

    Examples
    --------
    >>> import gymnasium as gym
    >>> from auv_fault_env import classes
    >>> env = gym.make("training.active_env:auv_fault_env/ActiveDiagnosis-v0")
    >>> fault = {"fault": "propeller_loss:port", "onset": 2.0, "severity": 1.0}
    >>> observation, info = env.reset(seed=1, options={"schedule": [fault], "mission": "cruise"})
    >>> terminated = False
    >>> while not terminated:
    ...     observation, reward, terminated, truncated, info = env.step([1.0])
    >>> print(classes()[info["declared_class"]], round(info["cost"], 4))
    propeller_loss:port 0.0625
    """

    metadata = {"render_modes": []}

    def __init__(self, **arguments: Any):
        mode = AutoresetMode.DISABLED
        self.lane = ActiveDiagnosisVectorEnv(1, NO_LIMIT, autoreset_mode=mode, **arguments)
        self.fleet = self.lane.fleet
        self.classes = self.lane.classes
        self.action_space = self.lane.single_action_space
        self.observation_space = self.lane.single_observation_space
        self._has_started = False
        self._has_ended = False

    @property
    def belief(self) -> Belief:
        """The present belief, (1, n_classes), with classes in the order of `classes`."""
        return self.lane.belief

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start the first episode of the seed; without a seed the next episode of the last one."""
        options = known_options(options, ("schedule", "mission"))
        super().reset(seed=seed)
        is_first_episode = seed is not None or not self._has_started
        seed = self.np_random_seed if is_first_episode else None
        observation, info = self.lane.reset(seed=seed, options=options)
        self._has_started = True
        self._has_ended = False
        return observation[0], lane_info(info, 0)

    def step(self, action):
        """Hold the action for one second."""
        need_reset(self._has_started, "step")
        if self._has_ended:
            message = "step: got an ended episode; allowed is a step before the end; call reset()"
            raise gym.error.ResetNeeded(message)
        action = checked_action(action, self.action_space.shape)
        observation, reward, terminated, truncated, info = self.lane.step(action[None])
        self._has_ended = terminated.item()
        results = (reward.item(), self._has_ended, truncated.item())
        return observation[0], *results, lane_info(info, 0)

    def _true_spec(self, spec: EnvSpec) -> EnvSpec:
        return with_plain_arguments(super()._true_spec(spec))

    def close(self):
        """End the threads of the fleet."""
        self.lane.close()
