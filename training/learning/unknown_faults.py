"""Random faults of no class, from which a network learns `unknown`.

Four kinds, equally likely: two or three parameters of one shaft; two or three of different parts of
the vehicle; a ripple or a delay of one sensor; the same fault of the catalogue on both sides. But
for the last kind, none has its parameters within those of one diagnosis class, and none has just
those of a fault in `UNMODELLED`, on which diagnosers are tested.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.faults import BIAS, CATALOGUE, Fault, fault_effect
from auv_fault_env.layout import SeverityProfile
from auv_fault_env.parameters import SHAFT, SIDES
from auv_fault_env.schedules import Events
from auv_fault_env.unmodelled import UNMODELLED, UnmodelledFault, plant_faults
from training.logged_vehicle import THESIS, LoggedVehicle

# sizes stand out from the healthy band; estimates of this project
LEAST_FACTOR = 1.25  # of a changed parameter, or its inverse
LARGEST_FACTOR = 2.0
VISCOUS_FRICTION = (1e-4, 4e-4)  # N m s/rad, more than none
BIAS_SHARE = (0.5, 1.0)  # of the bias of a failed sensor
RIPPLE = (2.0, 6.0)  # amplitude by the standard deviation of the noise
DELAY = (2, 5)  # samples
PAIR_SEVERITY = (0.4, 1.0)  # of each of two faults
OF_SHAFT = tuple(f"{side}_{name}" for side in SIDES for name in SHAFT)
OF_VEHICLE = (
    *("alpha", *OF_SHAFT),
    *(f"{channel}_{name}" for channel in READINGS for name in ("bias", "gain")),
)
OF_SIGNALS = (
    *(f"{channel}_ripple" for channel in READINGS),
    *(f"{side}_{reading}_latency" for side in SIDES for reading in ("voltage", "current")),
)


def with_unknown_faults(
    events: Events,
    share: float,
    random: np.random.Generator,
    vehicle: LoggedVehicle = THESIS,
) -> tuple[Events, list[Fault]]:
    """The events, a share of the faulty lanes with one unknown fault in place of theirs.

    An unknown fault is fully present, with onset, ramp and period of the one that it replaces. The
    faults are those that a `Fleet` needs as `more_faults`.
    """
    is_faulty = events.fault[:, 0] >= 0
    replaced = np.flatnonzero(is_faulty & (random.uniform(size=len(is_faulty)) < share))
    faults = [random_fault(random, vehicle) for _ in replaced]
    fault = events.fault.copy()
    fault[replaced] = -1
    fault[replaced, 0] = len(plant_faults()) + np.arange(len(replaced))
    profile = events.profile.copy()
    profile[replaced, 0, SeverityProfile._fields.index("severity")] = 1.0
    profile[replaced, 1:, SeverityProfile._fields.index("onset")] = math.inf
    return Events(fault, profile), faults


def random_fault(random: np.random.Generator, vehicle: LoggedVehicle = THESIS) -> Fault:
    """A fault of no class, of what the vehicle's logs show; at severity 1 it stands out."""
    kinds = [_of_shaft, _of_vehicle]
    if shown(OF_SIGNALS, vehicle):
        kinds.append(_of_signal)
    has_pairs = vehicle.vehicle.sides == SIDES
    kind = random.integers(len(kinds) + has_pairs)
    return _pair(random) if kind == len(kinds) else _new(kinds[kind], random, vehicle)


def _new(
    draw: Callable[[np.random.Generator, LoggedVehicle], list[str]],
    random: np.random.Generator,
    vehicle: LoggedVehicle,
) -> Fault:
    """A fault of parameters that neither a class nor a test has."""
    names = draw(random, vehicle)
    while _is_class_or_test(frozenset(names)):
        names = draw(random, vehicle)
    scale = {}
    offset = {}
    for name in names:
        change = _offset(name, random, vehicle)
        if change is None:
            exponent = random.uniform(math.log(LEAST_FACTOR), math.log(LARGEST_FACTOR))
            scale[name] = math.exp(random.choice([-1.0, 1.0]) * exponent)
        else:
            offset[name] = change
    return UnmodelledFault("random", "vehicle", scale, offset)


def _offset(name: str, random: np.random.Generator, vehicle: LoggedVehicle) -> float | None:
    """By how much a parameter shifts; None if it is multiplied."""
    if name.endswith("viscous_friction"):
        return random.uniform(*VISCOUS_FRICTION)
    channel, _, kind = name.rpartition("_")
    if kind == "bias":
        size = random.uniform(*BIAS_SHARE) * BIAS[CHANNELS[channel].unit]
        return random.choice([-1.0, 1.0]) * size
    if kind == "ripple":
        return random.uniform(*RIPPLE) * vehicle.noise.get(channel, CHANNELS[channel].noise)
    if kind == "latency":
        return float(random.integers(*DELAY, endpoint=True))
    return None


def _of_shaft(random: np.random.Generator, vehicle: LoggedVehicle) -> list[str]:
    side = random.choice(vehicle.vehicle.sides)
    names = [f"{side}_{name}" for name in SHAFT]
    return random.choice(names, random.integers(2, 4), replace=False).tolist()


def _of_vehicle(random: np.random.Generator, vehicle: LoggedVehicle) -> list[str]:
    names = shown(OF_VEHICLE, vehicle)
    return random.choice(names, random.integers(2, 4), replace=False).tolist()


def _of_signal(random: np.random.Generator, vehicle: LoggedVehicle) -> list[str]:
    return [str(random.choice(shown(OF_SIGNALS, vehicle)))]


def shown(names: Sequence[str], vehicle: LoggedVehicle) -> list[str]:
    """The parameters whose faults the vehicle's logs show."""
    return [name for name in names if not name.startswith(vehicle.hidden)]


def _is_class_or_test(names: frozenset[str]) -> bool:
    """Whether one class explains a change of these parameters, or a test has just these."""
    if any(names == _parameters(fault) for fault in UNMODELLED.values()):
        return True
    return any(names <= of_class for of_class in _parameters_of_classes())


def _parameters(fault: Fault) -> frozenset[str]:
    return frozenset((*fault.scale, *fault.offset))


def _parameters_of_classes() -> list[frozenset[str]]:
    of_classes: dict[str, frozenset[str]] = {}
    for fault in CATALOGUE.values():
        others = of_classes.get(fault.diagnosis, frozenset())
        of_classes[fault.diagnosis] = others | _parameters(fault)
    return list(of_classes.values())


def _pair(random: np.random.Generator) -> Fault:
    """One fault of the catalogue on both sides, each of its own severity."""
    name = random.choice([name for name in CATALOGUE if "port" in name])
    scale = {}
    offset = {}
    for side in SIDES:
        fault = CATALOGUE[name.replace("port", side)]
        least = max(PAIR_SEVERITY[0], fault.least_severity)
        severity = random.uniform(least, PAIR_SEVERITY[1])
        for parameter, factor in fault.scale.items():
            scale[parameter], _ = fault_effect(severity, factor, 0.0)
        for parameter, shift in fault.offset.items():
            _, offset[parameter] = fault_effect(severity, 1.0, shift)
    return UnmodelledFault("random", "vehicle", scale, offset)
