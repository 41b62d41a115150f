"""Advice to whoever plans the mission: continue, derate, return or abort, from what is believed of the vehicle.

The rules, the first that applies. The goal is within range if 97.5 % of the vehicles possible under
the belief reach it, home if a share 1 - `LOST` of them do, with `MARGIN` to spare and no motor
beyond what it is rated for:

==========
============================================================================================================
action     where ==========
============================================================================================================
abort      more than `LOST` of the possible vehicles cannot keep their way: none of their speeds
exceeds the current by
           `STEERAGE`
continue   the goal is within range at the mission's speed; a reading that is probably false is
named derate     the goal is within range at a lower speed; or at the mission's, but the speed
reading is probably false return     home is within range abort      neither is ==========
============================================================================================================
"""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import refusal
from auv_fault_env.faults import classes
from auv_fault_env.parameters import Vehicle
from diagnosers.capability import capability, sample_parameters
from diagnosers.diagnoser import Belief

ACTIONS = ("continue", "derate", "return", "abort")
CONTINUE, DERATE, RETURN, ABORT = range(len(ACTIONS))
MARGIN = 1.05  # of a range over the way: the plant is never quite in steady motion
STEERAGE = 0.1  # m/s over the ground, below which a vehicle cannot keep its way
LOST = 0.1  # probability, of not coming home or of having lost its way, from which to abort
QUANTILES = 0.025, 0.5, 0.975, LOST
# which of them
SURE = 0
HIGH = 2
PROBABLE = 3
NAMED = 0.5  # probability from which a reading is named as false
# of the stall current: what brushed motors of this size stand for long; an estimate, no source
# gives it
RATED = 0.2
N_AGREEING = 5  # advices in a row that must agree to change the action
LEAST_POWER = 1e-9  # W, against division by zero
STEPS = np.arange(1, 21) / 10  # speeds that are weighed, of the mission's
MISSION = 9  # the step that is the mission's own speed
SENSOR_PREFIX = "sensor:"
SPEED_SENSOR = SENSOR_PREFIX + "speed"


class Situation(NamedTuple):
    """Where a mission stands; each a number or (n_lanes,).

    Attributes
    ----------
    speed
        Speed through the water that the mission asks for [m/s].
    distance_to_go, distance_home
        Ways over the ground to the goal and back home [m].
    energy_left
        In the battery [J].
    hotel_load
        Power of all but the motors [W].
    current
        Current of the water [m/s], positive against the way to the goal and so with the way home.
    """

    speed: np.ndarray | float
    distance_to_go: np.ndarray | float
    distance_home: np.ndarray | float
    energy_left: np.ndarray | float
    hotel_load: np.ndarray | float
    current: np.ndarray | float = 0.0


LIMITS = {
    "speed": (0.01, MAXIMUM_COMMAND),
    "distance_to_go": (0.0, 1e7),
    "distance_home": (0.0, 1e7),
    "energy_left": (0.0, 1e12),
    "hotel_load": (0.0, 1e6),
    "current": (-10.0, 10.0),
}


class Quantiles(NamedTuple):
    """Median and 95 % interval over what is possible, (n_lanes,) each."""

    low: np.ndarray
    median: np.ndarray
    high: np.ndarray


class Advice(NamedTuple):
    """What to do, why, and what the vehicle can still do; all (n_lanes,).

    Attributes
    ----------
    level
        Index of the action in `ACTIONS`: the higher the graver.
    why
        One sentence per lane.
    speed
        Speed through the water to keep [m/s], 0 to abort. It is meant to be held: a controller
        without integral action falls short of its command under a fault.
    distrusted
        Class of the reading that is probably false, such as ``sensor:speed``; empty if none is.
    reachable_speed
        Largest speed through the water [m/s].
    energy_per_metre, range
        At the mission's speed on the way to the goal, hotel load included [J/m], and how far the
        battery so brings the vehicle [m]. Infinite and 0 where it makes no way.
    best_speed, best_energy_per_metre, best_range
        The same at the speed, up to twice the mission's, that brings it farthest.
    range_home
        The range on the way home, at the best speed for that [m].
    proposals
        Levels of the last `N_AGREEING` judgements, (n_lanes, N_AGREEING), the newest last.
    """

    level: np.ndarray
    why: tuple[str, ...]
    speed: np.ndarray
    distrusted: np.ndarray
    reachable_speed: Quantiles
    energy_per_metre: Quantiles
    range: Quantiles
    best_speed: np.ndarray
    best_energy_per_metre: Quantiles
    best_range: Quantiles
    range_home: Quantiles
    proposals: np.ndarray

    @property
    def action(self) -> np.ndarray:
        """The actions' names, (n_lanes,)."""
        return np.array(ACTIONS)[self.level]


def advise(
    belief: Belief,
    situation: Situation,
    vehicle: Vehicle,
    shafts: int = 2,
    before: Advice | None = None,
) -> Advice:
    """Advice for every lane.

    Parameters
    ----------
    belief
        Of a diagnoser over `auv_fault_env.classes()`.
    situation
        Where the missions stand; a value out of range is refused by an `InputError`.
    vehicle
        The nominal vehicle.
    shafts
        1 or 2. On a vehicle with one shaft a fault of the port side is a fault of all its
        propulsion.
    before
        The last advice, about a second ago. With it the action does not flicker: it moves only as
        far as each of the last `N_AGREEING` judgements would have it.

    Misleads where the diagnoser does: a fault that is none of the catalogue, or two at once, and
    the ranges are those of another vehicle. It knows nothing of obstacles, tides to come and the
    crew's own reasons.
    """
    if shafts not in (1, 2):
        raise refusal("shafts", shafts, "1 or 2", "say how many the vehicle has")
    view = _view(belief, checked(situation, len(belief.log_probability)), vehicle, shafts)
    level = _judged(view)
    proposals = np.repeat(level[:, None], N_AGREEING, axis=1)
    if before is not None:
        proposals[:, :-1] = before.proposals[:, 1:]
        level = np.clip(before.level, proposals.min(axis=1), proposals.max(axis=1))
    return _advice(view, level, proposals)


def checked(situation: Situation, n_lanes: int) -> Situation:
    """The situation as float64 arrays (n_lanes,), each within `LIMITS`, else a refusal."""
    values = {}
    for name, (low, high) in LIMITS.items():
        try:
            value = np.broadcast_to(np.asarray(getattr(situation, name), np.float64), n_lanes)
        except (TypeError, ValueError):
            remedy = "give one number, or one per lane"
            raise refusal(
                name, getattr(situation, name), f"numbers of shape ({n_lanes},)", remedy
            ) from None
        wrong = ~((value >= low) & (value <= high))
        if wrong.any():
            allowed = f"a number from {low:g} to {high:g}"
            raise refusal(
                f"{name} of the situation",
                float(value[wrong][0]),
                allowed,
                "give one in that range",
            )
        values[name] = value
    return Situation(**values)


class Assessment(NamedTuple):
    """What an advice is made from.

    situation; speeds (n_lanes, n_speeds) [m/s]; reachable_speed; lost (n_lanes,), whether to fear
    that the way is; cool (n_lanes, n_speeds), whether the motors keep to their rating; onward and
    homeward (4, n_lanes, n_speeds): quantiles of the way over the ground by energy [m/J]; to_go and
    home (n_lanes, n_speeds): ranges [m] that are counted on, 0 where a motor would run too hot;
    suspect, probability, severity (n_lanes,): index of the likeliest fault, and what is believed of
    it; distrusted (n_lanes,) as in `Advice`.
    """

    situation: Situation
    speeds: np.ndarray
    reachable_speed: Quantiles
    lost: np.ndarray
    cool: np.ndarray
    onward: np.ndarray
    homeward: np.ndarray
    to_go: np.ndarray
    home: np.ndarray
    suspect: np.ndarray
    probability: np.ndarray
    severity: np.ndarray
    distrusted: np.ndarray

    @property
    def fits(self) -> np.ndarray:
        """Whether the goal is within range at a speed up to the mission's, (n_lanes, MISSION + 1)."""
        return (self.to_go >= MARGIN * self.situation.distance_to_go[:, None])[:, : MISSION + 1]


def _view(belief: Belief, situation: Situation, vehicle: Vehicle, shafts: int) -> Assessment:
    speeds = np.minimum(situation.speed[:, None] * STEPS, MAXIMUM_COMMAND)
    able = capability(sample_parameters(belief, vehicle, shafts), speeds, vehicle)
    lost = (able.reachable_speed < np.abs(situation.current)[:, None] + STEERAGE).mean(
        axis=1
    ) > LOST
    rated = RATED * vehicle.maximum_voltage / vehicle.resistance
    cool = np.quantile(able.current, QUANTILES[HIGH], axis=1) <= rated
    onward, homeward = (
        _metres_per_joule(able.power, situation, speeds, against) for against in (1.0, -1.0)
    )
    to_go, home = (
        by_energy * situation.energy_left[:, None] * cool
        for by_energy in (onward[SURE], homeward[PROBABLE])
    )
    reachable = _spread(np.quantile(able.reachable_speed, QUANTILES, axis=1))
    return Assessment(
        situation, speeds, reachable, lost, cool, onward, homeward, to_go, home, *_suspect(belief)
    )


def _metres_per_joule(
    power: np.ndarray, situation: Situation, speeds: np.ndarray, against: float
) -> np.ndarray:
    """Quantiles of the way over the ground by energy, (4, n_lanes, n_speeds), 0 where none is made."""
    way = np.maximum(speeds - against * situation.current[:, None], 0.0)
    demand = np.maximum(power + situation.hotel_load[:, None, None], LEAST_POWER)
    return np.quantile(way[:, None] / demand, QUANTILES, axis=1)


def _suspect(belief: Belief) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The last four of a `Assessment`."""
    suspect = 1 + belief.log_probability[:, 1:].argmax(axis=1)
    lanes = np.arange(suspect.size)
    probability = np.exp(belief.log_probability[lanes, suspect])
    sensors = np.array([name if name.startswith(SENSOR_PREFIX) else "" for name in classes()])
    distrusted = np.where(probability >= NAMED, sensors[suspect], "")
    return suspect, probability, belief.severity_mean[lanes, suspect], distrusted


def _judged(view: Assessment) -> np.ndarray:
    """The level of each lane by the rules alone, (n_lanes,)."""
    fits_home = (view.home >= MARGIN * view.situation.distance_home[:, None]).any(axis=1)
    at_speed = view.fits[:, MISSION] & (view.distrusted != SPEED_SENSOR)
    rules = {ABORT: view.lost, CONTINUE: at_speed, DERATE: view.fits.any(axis=1), RETURN: fits_home}
    return np.select(list(rules.values()), list(rules), ABORT)


def _derated(view: Assessment) -> np.ndarray:
    """The step of the speed to derate to: the fastest that will do, or the cheapest where the speed is uncertain."""
    slower = view.fits[:, :MISSION]
    fastest = MISSION - 1 - slower[:, ::-1].argmax(axis=1)
    cheapest = view.to_go[:, : MISSION + 1].argmax(axis=1)
    return np.where(slower.any(axis=1) & (view.distrusted != SPEED_SENSOR), fastest, cheapest)


def _advice(view: Assessment, level: np.ndarray, proposals: np.ndarray) -> Advice:
    lanes = np.arange(level.size)
    energy = view.situation.energy_left
    best = view.to_go.argmax(axis=1)
    best_home = view.home.argmax(axis=1)
    step = np.choose(level, [np.full_like(level, MISSION), _derated(view), best_home, best])
    mission = view.onward[:, :, MISSION]
    farthest = view.onward[:, lanes, best]
    return Advice(
        level,
        tuple(_why(view, lane, level[lane], step[lane]) for lane in lanes),
        np.where(level == ABORT, 0.0, view.speeds[lanes, step]),
        view.distrusted,
        view.reachable_speed,
        _per_metre(mission),
        _spread(energy * mission),
        view.speeds[lanes, best],
        _per_metre(farthest),
        _spread(energy * farthest),
        _spread(energy * view.homeward[:, lanes, best_home]),
        proposals,
    )


def _spread(quantiles: np.ndarray) -> Quantiles:
    return Quantiles(*quantiles[:PROBABLE])


def _per_metre(by_energy: np.ndarray) -> Quantiles:
    with np.errstate(divide="ignore"):  # where no way is made
        return Quantiles(*(1.0 / by_energy[HIGH::-1]))


def _why(view: Assessment, lane: int, level: int, step: int) -> str:
    """The figures that speak for the action, and what else a planner should know of this lane."""
    so = Situation(*(value[lane] for value in view.situation))
    to_go = view.to_go[lane]
    home = view.home[lane]
    reasons = [
        f"{to_go[MISSION]:.0f} m are within range at {so.speed:.2f} m/s, {so.distance_to_go:.0f} m are to go"
    ]
    if level == DERATE:
        reasons.append(f"{to_go[step]:.0f} m are at {view.speeds[lane, step]:.2f} m/s")
    if level >= RETURN:
        reasons.append(f"{to_go.max():.0f} m are at the best speed")
        reasons.append(
            f"{home.max():.0f} m are probably within range on the way home of {so.distance_home:.0f} m"
        )
    if view.lost[lane]:
        reach = view.reachable_speed.low[lane]
        reasons.append(
            f"it may reach only {reach:.2f} m/s, and the current is {so.current:.2f} m/s"
        )
    if not view.cool[lane, MISSION]:
        reasons.append(f"at {so.speed:.2f} m/s a motor may draw more than it is rated for")
    if view.probability[lane] >= NAMED:
        reasons.append(_named(view, lane))
    return "; ".join(reasons)


def _named(view: Assessment, lane: int) -> str:
    name = classes()[view.suspect[lane]]
    likely = f"{name} is likely ({100 * view.probability[lane]:.0f} %"
    if name == SPEED_SENSOR:
        return f"{likely}): that reading misleads, and at the cheapest speed its error costs least"
    if name.startswith(SENSOR_PREFIX):
        return f"{likely}): do not use that reading"
    return f"{likely}, severity {view.severity[lane]:.2f})"
