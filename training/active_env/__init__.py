"""The active environment: second by second an agent chooses how fast to go, so that a fault is identified sooner.

Importing this module registers ``auv_fault_env/ActiveDiagnosis-v0``. Gymnasium does so by itself
when it is asked for the environment with its module:
``gym.make("training.active_env:auv_fault_env/ActiveDiagnosis-v0")``; ``gym.make_vec`` takes the
same name. (`auv_fault_env` never imports this package, so its import alone does not register it.)
"""

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from diagnosers import Recursive
from training.active_env.vector import MAX_DECISIONS, ActiveDiagnosisVectorEnv, lane_info
from training.stimuli.base import BUDGET, LARGEST_OFFSET
from training.stimuli.declaration import DECLARE
from training.stimuli.policy_inputs import FEATURES

__all__ = ["FEATURES", "NAME", "ActiveDiagnosisEnv", "ActiveDiagnosisVectorEnv"]
NAME = "auv_fault_env/ActiveDiagnosis-v0"


class ActiveDiagnosisEnv(gym.Env):
    """The NPS AUV II under way with a diagnoser in the loop; the agent departs from the mission speed to help it.

    ## Description
    Once per second the agent chooses by how much the commanded speed departs from the mission's for that second, ten
    samples of 0.1 s, after each of which the diagnoser is updated. The vehicle is that of `auv_fault_env/Propulsion-v0`
    with its noise, disturbance and healthy band. Each episode draws its faults (none in three of ten; onset 5 to 40 s)
    and its mission (half keep 0.2 to 0.5 m/s, half change speed leg by leg) from the seed.

    ## Action Space
    `Box(1)`, float32, -1 to 1: the speed offset in units of `amplitude`; values outside are clipped, NaN and infinity
    are refused. The command stays within 0 to 1 m/s.

    ## Observation Space
    `Box(29)`, float32, named by `FEATURES`, bounded by `training.stimuli.policy_inputs.BOUNDS`.

    | Names | What |
    |---|---|
    | `log_odds:CLASS` | asinh of the log odds of every class of `auv_fault_env.classes()`, these within -20 to 20 |
    | `severity` | the belief's mean severity of the most probable fault |
    | `alpha`, `alpha_std`, `beta`, `beta_std` | drag and thrust by the parameter filter, relative to nominal |
    | `mission_speed` | [m/s] |
    | `speed_error` | measured speed minus mission speed [m/s] |
    | `last_offset` | the last action, 0 at the start |
    | `time` | log(1 + time since the start [s]) |
    | `left` | log(1 + time [s]) for which 0.25 m/s can be held with what is left of the squares that `budget` allows |

    ## Rewards
    ``l(after) - l(before) - cost_weight * (mean squared deviation of the true speed from the mission speed)``, with
    l(t) the log probability that the belief of time t gives to what is true *at time t*: `normal` before the onset and
    after a repair, else the class of the worst fault (between its bursts an intermittent fault is there). It counts
    from -20 on. Since each end is taken with the truth of its own time, the rewards of an episode sum exactly to
    l(end) - l(start) minus the cost. The second in which the truth changes thus pays the whole surprise,
    l(fault) - l(normal), about -9, whatever the agent does: it is noise to a learner, but no bias.

    ## Starting State
    As `auv_fault_env/Propulsion-v0`; the diagnoser has read the first sample.

    ## Episode End
    Terminated at the end of the second by which a fault has been declared: one class with a probability of at least
    `declare` for 1 s, be it the right one or not. Truncated by the registration after 120 decisions (120 s).

    ## Information
    `cost`: mean squared offset of the commands of the second [m^2/s^2]; its mean over an episode is to be compared with
    the budget squared. `mission_speed` [m/s], `energy` [J of the second], `declared` (class, `normal` for none), and
    `truth` as in `auv_fault_env/Propulsion-v0` (whose `label` is `normal` between the bursts of an intermittent fault).

    ## Arguments
    ```python
    gym.make(
        "training.active_env:auv_fault_env/ActiveDiagnosis-v0",
        diagnoser="filter_bank",
        amplitude=0.25,
        budget=0.0762,
        cost_weight=10.0,
        declare=0.9,
    )
    ```
    `diagnoser`: a name of `diagnosers.NAMES` or a `Recursive`. `amplitude`: offset [m/s] of the action 1. `budget`:
    root mean square of the offsets over 65 s [m/s], which `left` counts down; nothing enforces it but who reads `cost`.
    `cost_weight` [s^2/m^2]. `declare`: probability, from 0.5 on. `horizon`: decisions by which every fault of a given
    schedule must have begun; raise it along with another `max_episode_steps`.

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

    ## Version History
    * v0: first version
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        diagnoser: str | Recursive = "filter_bank",
        amplitude: float = LARGEST_OFFSET,
        budget: float = BUDGET,
        cost_weight: float = 10.0,
        declare: float = DECLARE,
        horizon: int = MAX_DECISIONS,
    ):
        settings = (diagnoser, amplitude, budget, cost_weight, declare, AutoresetMode.NEXT_STEP)
        self.lane = ActiveDiagnosisVectorEnv(1, horizon, *settings)
        self.action_space = self.lane.single_action_space
        self.observation_space = self.lane.single_observation_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode: of the given seed, or the next one of the last seed."""
        super().reset(seed=seed)
        observation, info = self.lane.reset(seed=seed, options=options)
        return observation[0], lane_info(info, 0)

    def step(self, action):
        """Hold the action for one second."""
        observation, reward, terminated, truncated, info = self.lane.step(np.asarray(action)[None])
        return (
            observation[0],
            reward.item(),
            terminated.item(),
            truncated.item(),
            lane_info(info, 0),
        )

    def close(self):
        """End the fleet's threads."""
        self.lane.close()


gym.register(
    id=NAME,
    entry_point="training.active_env:ActiveDiagnosisEnv",
    vector_entry_point="training.active_env:ActiveDiagnosisVectorEnv",
    max_episode_steps=MAX_DECISIONS,
)
