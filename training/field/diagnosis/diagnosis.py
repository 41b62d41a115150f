"""From a log to a verdict: beliefs sample by sample, the alarms in them, and what they say of the fault."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.faults import CATALOGUE, Fault, classes
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from diagnosers import Belief, Diagnoser, make
from diagnosers.kalman import NOISE_FLOOR
from diagnosers.registry import class_of
from training.benchmark.thresholds import ONE_PER_10_HOURS
from training.field.diagnosis.estimates import shaft_loads
from training.field.logs.log import Log
from training.field.logs.resolution import is_coarse, noise_with_rounding, resolutions
from training.field.vehicle_file import VehicleFile
from training.metrics import alarms
from training.metrics.records import PERSISTENCE

# may be a vehicle's own
OWN_PARAMETERS = ("filter_bank", "integrated", "cusum", "rules", "limits", "kalman_network")
THRESHOLDS: dict[str, float] = {name: ONE_PER_10_HOURS[name] for name in OWN_PARAMETERS}
HEALTHY = "healthy"
FAULT = "fault"
UNUSABLE = "unusable"
TOP = 3  # classes named
TWO_SIDED = 1.96  # standard deviations of a 95 % interval
# of a log, for diagnosers that know no silence between two readings
LEAST_RATE = 0.95 * SAMPLE_RATE


@dataclass(frozen=True)
class Verdict:
    """What is said of a log.

    Attributes
    ----------
    log
        Its path.
    verdict
        `HEALTHY`, `FAULT` or `UNUSABLE`.
    duration
        Length [s].
    alarms
        Begin and end of every alarm [s from the log's start]; what follows holds for the last
        sample of the last one.
    fault, side
        Most probable class, and its side if it has one.
    severity, severity_low, severity_high
        Of that class, 0 to 1, with a 95 % interval.
    top
        The most probable faults with their probabilities; of a healthy log at its end.
    load
        Load of each shaft against a healthy one during the alarms, less one: above 0 is more, below
        0 less.
    remarks
        What was repaired in the log, or why it is unusable.
    """

    log: str
    verdict: str
    duration: float | None = None
    alarms: tuple[tuple[float, float], ...] = ()
    fault: str | None = None
    side: str | None = None
    severity: float | None = None
    severity_low: float | None = None
    severity_high: float | None = None
    top: tuple[tuple[str, float], ...] = ()
    load: Mapping[str, float] | None = None
    remarks: tuple[str, ...] = ()

    @property
    def alarm_time(self) -> float | None:
        """When the first alarm began [s]."""
        return self.alarms[0][0] if self.alarms else None


def diagnoser_for(name: str, vehicle: VehicleFile, resolution: Mapping[str, float]) -> Diagnoser:
    """The diagnoser on this vehicle's own parameters; resolution by reading, in the channel's unit.

    Channels that do not exist, and logs slower than 10 Hz, are for the filter bank alone: the
    others would take the silence for a broken sensor, and are refused.
    """
    taken = inspect.signature(class_of(known_name("diagnoser", name, THRESHOLDS))).parameters
    silent = tuple(channel for channel in READINGS if channel not in vehicle.columns)
    if "faults" not in taken and (silent or vehicle.sample_rate < LEAST_RATE):
        lacking = ", ".join(silent) or f"a rate of {SAMPLE_RATE:g} Hz"
        raise refusal(
            "diagnoser",
            name,
            f"filter_bank for a vehicle without {lacking}",
            "leave --diagnoser out",
        )
    sides = sides_seen(vehicle)
    missing = tuple(
        f"{part}_" for part in (*silent, *(side for side in SIDES if side not in sides))
    )
    noise = {
        name: max(value, NOISE_FLOOR * CHANNELS[name].noise)
        for name, value in vehicle.noise.items()
    }
    coarse = [name for name, step in resolution.items() if is_coarse(step, noise[name])]
    missing += tuple(f"{name}_{loss}" for name in coarse for loss in ("stuck", "dropout"))
    settings = dict(
        vehicle=vehicle.vehicle,
        band=dict(vehicle.band),
        noise={
            name: noise_with_rounding(value, resolution.get(name, 0.0))
            for name, value in noise.items()
        },
        resolution=dict(resolution),
        shafts=len(sides),
        faults=tuple(fault.name for fault in CATALOGUE.values() if not touches(fault, missing)),
    )
    return make(name, **{key: value for key, value in settings.items() if key in taken})


def sides_seen(vehicle: VehicleFile) -> tuple[str, ...]:
    """Sides whose voltage or shaft speed is logged; a starboard shaft that is not is taken to turn as the port one."""
    sides = tuple(
        side for side in SIDES if {f"{side}_voltage", f"{side}_rpm"} & vehicle.columns.keys()
    )
    if SIDES[0] not in sides:
        allowed = "port_voltage or port_rpm among them"
        raise refusal("channels", list(vehicle.columns), allowed, "name the column of either")
    return sides


def touches(fault: Fault, prefixes: tuple[str, ...]) -> bool:
    """Whether a fault changes a parameter whose name begins so."""
    return any(name.startswith(prefixes) for name in (*fault.scale, *fault.offset))


def persistence(vehicle: VehicleFile) -> int:
    """Samples of 0.1 s for which p(normal) must stay low: three of the vehicle's own readings, as in the benchmark."""
    return PERSISTENCE * max(1, round(SAMPLE_RATE / vehicle.sample_rate))


def beliefs(log: Log, name: str, vehicle: VehicleFile) -> Belief:
    """What a diagnoser believes along a log, (n_samples, n_classes) float32; it starts anew with every segment."""
    diagnoser = diagnoser_for(name, vehicle, resolutions(log, vehicle))
    shape = len(log.time), len(diagnoser.classes)
    along = Belief(*(np.zeros(shape, np.float32) for _ in Belief._fields))
    with tqdm(total=shape[0], desc=log.name, unit="sample", unit_scale=True, leave=False) as bar:
        for segment in log.segments:
            diagnoser.reset(1)
            for k in range(segment.start, segment.stop):
                for kept, values in zip(
                    along, diagnoser.update(log.observation[k : k + 1]), strict=True
                ):
                    kept[k] = values[0]
                bar.update()
    return along


def alarm_along(log: Log, belief: Belief, threshold: float, samples: int) -> np.ndarray:
    """Where an alarm stands, (n_samples,) bool: log p(normal) below the threshold for so many samples of a segment."""
    standing = np.zeros(len(log.time), bool)
    for segment in log.segments:
        standing[segment] = alarms(belief.log_probability[segment, :1], threshold, samples)[:, 0]
    return standing


def verdict(
    path: str, log: Log, belief: Belief, standing: np.ndarray, vehicle: VehicleFile
) -> Verdict:
    """What the beliefs and alarms along a log say of it."""
    names = classes()
    at = int(np.flatnonzero(standing)[-1]) if standing.any() else len(standing) - 1
    probability = np.exp(belief.log_probability[at].astype(np.float64))
    order = 1 + np.argsort(-probability[1:])[:TOP]
    said = dict(
        log=path,
        duration=float(log.time[-1] - log.time[0]),
        top=tuple((names[k], float(probability[k])) for k in order),
        remarks=log.remarks,
    )
    if not standing.any():
        return Verdict(verdict=HEALTHY, **said)
    worst = int(order[0])
    mean = float(belief.severity_mean[at, worst])
    spread = TWO_SIDED * float(belief.severity_std[at, worst])
    return Verdict(
        verdict=FAULT,
        alarms=intervals(log, standing),
        fault=names[worst],
        side=side_of(names[worst]),
        severity=mean,
        severity_low=max(mean - spread, 0.0),
        severity_high=min(mean + spread, 1.0),
        load=shaft_loads(log, standing, vehicle),
        **said,
    )


def intervals(log: Log, standing: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Begin and end [s] of every alarm; one that stands at a segment's end ends there."""
    edges = np.zeros(len(standing) + 1, bool)
    edges[[segment.start for segment in log.segments]] = True
    before = np.concatenate([[False], standing[:-1]])
    begins = np.flatnonzero(standing & (~before | edges[:-1]))
    ends = np.flatnonzero(standing & np.concatenate([~standing[1:] | edges[1:-1], [True]]))
    return tuple(zip(log.time[begins].tolist(), log.time[ends].tolist(), strict=True))


def side_of(fault: str) -> str | None:
    """The side that a class names, None if it names none.

    >>> side_of("seal_friction:port"), side_of("sensor:starboard_rpm"), side_of("sensor:speed")
    ('port', 'starboard', None)
    """
    return next((side for side in SIDES if f":{side}" in fault), None)
