"""A fleet: many vehicles as arrays, stepped together."""

import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from auv_fault_env import episodes, lanes, layout, sensors
from auv_fault_env.actions import ACTIONS, WITH_SHIFT, actions_of, checked_actions
from auv_fault_env.channels import CHANNELS
from auv_fault_env.compiling import n_threads
from auv_fault_env.errors import (
    finite_in_range,
    one_per_lane,
    refusal,
    whole_number,
)
from auv_fault_env.faults import Fault, classes, matrices
from auv_fault_env.healthy import HealthyVehicles
from auv_fault_env.missions import Mission, MissionDistribution, MissionSampler, legs_of, mission_of
from auv_fault_env.noise import STREAMS, episode_keys, uniforms
from auv_fault_env.parameters import (
    PARAMETERS,
    SAMPLE_RATE,
    SIDES,
    Vehicle,
    channels_of,
    full_scale_factors,
    vehicle_of,
)
from auv_fault_env.physics import plant_constants
from auv_fault_env.realism import kernel_values, known_effects
from auv_fault_env.schedules import (
    Events,
    Schedule,
    ScheduleDistribution,
    ScheduleSampler,
    events_of,
    no_events,
    schedule_of,
    widened,
    with_events,
)
from auv_fault_env.thrust_shift import (
    LARGEST_SHIFT,
    RUDDER_PER_SHIFT,
    lower_integrals,
    raise_integrals,
)
from auv_fault_env.unmodelled import plant_faults

# columns of the parameters that only the kernel with imperfections reads
SIGNAL_PARAMETERS = slice(layout.SIGNALS - layout.PARAMETER, None)
PARALLEL_LANES = 512  # below, waking the threads costs more than they save


class Fleet:
    """Many vehicles, each with its own healthy parameters, faults, mission and noise.

    Lane k with seed s is the same vehicle, bit for bit, in any fleet of any size, serial or
    parallel. The noise depends on (seed, episode, step, channel) alone, so the same seed with an
    empty schedule is the exact fault-free twin.

    Parameters
    ----------
    n_lanes
        Number of vehicles.
    preset
        Name in `PRESETS`, or a `Vehicle`.
    sensor_noise, disturbance, healthy_band
        Factors on the standard deviations of the readings, on the disturbing acceleration and on
        the width of the healthy band; 0 for none.
    parallel
        Whether `compiling.n_threads` threads share the blocks; by default from 512 lanes on.
    schedules, missions
        Distributions for lanes that are reset without a schedule or a mission.
    realism
        Factor on the imperfections of real sensors and surroundings, 0 to 10; 0 for none.
    imperfections
        Names of the imperfections that act, of `realism.EFFECTS`; None for all.
    more_faults
        Faults in rows after those of `plant_faults`, which only `Events` can name.
    band, noise
        Where not the default: relative half-width of the healthy band by parameter of `Vehicle`;
        standard deviation by reading [its unit]. The factors above multiply them.

    Attributes
    ----------
    state, plan, catalogue
        What the kernels share, see `layout`.
    effects
        `realism.kernel_values`, or None as long as no lane needs them.
    limits
        Full scale of the channels, (n_channels, 2).
    constants
        `PlantConstants` as an array.
    diagnoses
        Diagnosis class of every fault: those of `plant_faults`, then `more_faults`, (n_faults,).
    class_of_fault
        Index of that class in `faults.classes()`, (n_faults,).
    outcomes
        (4, n_lanes) of the last step: reward, energy [J], cost [m^2/s^2], mission speed [m/s].
    changes
        Counts the times at which faults, parameters or missions may have changed.
    """

    def __init__(
        self,
        n_lanes: int,
        preset: str | Vehicle = "thesis1992",
        sensor_noise: float = 1.0,
        disturbance: float = 1.0,
        healthy_band: float = 1.0,
        parallel: bool | None = None,
        schedules: ScheduleDistribution | None = None,
        missions: MissionDistribution | None = None,
        realism: float = 0.0,
        imperfections: Sequence[str] | None = None,
        more_faults: Sequence[Fault] = (),
        band: Mapping[str, float] | None = None,
        noise: Mapping[str, float] | None = None,
    ):
        self.n_lanes = whole_number("number of lanes", n_lanes)
        self.vehicle = vehicle_of(preset)
        self.schedules = schedules or ScheduleSampler()
        self.missions = missions or MissionSampler()
        finite_in_range("sensor_noise", sensor_noise, 0.0, 10.0)
        finite_in_range("disturbance", disturbance, 0.0, 10.0)
        finite_in_range("healthy_band", healthy_band, 0.0, 10.0)
        finite_in_range("realism", realism, 0.0, 10.0)
        effects = known_effects(imperfections)
        if parallel is None:
            parallel = self.n_lanes >= PARALLEL_LANES
        n_blocks = -(-self.n_lanes // layout.LANES)
        self._block_ranges = _block_ranges(n_blocks, parallel)
        self._threads: ThreadPoolExecutor | None = None
        self._process = 0
        self._healthy = HealthyVehicles(
            self.vehicle,
            sensor_noise,
            healthy_band,
            band or {},
            noise or {},
            realism,
            effects,
        )
        self._realism = kernel_values(realism, effects, full_scale_factors(self.vehicle))
        self._always_real = realism > 0.0 and bool(effects)
        self.effects = None
        self.constants = np.array(plant_constants(self.vehicle, disturbance))
        limits = [(channel.low, channel.high) for channel in channels_of(self.vehicle).values()]
        self.limits = np.array(limits)
        self.more_faults = tuple(more_faults)
        self._read_catalogue()
        self._allocate(n_blocks)

    def _read_catalogue(self):
        self._faults = self._faults_now()
        self.catalogue = matrices(self._faults)
        self._changes_signal = self.catalogue.offset[:, SIGNAL_PARAMETERS].any(axis=1)
        self.diagnoses = np.array([fault.diagnosis for fault in self._faults])
        names = classes()
        self.class_of_fault = np.array([names.index(fault.diagnosis) for fault in self._faults])

    def _faults_now(self) -> tuple[Fault, ...]:
        return *plant_faults().values(), *self.more_faults

    def _allocate(self, n_blocks: int):
        n = self.n_lanes
        self.state = layout.FleetState(
            memory=np.zeros((n_blocks, layout.N_ROWS * layout.LANES)),
            key=np.zeros(n, np.uint64),
            step=np.zeros(n, np.int64),
            next_update=np.full(n, episodes.UPDATE_NOW, np.int64),
        )
        events = no_events(n, 0)
        self.plan = layout.EpisodePlan(
            healthy=np.tile(self._healthy.nominal, (n, 1)),
            fault=events.fault,
            profile=events.profile,
            severity=np.zeros((n, 0)),
            legs=np.full((n, 0, 2), np.inf),
        )
        self._seed = np.zeros(n, np.uint64)
        self._episode = np.zeros(n, np.uint64)
        self._n_due = n
        self.changes = 0
        self.outcomes = np.zeros((4, n))

    def reset(
        self,
        seeds: np.ndarray | Sequence[int] | None = None,
        lanes: np.ndarray | None = None,
        schedules: Sequence[Schedule] | Events | None = None,
        missions: Sequence[Mission] | None = None,
        observations: np.ndarray | None = None,
    ) -> np.ndarray:
        """Start an episode on some lanes; return the observations (n_lanes, n_channels), float32.

        Parameters
        ----------
        seeds
            One per lane that is reset: start the first episode of that seed. None: start the next
            episode of the present seed.
        lanes
            Indices (m,) of the lanes to reset; None for all.
        schedules, missions
            One per lane that is reset; None: from the samplers. Schedules may be `Events`.
        observations
            Where to write the rows of the lanes that are reset; None for a new array of zeros.
        """
        indices = self._lane_indices(lanes)
        observations = self._checked_observations(observations)
        if seeds is not None:
            seeds = one_per_lane("seeds", seeds, indices.size)
            seeds = [whole_number("seed", seed, 0) for seed in seeds]
        events, legs = self._possible_plan(schedules, missions, indices.size)
        key = self._next_episode(indices, seeds)
        place = 2.0 * uniforms(key, STREAMS["healthy_parameters"], len(PARAMETERS)) - 1.0
        self.plan.healthy[indices] = self._healthy.at(place)
        if events is None:
            events = self.schedules.sample_events(key, self.vehicle)
        self._set_events(indices, events)
        if legs is None:
            legs = self.missions.sample_legs(key, self.vehicle.maximum_speed)
        new_legs, speeds = legs
        self._set_legs(indices, new_legs)
        self.outcomes = self.outcomes.copy()
        shared = self.plan, self.catalogue, self.limits, self.constants, self.effects
        results = observations, self.outcomes
        episodes.start_episodes(self.state, indices, speeds, *shared, *results)
        self.changes += 1
        return observations

    def _possible_plan(
        self,
        schedules: Sequence[Schedule] | Events | None,
        missions: Sequence[Mission] | None,
        n_lanes: int,
    ) -> tuple[Events | None, tuple[np.ndarray, np.ndarray] | None]:
        """Events, legs and start speeds, as `_events_and_legs`, if the vehicle can have them."""
        events, legs = _events_and_legs(schedules, missions, n_lanes)
        if events is not None:
            self._check_faults(events)
        if legs is not None:
            speeds = legs[0][:, :, 1]
            fastest = max(speeds[np.isfinite(speeds)].max(), legs[1].max())
            finite_in_range("mission speed", float(fastest), 0.0, self.vehicle.maximum_speed)
        return events, legs

    def _check_faults(self, events: Events):
        """Refuse a fault of a shaft that the vehicle does not have."""
        if self.vehicle.sides == SIDES:
            return
        faults = self._faults_now()
        for row in np.unique(events.fault[events.fault >= 0]):
            fault = faults[row]
            if not fault.is_possible(self.vehicle):
                place = " or ".join(self.vehicle.sides)
                allowed = f"one of {place} or of the hull, as {self.vehicle.name} has one shaft"
                raise refusal("fault", fault.name, allowed, f"name that of {place}")

    def _next_episode(self, indices: np.ndarray, seeds: list[int] | None) -> np.ndarray:
        """Set and return the noise keys of the next episodes."""
        if seeds is None:
            self._episode[indices] += np.uint64(1)
        else:
            self._seed[indices] = np.array([seed % 2**64 for seed in seeds], np.uint64)
            self._episode[indices] = 0
        key = episode_keys(self._seed[indices], self._episode[indices])
        self.state.key[indices] = key
        return key

    def _checked_observations(self, observations: np.ndarray | None) -> np.ndarray:
        shape = (self.n_lanes, len(CHANNELS))
        if observations is None:
            return np.zeros(shape, np.float32)
        if observations.shape != shape or observations.dtype != np.float32:
            got = f"{observations.dtype} {observations.shape}"
            remedy = "give an array of that type and shape"
            raise refusal("observations", got, f"float32 {shape}", remedy)
        return observations

    def _lane_indices(self, lanes: np.ndarray | None) -> np.ndarray:
        """The indices of lanes to reset, if they are different whole numbers in range."""
        if lanes is None:
            return np.arange(self.n_lanes)
        if not self.changes:
            allowed = "None, all lanes, at the first reset"
            raise refusal("lanes", lanes, allowed, "reset all lanes first")
        indices = np.asarray(lanes)
        if not _are_different_lanes(indices, self.n_lanes):
            allowed = f"different whole numbers from 0 to {self.n_lanes - 1}"
            raise refusal("lanes", lanes, allowed, "give indices")
        return indices.astype(np.int64)

    def _set_events(self, indices: np.ndarray, events: Events):
        if self._faults != self._faults_now():
            self._read_catalogue()
        plan = self.plan
        fault, profile = with_events(Events(plan.fault, plan.profile), indices, events)
        severity = widened(plan.severity, np.zeros(fault.shape))
        self.plan = plan._replace(fault=fault, profile=profile, severity=severity)
        self._switch_effects()

    def _switch_effects(self):
        """Let the kernel do the work of `realism` where a lane needs it."""
        faults = self.plan.fault[self.plan.fault >= 0]
        is_needed = (
            self._always_real
            or self._changes_signal[faults].any()
            or self.plan.healthy[:, SIGNAL_PARAMETERS].any()
        )
        if is_needed and self.effects is None:
            self._fill_history()
        self.effects = self._realism if is_needed else None

    def _fill_history(self):
        """Let the signals of the sensors be what they are now since long ago."""
        table = self.table
        shape = len(table), layout.N_READINGS, layout.N_HISTORY, layout.LANES
        history = table[:, layout.HISTORY :].reshape(shape)
        for channel, row in enumerate(sensors.TRUE_ROW):
            history[:, channel] = sensors.TRUE_FACTOR[channel] * table[:, row, None]

    def _set_legs(self, indices: np.ndarray, legs: np.ndarray):
        n_legs = legs.shape[1]
        n_columns = max(n_legs, self.plan.legs.shape[1])
        blank = np.full((self.n_lanes, n_columns, 2), np.inf)
        self.plan = self.plan._replace(legs=widened(self.plan.legs, blank))
        self.plan.legs[indices] = np.inf
        self.plan.legs[indices, :n_legs] = legs

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Advance every lane by 0.1 s; return new observations (n_lanes, n_channels), float32.

        actions is (n_lanes, 3): speed command [m/s], rudder and stern plane [rad]; clipped to
        `limits`. A fourth column is the shift of thrust to port, see `thrust_shift`, of vehicles
        with two shafts. Reward, energy and cost are in `outcomes`.
        """
        with_shift = np.ndim(actions) == 2 and np.shape(actions)[1] == len(WITH_SHIFT)
        names = actions_of(self.vehicle, with_shift)
        return self.advance(checked_actions(actions, (self.n_lanes, len(names)), names))

    def advance(self, actions: np.ndarray) -> np.ndarray:
        """As `step`, for actions that `checked_actions` has accepted."""
        if not self.changes:
            allowed = "a step after a reset of all lanes"
            raise refusal("step", "no reset before", allowed, "call reset() first")
        if self._n_due:
            episodes.update_due_lanes(self.state, self.plan, self.catalogue)
            self.changes += 1
        if actions.shape[1] == len(ACTIONS):
            return self._advance_blocks(actions)
        commands = actions[:, : len(ACTIONS)].copy()
        with self._shifted_thrust(commands, actions[:, -1]):
            return self._advance_blocks(commands)

    def _advance_blocks(self, commands: np.ndarray) -> np.ndarray:
        observations = np.empty((self.n_lanes, len(CHANNELS)), np.float32)
        self.outcomes = np.empty((4, self.n_lanes))
        self._n_due = self._step_blocks(
            (
                *self.state,
                commands,
                self.limits,
                self.constants,
                self.effects,
                observations,
                self.outcomes,
            )
        )
        return observations

    @contextmanager
    def _shifted_thrust(self, commands: np.ndarray, shift: np.ndarray) -> Iterator[None]:
        """Shift the thrust (n_lanes,) of the step within; add the rudder to its commands."""
        shift = np.clip(shift, -LARGEST_SHIFT, LARGEST_SHIFT)
        commands[:, ACTIONS.index("rudder")] += RUDDER_PER_SHIFT * shift
        memory = self.state.memory
        excess = np.empty((self.n_lanes, len(SIDES)))
        raise_integrals(memory, commands, shift, self.limits, self.constants, excess)
        yield
        lower_integrals(memory, excess)

    def close(self) -> None:
        """End the threads; a later step in parallel starts them again."""
        if self._threads is not None:
            self._threads.shutdown()
            self._threads = None

    def __getstate__(self):
        """The state without the threads: a copy starts its own."""
        return self.__dict__ | {"_threads": None}

    def _step_blocks(self, arrays: tuple[np.ndarray, ...]) -> int:
        """Step all blocks; returns the number of lanes that need an update."""
        if len(self._block_ranges) == 1:
            return lanes.step_blocks(*self._block_ranges[0], *arrays)
        first, *others = self._block_ranges
        if self._threads is None or self._process != os.getpid():  # threads do not survive a fork
            self._threads = ThreadPoolExecutor(len(others))
            self._process = os.getpid()
        submit = self._threads.submit
        tasks = [submit(lanes.step_blocks, *blocks, *arrays) for blocks in others]
        n_due = lanes.step_blocks(*first, *arrays)
        return n_due + sum(task.result() for task in tasks)

    def set_healthy(self, values: np.ndarray) -> None:
        """Replace the healthy parameters (n_lanes, n_parameters) from the next step on."""
        values = np.asarray(values, np.float64)
        shape = self.plan.healthy.shape
        if values.shape != shape or not np.isfinite(values).all():
            allowed = f"finite numbers of shape {shape}"
            raise refusal("healthy parameters", values, allowed, "give one row per lane")
        self.plan.healthy[:] = values
        self._switch_effects()
        self._update_all()

    def replan(
        self,
        schedules: Sequence[Schedule] | None = None,
        missions: Sequence[Mission] | None = None,
    ) -> None:
        """Replace schedules, missions or both, one per lane; times still count from the reset."""
        if not self.changes:
            allowed = "another plan after a reset of all lanes"
            raise refusal("replan", "no reset before", allowed, "call reset() first")
        events, legs = self._possible_plan(schedules, missions, self.n_lanes)
        if events is not None:
            self._set_events(np.arange(self.n_lanes), events)
        if legs is not None:
            self._set_legs(np.arange(self.n_lanes), legs[0])
        self._update_all()

    def _update_all(self):
        self.state.next_update[:] = episodes.UPDATE_NOW
        self._n_due = self.n_lanes

    @property
    def table(self) -> np.ndarray:
        """The memory as a view, (n_blocks, N_ROWS, LANES); see `layout`."""
        return self.state.memory.reshape(-1, layout.N_ROWS, layout.LANES)

    def row(self, index: int) -> np.ndarray:
        """A copy of one row of the memory, see `layout`, (n_lanes,)."""
        return self.table[:, index].reshape(-1)[: self.n_lanes].copy()

    @property
    def observations(self) -> np.ndarray:
        """A new array of the present observations (n_lanes, n_channels), float32."""
        rows = self.table[:, : len(CHANNELS)].swapaxes(1, 2)
        return rows.reshape(-1, len(CHANNELS))[: self.n_lanes].astype(np.float32)

    @property
    def time(self) -> np.ndarray:
        """Time since the start of the episode [s], (n_lanes,)."""
        return self.state.step / SAMPLE_RATE


def _are_different_lanes(indices: np.ndarray, n_lanes: int) -> bool:
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        return False
    are_in_range = (indices >= 0) & (indices < n_lanes)
    return bool(are_in_range.all()) and np.unique(indices).size == indices.size


def _block_ranges(n_blocks: int, parallel: bool) -> list[tuple[int, int]]:
    """First block of each thread and the one after its last.

    Threads of OpenMP would occupy shared cores while they wait, and abort in a fork.
    """
    threads = min(n_threads(), n_blocks) if parallel else 1
    edges = np.linspace(0, n_blocks, threads + 1).astype(int)
    return list(itertools.pairwise(edges.tolist()))


def _events_and_legs(
    schedules: Sequence[Schedule] | Events | None,
    missions: Sequence[Mission] | None,
    n_lanes: int,
) -> tuple[Events | None, tuple[np.ndarray, np.ndarray] | None]:
    """Events of the schedules, legs and start speeds of the missions; None for what is None."""
    events = None
    legs = None
    if isinstance(schedules, Events):
        one_per_lane("schedules", schedules.fault, n_lanes)
        events = schedules
    elif schedules is not None:
        schedules = one_per_lane("schedules", schedules, n_lanes)
        events = events_of([schedule_of(schedule) for schedule in schedules])
    if missions is not None:
        missions = one_per_lane("missions", missions, n_lanes)
        legs = legs_of([mission_of(mission) for mission in missions])
    return events, legs
