"""Faults on one environment."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from auv_fault_env.schedules import Event, ScheduleSampler
from auv_fault_env.truth import known_level
from auv_fault_env.wrappers.injection import Injection, schedule_of_faults
from auv_fault_env.wrappers.options import inner_options, need_no_other_truth
from auv_fault_env.wrappers.signal_faults import SignalFault

LANE = np.zeros(1, np.int64)


class FaultInjection(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Faults on the observations and actions of any environment, on a schedule.

    The spaces stay: a faulty channel saturates at their limits, so that a fault beyond them does
    not show. A channel without a fault, or at severity 0, stays bit for bit. Rewards, ends and the
    information of the environment are those of its true state under the actions that arrive.

    An observation and the action that answers it have the same time, counted from the reset in
    steps of `sample_time`. A fault acts from the first sample at or after its onset: on that
    observation, or on the action that answers it, whose effect the next observation shows first.

    The noise of the faults and the sampled schedules depend on the seed of the episode alone. They
    take no random number from the environment: with an empty schedule it is the fault-free twin.

    ``reset(options={"schedule": ...})`` gives the schedule of one episode; the other options are
    those of the environment. `classes` are ``"normal"`` and the names of the faults, in the order
    of `true_class`.

    Parameters
    ----------
    env
        Any environment with a `Box` of floats where faults act.
    faults
        By name, each a `SignalFault` or a mapping of its fields.
    schedules
        Of every episode: a sequence of events (mappings with the fields of
        `auv_fault_env.schedules.Event`), the path of a JSON file, or for random ones a
        `ScheduleSampler` without a `prior` or a mapping of its fields. By default there is none.
    sample_time
        Time of a step [s]. At 1, the default, the times of schedules are numbers of steps.
    truth
        How much of it the information has, as in `auv_fault_env.truth`: ``"label"``, ``"full"`` or
        False. The dictionary `truth` has `label`, `severity` (by fault) and `onset` [s] of the
        first fault.

    Examples
    --------
    >>> import gymnasium as gym
    >>> from auv_fault_env.wrappers import FaultInjection, SignalFault
    >>> bias = SignalFault("bias", "observation", channel=2, size=0.5)
    >>> event = {"fault": "rate_bias", "onset": 3, "severity": 0.4}
    >>> env = FaultInjection(gym.make("Pendulum-v1"), {"rate_bias": bias}, [event])
    >>> observation, info = env.reset(seed=1)
    >>> for _ in range(3):
    ...     observation, reward, terminated, truncated, info = env.step([0.0])
    >>> print(env.classes[info["true_class"]], observation[2] - env.unwrapped.state[1])
    rate_bias 0.2...
    """

    def __init__(
        self,
        env: gym.Env,
        faults: Mapping[str, SignalFault | Mapping],
        schedules: Sequence[Event | Mapping] | str | Path | Mapping | ScheduleSampler = (),
        sample_time: float = 1.0,
        truth: str | bool = "label",
    ):
        gym.Wrapper.__init__(self, env)
        self._injection = Injection(
            1,
            faults,
            env.observation_space,
            env.action_space,
            schedules,
            sample_time,
        )
        self._level = known_level(truth)
        plain = self._injection.plain()
        gym.utils.RecordConstructorArgs.__init__(self, truth=truth, **plain)
        # of the injection, when the truth was read
        self._changes = 0

    @property
    def classes(self) -> tuple[str, ...]:
        """``"normal"`` and the names of the faults."""
        return self._injection.classes

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start the first episode of the seed; without a seed the next episode of the last one."""
        given, options = inner_options(options, ("schedule",))
        schedules = None
        if "schedule" in given:
            schedules = [schedule_of_faults(given["schedule"], self._injection.faults)]
        observation, info = self.env.reset(seed=seed, options=options)
        need_no_other_truth(info)
        if seed is None and not self._injection.changes:
            seed = self.env.unwrapped.np_random_seed
        self._injection.start(LANE, [seed], schedules)
        return self._injection.observed(observation), info | self._information()

    def step(self, action):
        """Take the action as it arrives."""
        action = self._injection.acted(action)
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._injection.advance()
        observation = self._injection.observed(observation)
        return observation, reward, terminated, truncated, info | self._information()

    def _information(self) -> dict[str, Any]:
        """The truth in numpy scalars; it is kept between changes."""
        if not self._level:
            return {}
        if self._changes != self._injection.changes:
            self._read_truth()
        if self._level != "full":
            return {"true_class": self._class}
        truth = {"label": self._label, "severity": self._severity.copy(), "onset": self._onset}
        return {"true_class": self._class, "truth": truth}

    def _read_truth(self) -> None:
        self._changes = self._injection.changes
        all_lanes = self._injection.truth(self._level)
        self._class = all_lanes["true_class"][0]
        if self._level == "full":
            truth = all_lanes["truth"]
            self._label = self.classes[self._class]
            self._severity = {name: severity[0] for name, severity in truth["severity"].items()}
            self._onset = truth["onset"][0]
