"""From a log to a verdict: beliefs sample by sample, alarms, and the most probable fault."""

import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import READINGS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.faults import CATALOGUE, UNKNOWN, classes
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from diagnosers import Belief, Diagnoser, load, make, storage
from diagnosers.registry import class_of
from diagnosers.residuals import Residuals
from training.benchmark.thresholds import ONE_PER_HOUR
from training.field.diagnosis.causes import Cause
from training.field.diagnosis.estimates import excess_loads
from training.field.logged import logged_vehicle
from training.field.logs.log import Log
from training.field.logs.resolution import COARSE, ROUNDING, resolutions
from training.field.vehicle_file import DIAGNOSERS, VEHICLE_DIAGNOSERS, VehicleFile
from training.logged_vehicle import changes_parameter
from training.metrics import alarms
from training.metrics.records import PERSISTENCE

# the last only with weights of its own
THRESHOLDS: dict[str, float] = {
    **{name: ONE_PER_HOUR[name] for name in (*VEHICLE_DIAGNOSERS, "raw_network")},
    Residuals.name: math.log(0.5),  # at the limits of the vehicle's own relations
}
HEALTHY = "healthy"
FAULT = "fault"
UNUSABLE = "unusable"
TOP = 3  # classes in a verdict
TWO_SIDED = 1.96  # standard deviations of a 95 % interval
# Hz of a log, for diagnosers that take a missing reading for a fault
LEAST_RATE = 0.95 * SAMPLE_RATE


@dataclass(frozen=True)
class Verdict:
    """The verdict on a log; `fault` to `top` hold for the last sample of the last alarm."""

    log: str  # its path
    verdict: str  # `HEALTHY`, `FAULT` or `UNUSABLE`
    duration: float | None = None  # length [s]
    alarms: tuple[tuple[float, float], ...] = ()  # begin and end [s from the log's start]
    fault: str | None = None  # most probable class
    side: str | None = None  # of that class, if it has one
    # of that class, 0 to 1; none for an unknown one, nor where the interval is all of that
    severity: float | None = None
    severity_low: float | None = None  # of the 95 % interval
    severity_high: float | None = None
    top: tuple[tuple[str, float], ...] = ()  # the most probable faults with their probabilities
    raised_by: tuple[Cause, ...] = ()  # the rule of each alarm
    # in the last alarm, by name: value, std and limit, relative; none without relations
    indicators: Mapping[str, Mapping[str, float]] | None = None
    load: Mapping[str, float] | None = None  # relative to a healthy shaft in the alarms, less one
    remarks: tuple[str, ...] = ()  # what was repaired in the log, or why it is unusable

    @property
    def alarm_time(self) -> float | None:
        """When the first alarm began [s]."""
        return self.alarms[0][0] if self.alarms else None


def diagnoser_for(
    name: str,
    vehicle: VehicleFile,
    resolution: Mapping[str, float],
    weights: Path | None = None,
) -> Diagnoser:
    """The diagnoser with this vehicle's parameters; resolution by reading, in the channel's unit.

    With a file of weights it is the network that was trained on this vehicle. Without, only the
    filter bank accepts missing channels and logs slower than 10 Hz. The other diagnosers would take
    the missing readings for a broken sensor, and are refused. `residuals` needs the relations that
    calibration writes.
    """
    if weights is not None:
        return trained_network(name, vehicle, weights)
    if name == Residuals.name:
        return residuals_for(vehicle)
    settings = inspect.signature(class_of(known_name("diagnoser", name, DIAGNOSERS))).parameters
    absent = tuple(channel for channel in READINGS if channel not in vehicle.columns)
    if "faults" not in settings and (absent or vehicle.sample_rate < LEAST_RATE):
        lacking = ", ".join(absent) or f"a rate of {SAMPLE_RATE:g} Hz"
        allowed = f"filter_bank for a vehicle without {lacking}"
        raise refusal("diagnoser", name, allowed, "leave --diagnoser out")
    logged = logged_vehicle(vehicle)
    noise = {}
    unobservable = list(logged.hidden)
    for reading, sensor_std in logged.noise.items():
        step = resolution.get(reading, 0.0)
        noise[reading] = max(sensor_std, ROUNDING * step)
        if step > COARSE * sensor_std:
            unobservable += [f"{reading}_stuck", f"{reading}_dropout"]
    prefixes = tuple(unobservable)
    faults = [fault for fault in CATALOGUE.values() if not changes_parameter(fault, prefixes)]
    choices = dict(
        vehicle=vehicle.vehicle,
        band=logged.band,
        noise=noise,
        resolution=dict(resolution),
        shafts=logged.vehicle.shafts,
        faults=tuple(fault.name for fault in faults),
    )
    return make(name, **{key: choice for key, choice in choices.items() if key in settings})


def trained_network(name: str, vehicle: VehicleFile, weights: Path) -> Diagnoser:
    """The network of `auv-fault train --vehicle`; of another diagnoser or vehicle it is refused."""
    network = load(weights)
    if network.name != name:
        remedy = f"add --diagnoser {network.name}, or take other weights"
        raise refusal(f"weights of {weights}", network.name, f"those of {name}", remedy)
    trained_on = storage.read(weights)[1].get("vehicle")
    digest = logged_vehicle(vehicle).digest
    if not isinstance(trained_on, dict) or trained_on.get("digest") != digest:
        allowed = f"this vehicle file, digest {digest}"
        remedy = f"train on it: auv-fault train {name} --vehicle FILE"
        raise refusal(f"vehicle of {weights}", trained_on, allowed, remedy)
    return network


def residuals_for(vehicle: VehicleFile) -> Residuals:
    """The diagnoser of the vehicle's own relations."""
    if vehicle.relations is None:
        allowed = "a vehicle file with [relations]"
        remedy = "calibrate it with logs that have speed, voltages and currents"
        raise refusal("diagnoser", Residuals.name, allowed, remedy)
    return Residuals(vehicle.relations)


def persistence(vehicle: VehicleFile) -> int:
    """Samples of 0.1 s for which p(normal) must stay low: three readings of the vehicle."""
    return PERSISTENCE * max(1, round(SAMPLE_RATE / vehicle.sample_rate))


def beliefs(log: Log, name: str, vehicle: VehicleFile, weights: Path | None = None) -> Belief:
    """Beliefs of a diagnoser, started anew with every segment, (n_samples, n_classes) float32."""
    diagnoser = diagnoser_for(name, vehicle, resolutions(log, vehicle), weights)
    shape = len(log.time), len(diagnoser.classes)
    along = Belief(*(np.zeros(shape, np.float32) for _ in Belief._fields))
    # the delay: a line about what is compiled comes before the bar, not in it
    with tqdm(
        total=shape[0], desc=log.name, unit="sample", unit_scale=True, leave=False, delay=1.0
    ) as bar:
        for segment in log.segments:
            begin = segment.start
            for part in _beliefs_in_parts(diagnoser, log.observation[segment]):
                end = begin + len(part.log_probability)
                for column, values in zip(along, part, strict=True):
                    column[begin:end] = values
                bar.update(end - begin)
                begin = end
    return along


def _beliefs_in_parts(diagnoser: Diagnoser, observations: np.ndarray) -> Iterator[Belief]:
    """The beliefs along an episode (n_samples, n_channels), from part to part of it."""
    if isinstance(diagnoser, Residuals):
        yield diagnoser.beliefs(diagnoser.course(observations), len(observations))
        return
    diagnoser.reset(1)
    for k in range(len(observations)):
        yield diagnoser.update(observations[k : k + 1])


def is_alarmed(log: Log, belief: Belief, threshold: float, samples: int) -> np.ndarray:
    """Where log p(normal) is below the threshold for `samples` samples or more, (n_samples,)."""
    alarmed = np.zeros(len(log.time), bool)
    for segment in log.segments:
        log_normal = belief.log_probability[segment, :1]
        alarmed[segment] = alarms(log_normal, threshold, samples)[:, 0]
    return alarmed


def verdict(
    path: str, log: Log, belief: Belief, alarmed: np.ndarray, vehicle: VehicleFile
) -> Verdict:
    """The verdict from the beliefs and alarms along a log."""
    healthy = Verdict(
        log=path,
        verdict=HEALTHY,
        duration=float(log.time[-1] - log.time[0]),
        remarks=log.remarks,
    )
    if not alarmed.any():
        return healthy
    names = classes()
    last = int(np.flatnonzero(alarmed)[-1])
    probability = np.exp(belief.log_probability[last].astype(np.float64))
    order = 1 + np.argsort(-probability[1:])[:TOP]
    worst = int(order[0])
    one_fault = replace(
        healthy,
        verdict=FAULT,
        alarms=alarm_intervals(log, alarmed),
        fault=names[worst],
        side=side_of(names[worst]),
        top=tuple((names[k], float(probability[k])) for k in order),
        load=excess_loads(log, alarmed, vehicle),
    )
    if names[worst] == UNKNOWN:
        return one_fault
    severity = float(belief.severity_mean[last, worst])
    margin = TWO_SIDED * float(belief.severity_std[last, worst])
    low = max(severity - margin, 0.0)
    high = min(severity + margin, 1.0)
    if (low, high) == (0.0, 1.0):
        return one_fault
    return replace(one_fault, severity=severity, severity_low=low, severity_high=high)


def alarm_intervals(log: Log, alarmed: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Begin and end [s] of every alarm; one that stands at a segment's end ends there."""
    is_start = np.zeros(len(alarmed) + 1, bool)
    is_start[[segment.start for segment in log.segments]] = True
    was_alarmed = np.concatenate([[False], alarmed[:-1]])
    is_last = np.concatenate([~alarmed[1:] | is_start[1:-1], [True]])
    begins = np.flatnonzero(alarmed & (~was_alarmed | is_start[:-1]))
    ends = np.flatnonzero(alarmed & is_last)
    return tuple(zip(log.time[begins].tolist(), log.time[ends].tolist(), strict=True))


def side_of(fault: str) -> str | None:
    """The side that a class names, None if it names none.

    >>> (
    ...     side_of("seal_friction:port"),
    ...     side_of("sensor:starboard_rpm"),
    ...     side_of("sensor:speed"),
    ... )
    ('port', 'starboard', None)
    """
    return next((side for side in SIDES if f":{side}" in fault), None)
