"""A fleet: n vehicles as arrays, stepped together. The only mutable object of the package."""

import itertools
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from auv_fault_env import episodes, lanes, layout
from auv_fault_env.channels import CHANNELS, COMMANDS
from auv_fault_env.compiling import n_threads
from auv_fault_env.errors import finite_in_range, one_per_lane, refusal, whole_number
from auv_fault_env.faults import CATALOGUE, matrices
from auv_fault_env.missions import Mission, MissionSampler, mission_of
from auv_fault_env.noise import STREAMS, episode_keys, uniforms
from auv_fault_env.parameters import (
    PARAMETERS,
    SAMPLE_RATE,
    Vehicle,
    nominal,
    vehicle_of,
)
from auv_fault_env.physics import plant_constants
from auv_fault_env.schedules import (
    Events,
    Schedule,
    ScheduleSampler,
    events_of,
    no_events,
    schedule_of,
)

PARALLEL_LANES = 512  # below, waking the threads costs more than they save


class Fleet:
    """n vehicles, each with its own healthy parameters, faults, mission and noise; arrays throughout.

    Lane k with seed s is the same vehicle, bit for bit, in any fleet of any size, serial or
    parallel. The noise depends on (seed, episode, step, channel) alone, so the same seed with an
    empty schedule is the exact fault-free twin.

    Parameters
    ----------
    n_lanes
        Number of vehicles, at least 1.
    preset
        Name in `PRESETS`, or a `Vehicle`.
    sensor_noise
        Factor on the readings' standard deviations; 0 for none.
    disturbance
        Factor on the disturbing acceleration; 0 for none.
    healthy_band
        Factor on the spread of healthy vehicles; 0 for the nominal one.
    parallel
        Share the blocks among threads, `compiling.n_threads` of them. By default in fleets of at
        least 512 lanes.
    schedules
        Distribution of the schedules of lanes that are reset without one.
    missions
        Distribution of the missions of lanes that are reset without one.

    Attributes
    ----------
    arrays, limits, constants, catalogue
        What the kernels read and write: `layout.Lanes`; full scale of the channels (n_channels, 2);
        `PlantConstants` as an array; `layout.Catalogue`.
    diagnoses
        Diagnosis class of every fault of the catalogue, (n_faults,).
    outcomes
        (4, n_lanes) of the last step: reward, energy [J], cost [m^2/s^2], mission speed [m/s].
    changes
        Grows whenever a lane's faults, parameters or mission may have changed.
    """

    def __init__(
        self,
        n_lanes: int,
        preset: str | Vehicle = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        parallel: bool | None = None,
        schedules: ScheduleSampler | None = None,
        missions: MissionSampler | None = None,
    ):
        self.n_lanes = whole_number("number of lanes", n_lanes)
        self.vehicle = vehicle_of(preset)
        self.schedules = schedules or ScheduleSampler()
        self.missions = missions or MissionSampler()
        scale = dict(sensor_noise=sensor_noise, disturbance=disturbance, healthy_band=healthy_band)
        for name, value in scale.items():
            finite_in_range(name, value, 0.0, 10.0)
        self._shares = _shares(
            self.n_lanes, self.n_lanes >= PARALLEL_LANES if parallel is None else parallel
        )
        self._threads: ThreadPoolExecutor | None = None
        self._process = 0
        self._nominal = np.array(list(nominal(self.vehicle, sensor_noise).values()))
        self._band = healthy_band * np.array([spec.band for spec in PARAMETERS.values()])
        self.constants = np.array(plant_constants(self.vehicle, disturbance))
        self.limits = np.array([(channel.low, channel.high) for channel in CHANNELS.values()])
        self._read_catalogue()
        self._allocate(self.schedules.EVENTS, self.missions.n_legs)

    def _read_catalogue(self):
        self._faults = tuple(CATALOGUE.values())
        self.catalogue = matrices()
        self.diagnoses = np.array([fault.diagnosis for fault in self._faults])

    def _allocate(self, n_events: int, n_legs: int):
        n = self.n_lanes
        blocks = -(-self.n_lanes // layout.LANES)
        self.state = layout.FleetState(
            np.zeros((blocks, layout.N_ROWS * layout.LANES)),
            np.zeros(n, np.uint64),
            np.zeros(n, np.int64),
            np.full(n, episodes.UPDATE_NOW, np.int64),
        )
        self._plan = layout.EpisodePlan(
            np.tile(self._nominal, (n, 1)),
            *no_events(n, n_events),
            np.zeros((n, n_events)),
            np.full((n, n_legs, 2), np.inf),
        )
        self._seed = np.zeros(n, np.uint64)
        self._episode = np.zeros(n, np.uint64)
        self._due = n
        self.changes = 0
        self.outcomes = np.zeros((4, n))

    def reset(
        self,
        seeds: np.ndarray | Sequence[int] | None = None,
        lanes: np.ndarray | None = None,
        schedules: Sequence[Schedule] | None = None,
        missions: Sequence[Mission] | None = None,
        observations: np.ndarray | None = None,
    ) -> np.ndarray:
        """Start an episode on some lanes.

        Parameters
        ----------
        seeds
            One per chosen lane: start that seed's first episode. None: go on to the next episode of
            the old one.
        lanes
            Indices (m,) of the lanes; None for all.
        schedules
            One per chosen lane; None: drawn from the sampler.
        missions
            One per chosen lane; None: drawn from the sampler.
        observations
            (n_lanes, n_channels) float32 to write the chosen rows of.

        Returns
        -------
        The observations, (n_lanes, n_channels) float32; rows of lanes not chosen are as they were, or zero.
        """
        chosen = self._chosen(lanes)
        observations = self._checked_observations(observations)
        if seeds is not None:
            seeds = [
                whole_number("seed", seed, 0) for seed in one_per_lane("seeds", seeds, chosen.size)
            ]
        events, legs = _planned(schedules, missions, chosen.size)
        key = self._next_episode(chosen, seeds)
        place = 2.0 * uniforms(key, STREAMS["healthy_parameters"], len(PARAMETERS)) - 1.0
        self._plan.healthy[chosen] = self._nominal * (1.0 + self._band * place)
        self._set_events(chosen, self.schedules.sample_events(key) if events is None else events)
        legs, speeds = self.missions.sample_legs(key) if legs is None else legs
        self._set_legs(chosen, legs)
        self.outcomes = self.outcomes.copy()
        arrays = (
            self._plan,
            self.catalogue,
            self.limits,
            self.constants,
            observations,
            self.outcomes,
        )
        episodes.start_episodes(self.state, chosen, speeds, *arrays)
        self.changes += 1
        return observations

    def _next_episode(self, chosen: np.ndarray, seeds: list[int] | None) -> np.ndarray:
        if seeds is None:
            self._episode[chosen] += np.uint64(1)
        else:
            self._seed[chosen] = np.array([seed % 2**64 for seed in seeds], np.uint64)
            self._episode[chosen] = 0
        self.state.key[chosen] = episode_keys(self._seed[chosen], self._episode[chosen])
        return self.state.key[chosen]

    def _checked_observations(self, observations: np.ndarray | None) -> np.ndarray:
        shape = (self.n_lanes, len(CHANNELS))
        if observations is None:
            return np.zeros(shape, np.float32)
        if observations.shape != shape or observations.dtype != np.float32:
            got = f"{observations.dtype} {observations.shape}"
            raise refusal("observations", got, f"float32 {shape}", "make them so")
        return observations

    def _chosen(self, lanes: np.ndarray | None) -> np.ndarray:
        if lanes is None:
            return np.arange(self.n_lanes)
        if not self.changes:
            raise refusal(
                "lanes", lanes, "None, all lanes, at the first reset", "reset all lanes first"
            )
        chosen = np.asarray(lanes)
        whole = (
            chosen.ndim == 1 and chosen.dtype.kind in "iu" and np.unique(chosen).size == chosen.size
        )
        if not whole or (chosen.size and not 0 <= chosen.min() <= chosen.max() < self.n_lanes):
            raise refusal(
                "lanes",
                lanes,
                f"different whole numbers from 0 to {self.n_lanes - 1}",
                "give indices",
            )
        return chosen.astype(np.int64)

    def _set_events(self, chosen: np.ndarray, events: Events):
        if self._faults != tuple(CATALOGUE.values()):
            self._read_catalogue()
        width = events.fault.shape[1]
        plan = self._plan
        empty = no_events(self.n_lanes, max(width, plan.fault.shape[1]))
        fault = _widened(plan.fault, empty.fault)
        profile = _widened(plan.profile, empty.profile)
        severity = _widened(plan.severity, np.zeros(fault.shape))
        self._plan = plan._replace(fault=fault, profile=profile, severity=severity)
        for values, blank, given in zip((fault, profile), empty, events, strict=True):
            values[chosen] = blank[chosen]
            values[chosen, :width] = given

    def _set_legs(self, chosen: np.ndarray, legs: np.ndarray):
        blank = np.full((self.n_lanes, max(legs.shape[1], self._plan.legs.shape[1]), 2), np.inf)
        self._plan = self._plan._replace(legs=_widened(self._plan.legs, blank))
        self._plan.legs[chosen] = np.inf
        self._plan.legs[chosen, : legs.shape[1]] = legs

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Advance every lane by one sample of 0.1 s.

        Parameters
        ----------
        actions
            (n_lanes, 3): speed command [m/s], rudder and stern plane [rad]; clipped to the
            channels' limits.

        Returns
        -------
        New observations, (n_lanes, n_channels) float32; rewards and costs stand in `outcomes`.
        """
        return self.advance(checked_actions(actions, (self.n_lanes, 3)))

    def advance(self, actions: np.ndarray) -> np.ndarray:
        """As `step`, for actions that `checked_actions` has let through."""
        if not self.changes:
            raise refusal(
                "step", "no reset before", "a step after a reset of all lanes", "call reset() first"
            )
        if self._due:
            episodes.update_due_lanes(self.state, self._plan, self.catalogue)
            self.changes += 1
        observations = np.empty((self.n_lanes, len(CHANNELS)), np.float32)
        self.outcomes = np.empty((4, self.n_lanes))
        arrays = (*self.state, actions, self.limits, self.constants, observations, self.outcomes)
        self._due = self._step_blocks(arrays)
        return observations

    def close(self) -> None:
        """End the threads; the next step in parallel would start them again."""
        if self._threads is not None:
            self._threads.shutdown()
            self._threads = None

    def __getstate__(self):
        """Threads stay with their process; a copy starts its own."""
        return self.__dict__ | {"_threads": None}

    def _step_blocks(self, arrays: tuple[np.ndarray, ...]) -> int:
        if len(self._shares) == 1:
            return lanes.step_blocks(*self._shares[0], *arrays)
        if self._threads is None or self._process != os.getpid():  # threads do not survive a fork
            self._threads = ThreadPoolExecutor(len(self._shares) - 1)
            self._process = os.getpid()
        others = [
            self._threads.submit(lanes.step_blocks, *share, *arrays) for share in self._shares[1:]
        ]
        return lanes.step_blocks(*self._shares[0], *arrays) + sum(
            other.result() for other in others
        )

    def set_healthy(self, values: np.ndarray) -> None:
        """Replace the healthy parameters from the next step on: (n_lanes, n_parameters), ordered as `PARAMETERS`."""
        values = np.asarray(values, np.float64)
        if values.shape != self._plan.healthy.shape or not np.isfinite(values).all():
            allowed = f"finite numbers of shape {self._plan.healthy.shape}"
            raise refusal("healthy parameters", values, allowed, "give one row per lane")
        self._plan.healthy[:] = values
        self._refresh_all()

    def replan(
        self, schedules: Sequence[Schedule] | None = None, missions: Sequence[Mission] | None = None
    ) -> None:
        """Replace schedules, missions or both, one per lane, from the next step on; times count from the reset."""
        if not self.changes:
            raise refusal(
                "replan",
                "no reset before",
                "another plan after a reset of all lanes",
                "call reset() first",
            )
        events, legs = _planned(schedules, missions, self.n_lanes)
        if events is not None:
            self._set_events(np.arange(self.n_lanes), events)
        if legs is not None:
            self._set_legs(np.arange(self.n_lanes), legs[0])
        self._refresh_all()

    def _refresh_all(self):
        self.state.next_update[:] = episodes.UPDATE_NOW
        self._due = self.n_lanes

    @property
    def table(self) -> np.ndarray:
        """The memory as a view, (n_blocks, N_ROWS, LANES); see `layout`."""
        return self.state.memory.reshape(-1, layout.N_ROWS, layout.LANES)

    @property
    def plan(self) -> layout.EpisodePlan:
        """Healthy parameters, fault events, severities in force and mission legs of every lane."""
        return self._plan

    @property
    def time(self) -> np.ndarray:
        """Time since the episode's start [s], (n_lanes,)."""
        return self.state.step / SAMPLE_RATE


def checked_actions(actions, shape: tuple[int, ...]) -> np.ndarray:
    """The actions as contiguous float64 if they are finite numbers of that shape, else a refusal."""
    names = COMMANDS[1:]
    try:
        actions = np.ascontiguousarray(actions, np.float64)
    except (TypeError, ValueError):
        raise refusal(
            "action", actions, f"numbers of shape {shape}", f"give {', '.join(names)}"
        ) from None
    if actions.shape != shape:
        raise refusal("shape of the action", actions.shape, shape, f"give {', '.join(names)}")
    finite = (
        all(map(math.isfinite, actions.tolist()))
        if actions.ndim == 1
        else np.isfinite(actions).all()
    )
    if not finite:
        place = tuple(np.argwhere(~np.isfinite(actions))[0])
        raise refusal(
            f"action, {names[place[-1]]}",
            float(actions[place]),
            "a finite number",
            "check the policy",
        )
    return actions


def _shares(n_lanes: int, parallel: bool) -> list[tuple[int, int]]:
    """First and last block of every thread. Plain threads: OpenMP's spin on shared cores, and abort in a fork."""
    blocks = -(-n_lanes // layout.LANES)
    threads = min(n_threads(), blocks) if parallel else 1
    edges = np.linspace(0, blocks, threads + 1).astype(int).tolist()
    return list(itertools.pairwise(edges))


def _widened(values: np.ndarray, blank: np.ndarray) -> np.ndarray:
    """The values, with the columns that only `blank` has behind them."""
    missing = blank[:, values.shape[1] :]
    return np.concatenate([values, missing], axis=1) if missing.size else values


def _planned(
    schedules: Sequence[Schedule] | None, missions: Sequence[Mission] | None, n_lanes: int
) -> tuple[Events | None, tuple[np.ndarray, np.ndarray] | None]:
    """Events of the schedules, legs and start speeds of the missions, one per lane; None stays None."""
    events = legs = None
    if schedules is not None:
        events = events_of(
            [schedule_of(one) for one in one_per_lane("schedules", schedules, n_lanes)]
        )
    if missions is not None:
        legs = _legs_of([mission_of(one) for one in one_per_lane("missions", missions, n_lanes)])
    return events, legs


def _legs_of(missions: Sequence[Mission]) -> tuple[np.ndarray, np.ndarray]:
    legs = np.full((len(missions), max(len(mission.legs) for mission in missions), 2), np.inf)
    for lane, mission in enumerate(missions):
        legs[lane, : len(mission.legs)] = mission.legs
    return legs, np.array([mission.start_speed for mission in missions])
