"""The active environment for one vehicle."""

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from diagnosers import Recursive
from training.active_env.vector import (
    MAX_DECISIONS,
    ActiveDiagnosisVectorEnv,
    lane_info,
)
from training.metrics.declaration import DECLARATION_PROBABILITY
from training.stimuli.base import BUDGET, LARGEST_OFFSET


class ActiveDiagnosisEnv(gym.Env):
    """The NPS AUV II with a diagnoser in the loop; an agent departs from the mission speed.

    ## Description
    Every second the agent chooses the offset of the commanded speed from the mission speed for that
    second, ten samples of 0.1 s; the diagnoser is updated after each. The vehicle is that of
    `auv_fault_env/Propulsion-v0` with its noise, disturbance and healthy band. The seed of an
    episode determines its faults (none in three of ten; onset 5 to 40 s) and its mission (half keep
    one speed of 0.2 to 0.5 m/s, half change it leg by leg).

    ## Action Space
    `Box(1)`, float32, -1 to 1: the speed offset in units of `amplitude`. Values outside are
    clipped, NaN and infinity are refused. The command stays within 0 to 1 m/s.

    ## Observation Space
    `Box(30)`, float32, named by `FEATURES`, bounded by `training.stimuli.policy_inputs.BOUNDS`.
    A class that joins the catalogue before adds one `log_odds:CLASS`, before that of `unknown`. A
    policy of a training with fewer classes takes its features by name.

    | Names | Meaning |
    |---|---|
    | `log_odds:CLASS` | asinh of the log odds of each class, within +-20 |
    | `severity` | mean severity of the most probable fault |
    | `alpha`, `alpha_std`, `beta`, `beta_std` | estimated drag and thrust over nominal |
    | `mission_speed` | [m/s] |
    | `speed_error` | measured speed minus mission speed [m/s] |
    | `last_offset` | the last action, 0 at the start |
    | `time` | log(1 + time since the start [s]) |
    | `left` | log(1 + time [s]) for which the allowance covers an offset of 0.25 m/s |

    ## Rewards
    ``l(after) - l(before) - cost_weight * (mean squared deviation of the true speed from the
    mission speed)``. l(t) is the log probability, at least -20, in the belief of time t of what is
    true *at time t*: `normal` before the onset and after a repair, else the class of the worst
    fault (an intermittent one also between its bursts). So the rewards of an episode sum to
    l(end) - l(start) minus the cost. The second in which the truth changes pays about -9, whatever
    the agent does: for a learner that is noise, but no bias.

    ## Starting State
    As `auv_fault_env/Propulsion-v0`; the diagnoser has had the first sample.

    ## Episode End
    Terminated at the end of the second in which a fault is declared: one class with a probability
    of at least `declare` for 1 s, be it the right one or not. Truncated by the registration after
    120 decisions (120 s).

    ## Information
    `cost`: mean squared offset of the commands of the second [m^2/s^2]; its mean over an episode
    compares with the squared budget. `mission_speed` [m/s], `energy` [J of the second], `declared`
    (class, `normal` for none), and `truth` as in `auv_fault_env/Propulsion-v0` (with the `label`
    `normal` between the bursts of an intermittent fault).

    ## Arguments
    `diagnoser`: a name of `diagnosers.NAMES` or a `Recursive`. `amplitude`: offset [m/s] of the
    action 1. `budget`: root mean square of the offsets over 65 s [m/s], which `left` counts down;
    the environment does not enforce it. `cost_weight` [s^2/m^2]. `declare`: probability, 0.5 or
    more. `horizon`: decisions by which every fault of a given schedule must have begun; raise it
    along with another `max_episode_steps`.

    `reset(options={"schedule": ..., "mission": ...})` as in `auv_fault_env/Propulsion-v0`.

    >>> import gymnasium as gym
    >>> env = gym.make("training.active_env:auv_fault_env/ActiveDiagnosis-v0")
    >>> fault = {"fault": "propeller_loss:port", "onset": 2.0, "severity": 1.0}
    >>> observation, info = env.reset(seed=1, options={"schedule": [fault], "mission": "cruise"})
    >>> terminated = False
    >>> while not terminated:
    ...     observation, reward, terminated, truncated, info = env.step([1.0])
    >>> print(info["declared"], round(info["cost"], 4))
    propeller_loss:port 0.0625
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        diagnoser: str | Recursive = "filter_bank",
        amplitude: float = LARGEST_OFFSET,
        budget: float = BUDGET,
        cost_weight: float = 10.0,
        declare: float = DECLARATION_PROBABILITY,
        horizon: int = MAX_DECISIONS,
    ):
        settings = (diagnoser, amplitude, budget, cost_weight, declare)
        self.lane = ActiveDiagnosisVectorEnv(1, horizon, *settings, AutoresetMode.NEXT_STEP)
        self.action_space = self.lane.single_action_space
        self.observation_space = self.lane.single_observation_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode: of the given seed, or the next one of the last seed."""
        super().reset(seed=seed)
        observation, info = self.lane.reset(seed=seed, options=options)
        return observation[0], lane_info(info, 0)

    def step(self, action):
        """Hold the action for one second."""
        observation, *results, info = self.lane.step(np.asarray(action)[None])
        reward, terminated, truncated = (result.item() for result in results)
        return observation[0], reward, terminated, truncated, lane_info(info, 0)

    def close(self):
        """End the threads of the fleet."""
        self.lane.close()
