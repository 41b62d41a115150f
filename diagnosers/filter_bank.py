"""The classical diagnoser: one Kalman filter per hypothesis, and Bayes' rule over them, with switching."""

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.compiling import n_threads
from auv_fault_env.errors import finite_in_range, known_name, pair_in_range, refusal
from auv_fault_env.faults import CATALOGUE, fault_of
from auv_fault_env.parameters import (
    HULL,
    PARAMETERS,
    SAMPLE_TIME,
    SHAFT,
    SIDES,
    Vehicle,
    nominal,
    vehicle_of,
)
from auv_fault_env.physics import PlantConstants, plant_constants
from diagnosers.bank.algebra import N_PACKED, N_STATES, SEVERITY, SPREAD, entry
from diagnosers.bank.hypotheses import OWN, SURGE, HypothesisTable, hypothesis_table
from diagnosers.bank.kernel import BankState, step_lanes
from diagnosers.bank.motor import DEVIATIONS
from diagnosers.bank.pack import pack_size, workspace
from diagnosers.bank.sensors import seen_by
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.kalman import START_SPEED_STD, opening_share

PARALLEL_LANES = 64  # below, waking the threads costs more than they save
# that a hypothesis may fall back to: below, it is the normal vehicle under another name
LEAST_SEVERITY = 0.1


class BankConstants(NamedTuple):
    """What the compiled code gets of a bank besides its table; sensors (8, 4): full scale, noise and resolution."""

    water: PlantConstants
    opening: float
    disturbance_variance: float
    disturbance_memory: float
    walk: float
    sensors: np.ndarray


@dataclass(frozen=True)
class FilterBank(Recursive):
    """A bank of Kalman filters: the normal vehicle, and every fault of the catalogue in some grades of severity.

    Each hypothesis has filters of surge and of both motors (shared with the normal vehicle where
    its fault does not reach), whose states are the healthy vehicle's deviations from nominal and
    the fault's severity. Their likelihoods weigh the hypotheses; a normal vehicle may turn faulty
    at any sample and then stays so, as in the interacting multiple model algorithm. All in
    logarithms: p(normal) may be 1e-100 and still be graded. A silent reading (NaN) is predicted,
    not held, but for the voltage; nothing is learnt from it, nor of a motor without any voltage
    reading. Sources: Willsky, "A survey of design methods for failure detection in dynamic
    systems", Automatica 12, 1976, doi:10.1016/0005-1098(76)90041-8; Blom & Bar-Shalom 1988,
    doi:10.1109/9.1299; de Benito 1990, as the thesis cites it.

    When it misleads: at constant speed some faults look alike (drag and thrust), and the belief is
    shared between them by the prior; repairs, intermittent and double faults are no hypotheses; a
    vehicle outside the healthy band, or noisier than `CHANNELS` says, is called faulty; readings
    without any noise look stuck.

    Attributes
    ----------
    vehicle
        Preset or nominal vehicle.
    grades
        Ranges of the severity, each a hypothesis of its own. Within its grade the severity is a
        state.
    hazard
        Probability per sample that a fault begins; shared by classes, then faults, then grades. It
        holds for a minute and falls with the age of the vehicle thereafter.
    walk_std
        Random walk of the severity per square root of a second, for faults that grow.
    faults
        Names of the faults that are held possible; the whole catalogue if None. The classes of the
        others keep their place with probability 0.
    shafts
        2, or 1: that of port, whose propeller gives all the thrust. Leave the other side's faults
        out of `faults`.
    band
        Relative half-width of the healthy band by parameter of `Vehicle`, where it is not the
        default.
    noise
        Standard deviation by reading [its unit], where it is not the default.
    resolution
        Distance of neighbouring values by reading [its unit], where it is coarser than float32:
        between values so far apart a healthy sensor repeats itself.
    """

    name = "filter_bank"
    filled_channels = slice(0, len(COMMANDS))
    vehicle: str | Vehicle = "thesis1992"
    grades: tuple[tuple[float, float], ...] = ((0.1, 0.4), (0.4, 0.7), (0.7, 1.0))
    hazard: float = 1e-3
    walk_std: float = 0.015
    faults: tuple[str, ...] | None = None
    shafts: int = 2
    band: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self):
        vehicle_of(self.vehicle)
        finite_in_range("hazard", self.hazard, 1e-12, 0.5)
        finite_in_range("walk_std", self.walk_std, 0.0, 10.0)
        if not isinstance(self.grades, Sequence) or not self.grades:
            raise refusal("grades", self.grades, "at least one range of severity", "give one")
        object.__setattr__(
            self, "grades", tuple(pair_in_range("grade", grade, 0.0, 1.0) for grade in self.grades)
        )
        if self.faults is not None:
            object.__setattr__(self, "faults", tuple(fault_of(name).name for name in self.faults))
        self._check_vehicle()

    def _check_vehicle(self):
        if self.shafts not in (1, 2):
            raise refusal("shafts", self.shafts, "1 or 2", "count the shafts")
        for name, width in self.band.items():
            finite_in_range(
                f"healthy band of {known_name('parameter', name, (*HULL, *SHAFT))}", width, 0.0, 1.0
            )
        for kind, numbers, least in (
            ("noise", self.noise, 1e-9),
            ("resolution", self.resolution, 0.0),
        ):
            for name, value in numbers.items():
                finite_in_range(
                    f"{kind} of {known_name('reading', name, READINGS)}",
                    value,
                    least,
                    CHANNELS[name].high,
                )

    @property
    def healthy(self) -> np.ndarray:
        """The nominal vehicle, (n_parameters,), with its own noise and its thrust shared by the shafts it has."""
        vehicle = vehicle_of(self.vehicle)
        thrust = {
            "port_beta": vehicle.beta / self.shafts,
            "starboard_beta": vehicle.beta * (self.shafts - 1) / 2,
        }
        noise = {f"{name}_noise": value for name, value in self.noise.items()}
        return np.array(list((nominal(vehicle) | thrust | noise).values()))

    @cached_property
    def constants(self) -> BankConstants:
        """What the compiled code gets: water, noise and disturbance of the nominal vehicle."""
        vehicle = vehicle_of(self.vehicle)
        water = plant_constants(vehicle)
        memory = math.exp(-SAMPLE_TIME / vehicle.disturbance_time)
        scales = [(CHANNELS[name].low, CHANNELS[name].high) for name in READINGS]
        fine = [
            (self.noise.get(name, CHANNELS[name].noise), self.resolution.get(name, 0.0))
            for name in READINGS
        ]
        sensors = np.hstack([scales, fine])
        walk = SAMPLE_TIME * self.walk_std**2
        return BankConstants(
            water, opening_share(vehicle), vehicle.disturbance_std**2, memory, walk, sensors
        )

    def initial(self, n_lanes: int) -> BankState:
        """The state before any observation: a normal vehicle, somewhere in the healthy band."""
        low, high = np.array(self.grades).T
        moments = np.stack(
            [(low + high) / 2, (high - low) ** 2 / 12, np.maximum(low, LEAST_SEVERITY)]
        )
        return self._begun(
            np.tile(self.healthy, (n_lanes, 1)), np.tile(moments, (n_lanes, 1, 1)), 1.0
        )

    def _begun(self, healthy: np.ndarray, prior: np.ndarray, spread: float) -> BankState:
        """A state around these healthy vehicles (n_lanes, n_parameters), `spread` times the healthy band wide."""
        n_lanes = len(healthy)
        hypotheses = self.hypotheses(prior.shape[2])
        log_weight = np.full((n_lanes, hypotheses.log_hazard.size), -np.inf)
        log_weight[:, 0] = 0.0
        severity = np.ascontiguousarray(prior[:, :2, hypotheses.grade])
        severity[:, :, 0] = 0.0
        filters = np.zeros((n_lanes, N_PACKED, hypotheses.hypothesis.size))
        variances = [entry(i, i) for i in range(N_STATES)]
        for subsystem in OWN:
            part = slice(*map(int, hypotheses.first[subsystem : subsystem + 2]))
            filters[:, variances[:-1], part] = np.square(self._prior_std(subsystem, spread))[
                :, None
            ]
        filters[:, N_STATES - 1] = severity[:, 0, hypotheses.hypothesis]
        filters[:, variances[-1]] = severity[:, 1, hypotheses.hypothesis]
        unknown = (
            np.full((n_lanes, filters.shape[2]), np.nan),
            np.full((n_lanes, len(READINGS)), np.nan),
        )
        return BankState(log_weight, severity, filters, *unknown, healthy, prior, np.zeros(n_lanes))

    def state_at_onset(self, state: BankState, lanes: np.ndarray) -> BankState:
        """The state if on these lanes (indices) a fault began with the next sample, or none did, all classes as likely.

        Every fault's filters go on from those of the normal vehicle, with the severities of the
        prior. As long as nothing switches, differences of the beliefs are log-likelihood ratios of
        the classes from then on.
        """
        hypotheses = self.hypotheses(state.prior.shape[2])
        new = BankState(*(part.copy() for part in state))
        severity = state.prior[lanes][:, :2, hypotheses.grade]
        severity[:, :, 0] = 0.0
        first = hypotheses.first.astype(np.int64)
        normal = np.repeat(first[:-1], np.diff(first))
        filters = state.filters[lanes][:, :, normal]
        filters[:, [entry(SEVERITY, i) for i in range(SEVERITY)]] = 0.0
        filters[:, SEVERITY] = severity[:, 0, hypotheses.hypothesis]
        filters[:, SPREAD] = severity[:, 1, hypotheses.hypothesis]
        members = np.bincount(hypotheses.diagnosis)
        new.log_weight[lanes] = -np.log(members.size * members[hypotheses.diagnosis])
        new.severity[lanes] = severity
        new.filters[lanes] = filters
        new.turning[lanes] = state.turning[lanes][:, normal]
        return new

    def _prior_std(self, subsystem: int, spread: float) -> list[float]:
        """Standard deviations of a filter's states at the start, but for the severity; a uniform band's is a third."""
        own = {
            name: self.band.get(name.split("_", 1)[1] if name.startswith(SIDES) else name)
            for name in PARAMETERS
        }
        widths = {
            name: spec.band if own[name] is None else own[name] for name, spec in PARAMETERS.items()
        }
        std = {name: spread * width / math.sqrt(3.0) for name, width in widths.items()}
        if subsystem != SURGE:
            return [std[OWN[subsystem][row]] for row in DEVIATIONS]
        thrust = math.hypot(*(std[f"{side}_beta"] for side in SIDES[: self.shafts])) / self.shafts
        return [
            START_SPEED_STD,
            math.sqrt(self.constants.disturbance_variance),
            std["alpha"],
            thrust,
        ]

    def hypotheses(self, n_grades: int | None = None) -> HypothesisTable:
        """The hypotheses of the catalogue as it is; made anew when it has changed."""
        n_grades = len(self.grades) if n_grades is None else n_grades
        key = n_grades, *CATALOGUE.values()
        if self.__dict__.get("_tables", (None,))[0] != key:
            faults = tuple(CATALOGUE) if self.faults is None else self.faults
            self.__dict__["_tables"] = key, hypothesis_table(n_grades, self.hazard, faults)
        return self.__dict__["_tables"][1]

    def step(self, state: BankState, observation: np.ndarray) -> tuple[BankState, Belief]:
        """The next state and the belief."""
        n_lanes = len(observation)
        new = BankState(*(np.empty_like(part) for part in state[:5]), *state[5:-1], state.age + 1.0)
        hypotheses = self.hypotheses(state.prior.shape[2])
        if state.log_weight.shape[1] != hypotheses.log_hazard.size:
            raise refusal(
                "catalogue",
                "faults added or removed",
                "that of the reset",
                "call reset(n_lanes) again",
            )
        belief = Belief(*np.empty((len(Belief._fields), n_lanes, len(self.classes))))
        arguments = state, new, observation, hypotheses, self.constants, belief
        _in_shares(n_lanes, arguments)
        return new, belief


def _in_shares(n_lanes: int, arguments: tuple) -> None:
    """Run the kernel over all lanes, in threads where there are many: it releases the interpreter's lock."""
    count = n_threads() if n_lanes >= PARALLEL_LANES else 1
    own, *others = pairwise(n_lanes * k // count for k in range(count + 1))
    running = [
        _threads(count - 1, os.getpid()).submit(_step_share, share, arguments) for share in others
    ]
    _step_share(own, arguments)
    for one in running:
        one.result()


@cache
def _threads(count: int, process: int) -> ThreadPoolExecutor:
    """Threads beside the caller's, kept because starting them costs a fifth of a step; a forked child needs its own."""
    return ThreadPoolExecutor(count)


def _step_share(share: tuple[int, int], arguments: tuple) -> None:
    """Run the kernel over the lanes from the first to before the last of a share."""
    hypotheses = arguments[3]
    n_lanes = pack_size(share[1] - share[0], hypotheses.hypothesis.size)
    step_lanes(*share, *arguments, workspace(hypotheses, n_lanes), seen_by(n_lanes))
