"""Advice to the mission planner: continue, derate, return or abort, from the belief.

The goal is within range if 97.5 % of the vehicles that are possible under the belief reach it, home
if a share 1 - `MAX_RISK` of them do; in both cases with `MARGIN` to spare and no motor beyond its
rating. The first rule that applies decides:

abort
    More than `MAX_RISK` of the possible vehicles cannot hold their position: none of their speeds
    exceeds the current by `MIN_GROUND_SPEED`.
continue
    The goal is within range at the mission's speed, and the speed reading is probably right.
derate
    The goal is within range at the mission's speed or at a lower one.
return
    Home is within range.
abort
    Neither is.
"""

from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.faults import UNKNOWN, classes
from auv_fault_env.parameters import FASTEST, Vehicle
from diagnosers.capability import capability, sample_parameters
from diagnosers.diagnoser import Belief

ACTIONS = ("continue", "derate", "return", "abort")
CONTINUE, DERATE, RETURN, ABORT = range(len(ACTIONS))
MARGIN = 1.05  # of a range over the distance: the plant is never quite in steady motion
MIN_GROUND_SPEED = 0.1  # m/s, below which a vehicle cannot hold its position
MAX_RISK = 0.1  # probability, of not coming home or of drifting, above which to abort
QUANTILES = 0.025, 0.5, 0.975, MAX_RISK
LOW, MEDIAN, HIGH, RISK = range(len(QUANTILES))
PROBABLE = 0.5  # probability from which a fault is named
# of the stall current: what brushed motors of this size stand for long; an estimate without source
RATED_SHARE = 0.2
N_AGREEING = 5  # advices in a row that must agree to change the action
MIN_POWER = 1e-9  # W, against division by zero
RELATIVE_SPEEDS = np.arange(1, 21) / 10  # speeds that are compared, of the mission's
MISSION = 9  # index of the mission's own speed
SENSOR_PREFIX = "sensor:"
SPEED_SENSOR = SENSOR_PREFIX + "speed"


class Situation(NamedTuple):
    """Where a mission stands; each a number or (n_lanes,). Distances are over the ground."""

    speed: np.ndarray | float  # m/s, through the water, that the mission asks for
    distance_to_go: np.ndarray | float  # m
    distance_home: np.ndarray | float  # m
    energy_left: np.ndarray | float  # J
    hotel_load: np.ndarray | float  # W, power of all but the motors
    current: np.ndarray | float = 0.0  # m/s, of the water against the way to the goal


LIMITS = {
    "speed": (0.01, FASTEST),
    "distance_to_go": (0.0, 1e7),
    "distance_home": (0.0, 1e7),
    "energy_left": (0.0, 1e12),
    "hotel_load": (0.0, 1e6),
    "current": (-10.0, 10.0),
}


class Quantiles(NamedTuple):
    """Median and 95 % interval over the possible vehicles, (n_lanes,) each."""

    low: np.ndarray
    median: np.ndarray
    high: np.ndarray


class Advice(NamedTuple):
    """What to do, for what reason, and what the vehicle can still do; all (n_lanes,).

    `speed` is to be the true speed: a controller without integral action falls short of its command
    under a fault. Energy per metre includes the hotel load; it is infinite, and the range 0, where
    the vehicle makes no way. The best speed, up to twice the mission's, gives the largest range.
    """

    level: np.ndarray  # index of the action in `ACTIONS`: the higher, the more serious
    reason: tuple[str, ...]  # one sentence per lane
    speed: np.ndarray  # to choose, through the water [m/s], 0 to abort
    distrusted: np.ndarray  # class of the reading that is probably false; empty if none is
    reachable_speed: Quantiles  # the largest through the water [m/s]
    energy_per_metre: Quantiles  # to the goal at the mission's speed [J/m]
    range: Quantiles  # to the goal at the mission's speed [m]
    best_speed: np.ndarray  # m/s
    best_energy_per_metre: Quantiles  # J/m
    best_range: Quantiles  # m
    range_home: Quantiles  # at the best speed for that [m]
    proposals: np.ndarray  # (n_lanes, N_AGREEING), levels of the last judgements, newest last

    @property
    def action(self) -> np.ndarray:
        """The actions' names, (n_lanes,)."""
        return np.array(ACTIONS)[self.level]


def advise(
    belief: Belief,
    situation: Situation,
    vehicle: Vehicle,
    previous: Advice | None = None,
) -> Advice:
    """Advice for every lane.

    It misleads where the diagnoser does: under a fault that is not in the catalogue, or under two
    at once, the ranges are those of another vehicle. It does not include obstacles and tides.

    Parameters
    ----------
    belief
        Of a diagnoser over `auv_fault_env.classes()`.
    situation
        Where the missions stand; a value out of range is refused by an `InputError`.
    vehicle
        The nominal vehicle. With one shaft, a fault of the port side is one of all propulsion.
    previous
        The last advice, about a second ago. With it the action changes only as far as all of the
        last `N_AGREEING` judgements demand.
    """
    situation = _checked(situation, len(belief.log_probability), vehicle)
    assessment = _assess(belief, situation, vehicle)
    level = _levels(assessment)
    proposals = np.repeat(level[:, None], N_AGREEING, axis=1)
    if previous is not None:
        proposals[:, :-1] = previous.proposals[:, 1:]
        level = np.clip(previous.level, proposals.min(axis=1), proposals.max(axis=1))
    return _advice(assessment, level, proposals)


def _checked(situation: Situation, n_lanes: int, vehicle: Vehicle) -> Situation:
    """The situation as float64 arrays (n_lanes,), each within its limits, else a refusal."""
    slowest, _ = LIMITS["speed"]
    limits = LIMITS | {"speed": (slowest, vehicle.maximum_speed)}
    checked = {}
    for name, field in situation._asdict().items():
        checked[name] = _checked_field(name, field, n_lanes, limits[name])
    return Situation(**checked)


def _checked_field(name: str, field, n_lanes: int, limits: tuple[float, float]) -> np.ndarray:
    try:
        values = np.broadcast_to(np.asarray(field, np.float64), n_lanes)
    except (TypeError, ValueError):
        remedy = "give one number, or one per lane"
        raise refusal(name, field, f"numbers of shape ({n_lanes},)", remedy) from None
    low, high = limits
    wrong = ~((values >= low) & (values <= high))
    if wrong.any():
        allowed = f"a number from {low:g} to {high:g}"
        first_wrong = float(values[wrong][0])
        raise refusal(f"{name} of the situation", first_wrong, allowed, "give one in that range")
    return values


class Assessment(NamedTuple):
    """The basis of an advice: quantities over the possible vehicles, and the likeliest fault."""

    situation: Situation
    speeds: np.ndarray  # (n_lanes, n_speeds), that are compared [m/s]
    reachable_speed: Quantiles  # m/s
    may_drift: np.ndarray  # (n_lanes,), whether too many cannot hold their position
    within_rating: np.ndarray  # (n_lanes, n_speeds), whether the motors are
    outward: np.ndarray  # (n_quantiles, n_lanes, n_speeds), way over the ground by energy [m/J]
    homeward: np.ndarray  # (n_quantiles, n_lanes, n_speeds), the same
    safe_range: np.ndarray  # (n_lanes, n_speeds), to plan with, 0 beyond the rating [m]
    probable_range_home: np.ndarray  # (n_lanes, n_speeds), the same
    fault: np.ndarray  # (n_lanes,), class index
    probability: np.ndarray  # (n_lanes,)
    severity: np.ndarray  # (n_lanes,), mean
    distrusted: np.ndarray  # (n_lanes,), as in `Advice`

    @property
    def goal_in_range(self) -> np.ndarray:
        """Whether the goal is within range, (n_lanes, MISSION + 1): up to the mission's speed."""
        needed = MARGIN * self.situation.distance_to_go[:, None]
        return self.safe_range[:, : MISSION + 1] >= needed

    @property
    def home_in_range(self) -> np.ndarray:
        """Whether home is within range at any speed, (n_lanes,)."""
        needed = MARGIN * self.situation.distance_home[:, None]
        return (self.probable_range_home >= needed).any(axis=1)


def _assess(belief: Belief, situation: Situation, vehicle: Vehicle) -> Assessment:
    speeds = np.minimum(situation.speed[:, None] * RELATIVE_SPEEDS, vehicle.maximum_speed)
    possible = capability(sample_parameters(belief, vehicle), speeds, vehicle)
    needed_speed = np.abs(situation.current)[:, None] + MIN_GROUND_SPEED
    drifting = possible.reachable_speed < needed_speed
    rated_current = RATED_SHARE * vehicle.maximum_voltage / vehicle.resistance
    motor_current = np.quantile(possible.current, QUANTILES[HIGH], axis=1)
    within_rating = motor_current <= rated_current
    outward = _metres_per_joule(possible.power, situation, speeds - situation.current[:, None])
    homeward = _metres_per_joule(possible.power, situation, speeds + situation.current[:, None])
    energy_left = situation.energy_left[:, None]
    fault = 1 + belief.log_probability[:, 1:].argmax(axis=1)
    lanes = np.arange(fault.size)
    probability = np.exp(belief.log_probability[lanes, fault])
    sensors = np.array([name if name.startswith(SENSOR_PREFIX) else "" for name in classes()])
    return Assessment(
        situation=situation,
        speeds=speeds,
        reachable_speed=_interval(np.quantile(possible.reachable_speed, QUANTILES, axis=1)),
        may_drift=drifting.mean(axis=1) > MAX_RISK,
        within_rating=within_rating,
        outward=outward,
        homeward=homeward,
        safe_range=outward[LOW] * energy_left * within_rating,
        probable_range_home=homeward[RISK] * energy_left * within_rating,
        fault=fault,
        probability=probability,
        severity=belief.severity_mean[lanes, fault],
        distrusted=np.where(probability >= PROBABLE, sensors[fault], ""),
    )


def _metres_per_joule(power: np.ndarray, situation: Situation, ground_speed: np.ndarray):
    """Quantiles of the way over the ground by energy, (4, n_lanes, n_speeds)."""
    way = np.maximum(ground_speed, 0.0)
    demand = np.maximum(power + situation.hotel_load[:, None, None], MIN_POWER)
    return np.quantile(way[:, None] / demand, QUANTILES, axis=1)


def _levels(assessment: Assessment) -> np.ndarray:
    """The level of each lane by the rules alone, (n_lanes,)."""
    goal_in_range = assessment.goal_in_range
    speed_is_right = assessment.distrusted != SPEED_SENSOR
    rules = {
        ABORT: assessment.may_drift,
        CONTINUE: goal_in_range[:, MISSION] & speed_is_right,
        DERATE: goal_in_range.any(axis=1),
        RETURN: assessment.home_in_range,
    }
    return np.select(list(rules.values()), list(rules), ABORT)


def _derated_speed(assessment: Assessment) -> np.ndarray:
    """Index of the fastest speed that reaches the goal; the cheapest if the reading is false."""
    slower = assessment.goal_in_range[:, :MISSION]
    fastest = MISSION - 1 - slower[:, ::-1].argmax(axis=1)
    cheapest = assessment.safe_range[:, : MISSION + 1].argmax(axis=1)
    speed_is_right = assessment.distrusted != SPEED_SENSOR
    return np.where(slower.any(axis=1) & speed_is_right, fastest, cheapest)


def _advice(assessment: Assessment, level: np.ndarray, proposals: np.ndarray) -> Advice:
    lanes = np.arange(level.size)
    energy = assessment.situation.energy_left
    best = assessment.safe_range.argmax(axis=1)
    best_home = assessment.probable_range_home.argmax(axis=1)
    by_level = [
        np.full_like(level, MISSION),
        _derated_speed(assessment),
        best_home,
        best,
    ]
    chosen = np.choose(level, by_level)
    at_mission_speed = assessment.outward[:, :, MISSION]
    at_best_speed = assessment.outward[:, lanes, best]
    homeward = assessment.homeward[:, lanes, best_home]
    return Advice(
        level=level,
        reason=tuple(_reason(assessment, lane, level[lane], chosen[lane]) for lane in lanes),
        speed=np.where(level == ABORT, 0.0, assessment.speeds[lanes, chosen]),
        distrusted=assessment.distrusted,
        reachable_speed=assessment.reachable_speed,
        energy_per_metre=_joules_per_metre(at_mission_speed),
        range=_interval(energy * at_mission_speed),
        best_speed=assessment.speeds[lanes, best],
        best_energy_per_metre=_joules_per_metre(at_best_speed),
        best_range=_interval(energy * at_best_speed),
        range_home=_interval(energy * homeward),
        proposals=proposals,
    )


def _interval(quantiles: np.ndarray) -> Quantiles:
    return Quantiles(*quantiles[: HIGH + 1])


def _joules_per_metre(metres_per_joule: np.ndarray) -> Quantiles:
    with np.errstate(divide="ignore"):  # where no way is made
        return Quantiles(*(1.0 / metres_per_joule[HIGH::-1]))


def _reason(assessment: Assessment, lane: int, level: int, chosen: int) -> str:
    """The figures that support the action, and what else a planner needs to know of this lane."""
    situation = Situation(*(values[lane] for values in assessment.situation))
    to_goal = assessment.safe_range[lane]
    home = assessment.probable_range_home[lane]
    at_speed = f"at {situation.speed:.2f} m/s"
    to_go = f"{situation.distance_to_go:.0f} m are to go"
    reasons = [f"{to_goal[MISSION]:.0f} m are within range {at_speed}, {to_go}"]
    if level == DERATE:
        derated = assessment.speeds[lane, chosen]
        reasons.append(f"{to_goal[chosen]:.0f} m are at {derated:.2f} m/s")
    if level >= RETURN:
        way_home = f"on the way home of {situation.distance_home:.0f} m"
        reasons.append(f"{to_goal.max():.0f} m are at the best speed")
        reasons.append(f"{home.max():.0f} m are probably within range {way_home}")
    if assessment.may_drift[lane]:
        reachable = f"it may reach only {assessment.reachable_speed.low[lane]:.2f} m/s"
        reasons.append(f"{reachable}, and the current is {situation.current:.2f} m/s")
    if not assessment.within_rating[lane, MISSION]:
        reasons.append(f"{at_speed} a motor may draw more than it is rated for")
    if assessment.probability[lane] >= PROBABLE:
        reasons.append(_named_fault(assessment, lane))
    return "; ".join(reasons)


def _named_fault(assessment: Assessment, lane: int) -> str:
    name = classes()[assessment.fault[lane]]
    percent = f"{100 * assessment.probability[lane]:.0f} %"
    if name == UNKNOWN:
        return f"a fault that is none of the known ones is likely ({percent})"
    likely = f"{name} is likely ({percent}"
    if name == SPEED_SENSOR:
        return f"{likely}): that reading misleads, and at the cheapest speed its error costs least"
    if name.startswith(SENSOR_PREFIX):
        return f"{likely}): do not use that reading"
    return f"{likely}, severity {assessment.severity[lane]:.2f})"
