"""What thrust shifted between the sides says about faults, and what it costs, beside the speed.

Rates of evidence are those of `training.bounds.information`, over whole periods of the waves: an
excitation that is repeated says as much in every period.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from auv_fault_env import layout
from auv_fault_env.faults import CATALOGUE, fault_of, known_classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, follow_mission
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from training.bounds.information import Lanes, log_likelihoods_unknown_severity, simulate_lanes
from training.metrics.records import HORIZON
from training.seeds import seeds
from training.stimuli import Cruise

MISSION = MISSIONS["cruise"]
ONSET = 5.0  # s
PERIOD = 20.0  # s, that of the thesis' wave
N_PERIOD = round(PERIOD * SAMPLE_RATE)
SETTLING = 2 * N_PERIOD  # samples, before costs count
FIRST_SEED = 870_000_000  # within those of tests

Case = tuple[str, float]  # fault and severity


class Excitation(NamedTuple):
    """A constant change, or a square wave of `PERIOD` about none.

    Attributes
    ----------
    offset
        Of the commanded speed [m/s].
    shift
        Of thrust to port, see `auv_fault_env.thrust_shift`.
    alternates
        Whether it is a wave, whose first half has these signs.
    """

    offset: float = 0.0
    shift: float = 0.0
    alternates: bool = False

    def sign(self, step: int) -> float:
        """1 or -1, by the number of the step."""
        return -1.0 if self.alternates and step % N_PERIOD >= N_PERIOD // 2 else 1.0


class Cost(NamedTuple):
    """What an excitation costs the nominal vehicle, over a period.

    Attributes
    ----------
    energy
        Per metre [J/m].
    speed_rms
        Root mean square of the speed less that without excitation [m/s].
    rudder
        Largest rudder that holds the heading [rad].
    """

    energy: float
    speed_rms: float
    rudder: float


class Rate(NamedTuple):
    """Evidence for the true class [nat/s]: against normal, and against its most similar rival.

    Over the last period, and against normal over all of the time since the onset as well, which
    says more where only the healthy band is known: evidence then stops to grow. Of the rivals the
    classes of the same part do not count: at unknown severity a lost propeller is a damaged one.
    """

    since_onset: float
    against_normal: float
    rival: str
    against_rival: float


class ExcitedFleet(Fleet):
    """A fleet whose commands are excited, whatever the actions.

    Parameters
    ----------
    excitation
        That of all lanes.
    others
        Those of `Fleet`.
    """

    def __init__(self, n_lanes: int, excitation: Excitation, **others: Any):
        super().__init__(n_lanes, **others)
        self.excitation = excitation

    def step(self, actions: np.ndarray) -> np.ndarray:
        """As `Fleet.step`, for actions (n_lanes, 3)."""
        sign = self.excitation.sign(int(self.state.step[0]))
        shift = np.full(self.n_lanes, sign * self.excitation.shift)
        excited = np.column_stack([actions, shift])
        excited[:, 0] += sign * self.excitation.offset
        return super().step(excited)


def cost(excitation: Excitation) -> Cost:
    """The cost of an excitation in steady motion, without noise and disturbance."""
    energy, speed, rudder = _steady_period(excitation)
    _, passive_speed, _ = _steady_period(Excitation())
    distance = speed.sum() * SAMPLE_TIME
    deviation = np.sqrt(np.mean(np.square(speed - passive_speed)))
    return Cost(float(energy.sum() / distance), float(deviation), float(np.abs(rudder).max()))


def _steady_period(excitation: Excitation) -> np.ndarray:
    """Energy [J], speed [m/s] and rudder [rad] of the nominal vehicle, (3, `N_PERIOD`)."""
    fleet = ExcitedFleet(1, excitation, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    observation = fleet.reset([0], schedules=[()], missions=[MISSION])
    samples = []
    for _ in range(SETTLING + N_PERIOD):
        observation = fleet.step(follow_mission(observation))
        rows = [fleet.row(row)[0] for row in (layout.ENERGY, layout.SPEED, layout.RUDDER)]
        samples.append(rows)
    return np.array(samples[SETTLING:]).T


def offset_of_energy(energy: float, alternates: bool = False) -> float:
    """The speed offset [m/s] with which a nominal vehicle needs this energy per metre [J/m]."""

    def excess(offset: float) -> float:
        return cost(Excitation(offset, alternates=alternates)).energy - energy

    return float(brentq(excess, 0.0, 0.2, xtol=1e-5))


def faulty_vehicles(
    excitation: Excitation, cases: Sequence[Case], vehicles: int, seed: int
) -> Lanes:
    """So many vehicles of each case under an excitation, case after case.

    Lane k is the same vehicle with the same noise under every excitation. A part that is there or
    gone has its least severity. The seed is an offset within those of tests.
    """
    events = [
        FaultEvent(fault, ONSET, max(severity, fault_of(fault).least_severity))
        for fault, severity in cases
        for _ in range(vehicles)
    ]
    n_lanes = len(events)
    lane_seeds = seeds("test", n_lanes, FIRST_SEED + seed)
    fleet = ExcitedFleet(n_lanes, excitation)
    return simulate_lanes(Cruise(), events, [MISSION] * n_lanes, lane_seeds, fleet=fleet)


def evidence_rates(lanes: Lanes, cases: Sequence[Case], knows_vehicle: bool) -> dict[Case, Rate]:
    """Mean rates by case of `faulty_vehicles`, whose severity is unknown.

    Without `knows_vehicle` only the healthy band is known.
    """
    log_likelihoods = log_likelihoods_unknown_severity(lanes, knows_vehicle)
    shape = len(cases), -1, log_likelihoods.shape[2]
    late = period_rate(log_likelihoods).reshape(shape).mean(axis=1)
    whole = log_likelihoods[-1].astype(float).reshape(shape).mean(axis=1) / HORIZON
    return {case: _rate(case[0], late[k], whole[k]) for k, case in enumerate(cases)}


def period_rate(log_likelihoods: np.ndarray) -> np.ndarray:
    """Gain [nat/s] over the last period of log-likelihoods (n_samples, ...), (...,)."""
    gain = log_likelihoods[-1].astype(float) - log_likelihoods[-1 - N_PERIOD]
    return gain / PERIOD


def _rate(fault: str, gain: np.ndarray, whole_gain: np.ndarray) -> Rate:
    """The rate of a fault from the mean gains of every class against normal, (n_known,)."""
    names = known_classes()
    parts = {other.diagnosis: other.component for other in CATALOGUE.values()}
    own = fault_of(fault)
    true_class = names.index(own.diagnosis)
    evidence = gain[true_class] - gain
    rivals = [k for k, name in enumerate(names) if parts.get(name) != own.component]
    nearest = min(rivals, key=lambda k: evidence[k])
    return Rate(
        since_onset=float(whole_gain[true_class]),
        against_normal=float(evidence[0]),
        rival=names[nearest],
        against_rival=float(evidence[nearest]),
    )
