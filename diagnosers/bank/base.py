"""What all banks of filters share: their settings, their nominal vehicle and their step."""

import math
import os
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from auv_fault_env import parameters as plant
from auv_fault_env.channels import CHANNELS, COMMANDS, INDEX, READINGS
from auv_fault_env.compiling import n_threads
from auv_fault_env.errors import finite_in_range, known_name, pair_in_range, refusal
from auv_fault_env.faults import classes, fault_of
from auv_fault_env.parameters import (
    PARAMETERS,
    SAMPLE_TIME,
    Vehicle,
    is_of_missing_side,
    vehicle_of,
)
from auv_fault_env.physics import PlantConstants, plant_constants
from diagnosers.bank.hypotheses import of_catalogue, possible_faults
from diagnosers.bank.pack import pack_size
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.kalman import opening_share

PARALLEL_LANES = 64  # below, waking the threads costs more than they save
# parts of a state that the kernel reads alone
KEPT = ("healthy", "prior", "age")


class BankConstants(NamedTuple):
    """What the kernel needs of a bank beside its hypotheses."""

    water: PlantConstants
    opening: float  # see `kalman.opening_share`
    disturbance_variance: float  # m^2/s^4, stationary
    disturbance_memory: float  # share that is left after a sample
    walk: float  # variance that the random walk adds to a severity per sample
    sensors: np.ndarray  # (n_readings, 4), full scale (low, high), noise, resolution


class Machinery(NamedTuple):
    """The compiled step of a bank, and what makes its memory."""

    workspace: Callable[[NamedTuple, int], NamedTuple]  # of a table and a pack's size
    new_sample: Callable[[int], NamedTuple]  # of a pack's size
    step_lanes: Callable[..., None]

    def run(
        self,
        state: NamedTuple,
        new: NamedTuple,
        observation: np.ndarray,
        table: NamedTuple,
        constants: NamedTuple,
    ) -> Belief:
        """Fill the new state from the old one and the observation; the belief of every lane."""
        shape = len(observation), len(of_catalogue(classes))
        belief = Belief(np.empty(shape), np.empty(shape), np.empty(shape))

        def step_share(first: int, last: int) -> None:
            """Step the lanes from `first` to before `last`."""
            n_pack = pack_size(last - first, table.hypothesis.size)
            self.step_lanes(
                first,
                last,
                state,
                new,
                observation,
                table,
                constants,
                belief,
                self.workspace(table, n_pack),
                self.new_sample(n_pack),
            )

        _in_shares(len(observation), step_share)
        return belief


@dataclass(frozen=True)
class Bank(Recursive):
    """A bank of filters: the normal vehicle, and every fault in some grades of severity.

    Each hypothesis has filters of surge and of both motors (shared with the normal vehicle where
    its fault has no effect). Their states are the healthy vehicle's deviations from nominal and the
    fault's severity; their likelihoods weigh the hypotheses. A fault may begin at any sample, as in
    the interacting multiple model algorithm. All probabilities are logarithms. A silent reading
    (NaN) gives no evidence.

    A subclass says how its filters begin (`initial`), what its hypotheses are (`table_of`), and
    what its kernel is (`machinery`).

    Sources: Willsky, "A survey of design methods for failure detection in dynamic systems",
    Automatica 12, 1976, doi:10.1016/0005-1098(76)90041-8; Blom & Bar-Shalom 1988,
    doi:10.1109/9.1299; de Benito 1990, as the thesis cites it.

    Attributes
    ----------
    vehicle
        Preset or nominal vehicle.
    grades
        Ranges of the severity, each a hypothesis of its own, in which the severity is a state.
    hazard
        Probability per sample that a fault begins; shared by classes, then faults, then grades.
    walk_std
        Random walk of the severity per square root of a second, for faults that grow.
    faults
        Names of the faults that are hypotheses; if None all of the catalogue that a vehicle with
        these shafts can have. The classes of the others remain in the belief with probability 0.
    shafts
        2, or 1: that of port, whose propeller gives all the thrust; starboard readings are then not
        used. None: those of the vehicle.
    band, noise, resolution
        Where not the default: relative half-width of the healthy band by parameter of `Vehicle`;
        standard deviation, and smallest step of the values, by reading [its unit].
    """

    filled_channels: ClassVar[slice] = slice(0, len(COMMANDS))
    machinery: ClassVar[Machinery]
    vehicle: str | Vehicle = "thesis1992"
    grades: tuple[tuple[float, float], ...] = ((0.1, 0.4), (0.4, 0.7), (0.7, 1.0))
    hazard: float = 1e-3
    walk_std: float = 0.015
    faults: tuple[str, ...] | None = None
    shafts: int | None = None
    band: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self):
        _with_shafts(self.vehicle, self.shafts)
        finite_in_range("hazard", self.hazard, 1e-12, 0.5)
        finite_in_range("walk_std", self.walk_std, 0.0, 10.0)
        if not isinstance(self.grades, Sequence) or not self.grades:
            raise refusal("grades", self.grades, "at least one range of severity", "give one")
        grades = tuple(pair_in_range("grade", grade, 0.0, 1.0) for grade in self.grades)
        object.__setattr__(self, "grades", grades)
        if self.faults is not None:
            names = tuple(fault_of(name).name for name in self.faults)
            object.__setattr__(self, "faults", names)
        for name, width in self.band.items():
            known_name("parameter", name, (*plant.HULL, *plant.SHAFT))
            finite_in_range(f"healthy band of {name}", width, 0.0, 1.0)
        _check_readings("noise", self.noise, 1e-9)
        _check_readings("resolution", self.resolution, 0.0)

    @property
    def classes(self) -> tuple[str, ...]:
        """The diagnosis classes of the catalogue as it is now; the hypotheses follow it too."""
        return classes()

    @property
    def healthy(self) -> np.ndarray:
        """Parameters of the nominal vehicle, (n_parameters,), with this bank's noise and shafts."""
        noise = {f"{name}_noise": std for name, std in self.noise.items()}
        parameters = plant.nominal(self._nominal) | noise
        return np.array(list(parameters.values()))

    @cached_property
    def constants(self) -> BankConstants:
        """What the kernel needs: water, noise and disturbance of the nominal vehicle."""
        vehicle = self._nominal
        channels = plant.channels_of(vehicle)
        sensors = [
            (
                channels[name].low,
                channels[name].high,
                self.noise.get(name, channels[name].noise),
                self.resolution.get(name, 0.0),
            )
            for name in READINGS
        ]
        return BankConstants(
            water=plant_constants(vehicle),
            opening=opening_share(vehicle),
            disturbance_variance=vehicle.disturbance_std**2,
            disturbance_memory=math.exp(-SAMPLE_TIME / vehicle.disturbance_time),
            walk=SAMPLE_TIME * self.walk_std**2,
            sensors=np.array(sensors),
        )

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The faults that are hypotheses, of the catalogue as it is now."""
        if self.faults is not None:
            return self.faults
        return of_catalogue(possible_faults, self._nominal)

    @cached_property
    def _nominal(self) -> Vehicle:
        """The vehicle with as many shafts as the bank has."""
        return _with_shafts(self.vehicle, self.shafts)

    @cached_property
    def _unused_channels(self) -> list[int]:
        """Columns of the readings of a shaft that does not exist."""
        return [INDEX[name] for name in READINGS if is_of_missing_side(name, self._nominal)]

    def _band_of(self, name: str) -> float:
        """Relative half-width of the healthy band of a parameter in `PARAMETERS`."""
        of_vehicle = name.removeprefix("port_").removeprefix("starboard_")
        return self.band.get(of_vehicle, PARAMETERS[name].band)

    @abstractmethod
    def table_of(self, state: Any) -> NamedTuple:
        """The hypotheses of the catalogue as it is now, of as many grades as the state has."""

    def step(self, state: Any, observation: np.ndarray) -> tuple[Any, Belief]:
        """The next state and the belief."""
        table = self.table_of(state)
        if state.log_posterior.shape[1] != table.log_hazard.size:
            change = "faults added or removed"
            raise refusal("catalogue", change, "that of the reset", "call reset(n_lanes) again")
        if self._unused_channels:
            observation = observation.copy()
            observation[:, self._unused_channels] = np.nan
        parts = state._asdict()
        empty = {name: np.empty_like(part) for name, part in parts.items() if name not in KEPT}
        new = state._replace(**empty, age=state.age + 1.0)
        belief = self.machinery.run(state, new, observation, table, self.constants)
        return new, belief


def _with_shafts(preset: str | Vehicle, shafts: int | None) -> Vehicle:
    """The vehicle with that many shafts, None for its own; other numbers are refused."""
    vehicle = vehicle_of(preset)
    return vehicle if shafts is None else replace(vehicle, shafts=shafts)


def prior_severity(prior: np.ndarray, table: NamedTuple) -> np.ndarray:
    """Mean and variance of the severity of each hypothesis, (n_lanes, 2, n_hypotheses)."""
    severity = np.ascontiguousarray(prior[:, :2, table.grade])
    severity[:, :, 0] = 0.0
    return severity


def _check_readings(kind: str, numbers: Mapping[str, float], least: float) -> None:
    """Refuse what is no number of a reading from `least` to its full scale."""
    for name, number in numbers.items():
        known_name("reading", name, READINGS)
        finite_in_range(f"{kind} of {name}", number, least, CHANNELS[name].high)


def _in_shares(n_lanes: int, run: Callable[[int, int], None]) -> None:
    """Call ``run(first, last)`` on shares of the lanes, in threads where there are many."""
    n_shares = n_threads() if n_lanes >= PARALLEL_LANES else 1
    edges = [n_lanes * k // n_shares for k in range(n_shares + 1)]
    own, *others = pairwise(edges)
    running = []
    for share in others:
        threads = _threads(len(others), os.getpid())
        running.append(threads.submit(run, *share))
    run(*own)
    for future in running:
        future.result()


@cache
def _threads(count: int, process: int) -> ThreadPoolExecutor:
    """Threads to use again: to start them costs a fifth of a step. A forked process has its own."""
    return ThreadPoolExecutor(count)
