"""The faults of lanes of any environment: what is planned, how far it has gone, what arrives."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.faults import NORMAL
from auv_fault_env.layout import SeverityProfile
from auv_fault_env.noise import GOLDEN, episode_keys
from auv_fault_env.schedules import (
    Event,
    Events,
    Schedule,
    ScheduleDistribution,
    ScheduleSampler,
    events_of,
    first_onset,
    no_events,
    plain_events,
    schedule_of,
    with_events,
)
from auv_fault_env.truth import severities, worst_class
from auv_fault_env.wrappers import channels
from auv_fault_env.wrappers.signal_faults import ACTION, OBSERVATION, SignalFault, faults_of

DTYPES = {np.dtype(name): name for name in ("float32", "float64")}
# streams of the noise of actions, above those of all channels of observations
ACTION_STREAM = 1 << 32
IN_SECONDS = [name in ("onset", "ramp", "end", "period") for name in SeverityProfile._fields]
REMEDY = {
    OBSERVATION: "wrap the environment in FlattenObservation or DtypeObservation",
    ACTION: "leave faults of the action out",
}


class Plan(NamedTuple):
    """The faults of all lanes and their severities at the present step."""

    fault: np.ndarray  # (n_lanes, n_events) place among the faults' names, -1 for none
    profile: np.ndarray  # (n_lanes, n_events, 6), each a `SeverityProfile`; times in steps
    severity: np.ndarray  # (n_lanes, n_events)


class Start(NamedTuple):
    """What is planned for lanes that start an episode."""

    events: Events  # times in steps
    onset: np.ndarray  # (n_lanes,) of the first event [s]


class FaultyChannels:
    """The channels of observations or actions that faults can change, of all lanes."""

    def __init__(
        self,
        target: str,
        n_lanes: int,
        faults: Mapping[str, SignalFault],
        space: gym.Space,
    ):
        ours = [fault for fault in faults.values() if fault.target == target]
        # whether the faults of the present episodes are among them
        self.is_active = False
        self._is_ours = np.array([fault.target == target for fault in faults.values()])
        if not ours:
            return
        self._target = target
        self._shape = _checked_shape(target, space, faults)
        self._n_values = n_lanes * int(np.prod(self._shape))
        self._dtype = space.dtype
        self._channels = np.unique([fault.channel for fault in ours])
        self._place = np.full((len(faults), 2), -1)
        self._place[self._is_ours] = [
            (np.searchsorted(self._channels, fault.channel), fault.parameter) for fault in ours
        ]
        self._effect = np.array([(fault.scale, fault.offset) for fault in faults.values()])
        first_stream = ACTION_STREAM if target == ACTION else 0
        self._stream = (self._channels + first_stream).astype(np.uint64)
        largest = np.finfo(space.dtype).max
        limits = np.stack([space.low.ravel(), space.high.ravel()], axis=1)[self._channels]
        self._limits = np.clip(limits, -largest, largest).astype(np.float64)
        delays = [fault.size for fault in ours if fault.parameter == channels.DELAY]
        n_history = 1 + int(sum(delays))
        self._history = np.zeros((n_lanes, self._channels.size, n_history))
        self._reported = np.zeros((n_lanes, self._channels.size))

    def follow(self, faults: np.ndarray) -> None:
        """Note whether some of the faults of the present episodes are of these channels."""
        self.is_active = bool(self._is_ours[faults].any())

    def arriving(self, values, plan: Plan, step: np.ndarray, key: np.ndarray) -> np.ndarray:
        """What arrives of the values (n_lanes, ...): a new array, the same on other channels."""
        arrived = np.array(values, order="C")
        n_lanes = len(step)
        if arrived.size != self._n_values:
            allowed = f"{n_lanes} of shape {self._shape}"
            raise refusal(self._target, values, allowed, "give an element of the space")
        if arrived.dtype not in DTYPES:
            arrived = arrived.astype(self._dtype)
        channels.apply_faults(
            arrived.reshape(n_lanes, -1),
            step,
            key,
            plan.fault,
            plan.severity,
            self._place,
            self._effect,
            self._channels,
            self._stream,
            self._limits,
            self._history,
            self._reported,
        )
        return arrived


def _checked_shape(
    target: str, space: gym.Space, faults: Mapping[str, SignalFault]
) -> tuple[int, ...]:
    """The shape of a space in which the faults have their channels, else a refusal."""
    if not isinstance(space, gym.spaces.Box) or space.dtype not in DTYPES:
        allowed = f"a Box of {' or '.join(DTYPES.values())} for faults of the {target}"
        raise refusal(f"{target} space", space, allowed, REMEDY[target])
    n_channels = int(np.prod(space.shape))
    for name, fault in faults.items():
        if fault.target == target and fault.channel >= n_channels:
            allowed = f"0 to {n_channels - 1} of {space}"
            raise refusal(f"channel of {name}", fault.channel, allowed, "count from 0")
    return space.shape


def schedules_of_argument(
    value: Sequence | str | Path | Mapping | ScheduleSampler, faults: Mapping[str, SignalFault]
) -> Schedule | ScheduleSampler:
    """A schedule for every episode, or a sampler of schedules, if they have known faults only."""
    if not isinstance(value, Mapping | ScheduleDistribution):
        return schedule_of_faults(value, faults)
    sampler = ScheduleDistribution.of(value, ScheduleSampler)
    if not isinstance(sampler, ScheduleSampler):
        allowed = "a schedule, a ScheduleSampler or a mapping of its fields"
        raise refusal("schedules", type(sampler).__name__, allowed, "give one of them")
    if sampler.prior:
        allowed = "an empty one, as the faults of a wrapper are equally likely"
        raise refusal("prior", dict(sampler.prior), allowed, "leave it out")
    return sampler


def schedule_of_faults(value, faults: Mapping[str, SignalFault]) -> Schedule:
    """The schedule, if it has known faults only."""
    schedule = schedule_of(value, Event)
    for event in schedule:
        known_name("fault", event.fault, faults)
    return schedule


class Injection:
    """The faults of all lanes of an environment, lane by lane on its own clock."""

    def __init__(
        self,
        n_lanes: int,
        faults: Mapping[str, SignalFault | Mapping],
        observation_space: gym.Space,
        action_space: gym.Space,
        schedules: Sequence | str | Path | Mapping | ScheduleSampler,
        sample_time: float,
    ):
        self.n_lanes = n_lanes
        self.faults = faults_of(faults)
        self.classes = (NORMAL, *self.faults)
        self.schedules = schedules_of_argument(schedules, self.faults)
        self.sample_time = finite_in_range("sample_time", sample_time, 1e-9, 1e9)
        self.observation = FaultyChannels(OBSERVATION, n_lanes, self.faults, observation_space)
        self.action = FaultyChannels(ACTION, n_lanes, self.faults, action_space)
        # of the plan and the severities since the beginning; 0 before the first start
        self.changes = 0
        self._step = np.zeros(n_lanes, np.int64)
        self._key = np.zeros(n_lanes, np.uint64)
        self._seed = np.zeros(n_lanes, np.uint64)
        self._episode = np.zeros(n_lanes, np.uint64)
        self._onset = np.full(n_lanes, math.inf)
        self._events = no_events(n_lanes, 0)
        self._class_of_fault = np.arange(1, len(self.classes))
        self._every_time: Start | None = None
        if not isinstance(self.schedules, ScheduleSampler):
            self._every_time = self._start_of([self.schedules] * n_lanes)

    def plain(self) -> dict[str, Any]:
        """The arguments as JSON has them."""
        schedules = self.schedules
        is_sampled = isinstance(schedules, ScheduleSampler)
        return {
            "faults": {name: asdict(fault) for name, fault in self.faults.items()},
            "schedules": schedules.plain() if is_sampled else plain_events(schedules),
            "sample_time": self.sample_time,
        }

    def start(
        self,
        lanes: np.ndarray,
        seeds: Sequence[int | None],
        schedules: Sequence[Schedule] | None = None,
    ) -> None:
        """Start an episode on these lanes (m,), with one seed each, None for the next episode."""
        for lane, seed in zip(lanes, seeds, strict=True):
            self._episode[lane] += np.uint64(1)
            if seed is not None:
                self._seed[lane] = seed % 2**64
                self._episode[lane] = 0
        # another key than that of an environment of this package with the same seed
        key = episode_keys(self._seed[lanes] ^ GOLDEN, self._episode[lanes])
        start = self._drawn(key) if schedules is None else self._start_of(schedules)
        self._key[lanes] = key
        self._step[lanes] = 0
        self._onset[lanes] = start.onset
        is_all = len(lanes) == self.n_lanes
        self._events = start.events if is_all else with_events(self._events, lanes, start.events)
        self._plan = Plan(*self._events, np.zeros(self._events.fault.shape))
        faults = self._events.fault[self._events.fault >= 0]
        self._has_events = bool(faults.size)
        self.observation.follow(faults)
        self.action.follow(faults)
        self.changes += 1
        self.advance(0)

    def _start_of(self, schedules: Sequence[Schedule]) -> Start:
        """The start of episodes with these schedules."""
        return self._in_steps(events_of(schedules, self.faults))

    def _drawn(self, key: np.ndarray) -> Start:
        """The start of episodes whose schedule is not given, from their keys (m,)."""
        if self._every_time is not None:
            fault, profile = self._every_time.events
            n = len(key)
            events = Events(fault[:n].copy(), profile[:n].copy())
            return Start(events, self._every_time.onset[:n])
        n_faults = len(self.faults)
        least = np.zeros(n_faults)
        weights = np.full(n_faults, 1.0 / n_faults)
        return self._in_steps(self.schedules.events_among(key, weights, least))

    def _in_steps(self, events: Events) -> Start:
        """The start with these events: times in whole steps, where rounding alone prevents it."""
        onset = first_onset(events)
        in_steps = np.round(events.profile[..., IN_SECONDS] / self.sample_time, 9)
        events.profile[..., IN_SECONDS] = in_steps
        return Start(events, onset)

    def advance(self, n_steps: int = 1) -> None:
        """Go on by some samples on all lanes."""
        if self._has_events:
            plan = self._plan
            self.changes += channels.update_severities(
                self._step, n_steps, plan.profile, plan.severity
            )

    def observed(self, observations):
        """The observations (n_lanes, ...) as they arrive."""
        if not self.observation.is_active:
            return observations
        return self.observation.arriving(observations, self._plan, self._step, self._key)

    def acted(self, actions):
        """The actions (n_lanes, ...) as they arrive."""
        if not self.action.is_active:
            return actions
        return self.action.arriving(actions, self._plan, self._step, self._key)

    def truth(self, level: str | bool) -> dict[str, Any]:
        """The truth for the information of a step, as new arrays (n_lanes,)."""
        if not level:
            return {}
        true_class = worst_class(self._plan, self._class_of_fault)
        truth = {"true_class": true_class}
        if level == "full":
            truth["truth"] = {
                "label": np.array(self.classes)[true_class],
                "severity": severities(self._plan, self._class_of_fault, self.classes),
                "onset": self._onset.copy(),
            }
        return truth
