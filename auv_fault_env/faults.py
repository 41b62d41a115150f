"""The catalogue of faults. A fault is data.

At severity s a parameter becomes ``healthy * prod(1 + s (scale - 1)) + sum(s offset)`` over the
faults that are present, within its physical limits.

To add a fault, add an entry to `CATALOGUE`, at any time before the next reset::

    CATALOGUE["ice_on_hull"] = Fault(
        "ice_on_hull",
        component="hull",
        scale={"alpha": 1.4, "gamma": 1.2},
        about="Ice roughens the hull and the rudders.",
        source="estimate",
    )

The entry alone gives the diagnosis class, schedules, sampled episodes, the truth, the picture, and
a hypothesis of every filter bank that is made afterwards. A trained network has no output for the
new class: its probability comes from the filter bank until the network is trained again.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import finite_in_range, known_name
from auv_fault_env.layout import Catalogue
from auv_fault_env.parameters import PARAMETERS, SIDES, Vehicle, is_of_missing_side

NORMAL = "normal"
UNKNOWN = "unknown"  # class of the readings that none of the others explains


@dataclass(frozen=True)
class Fault:
    """What a fault does at severity 1."""

    name: str  # unique, ``kind`` or ``kind:place``
    component: str  # the part that fails: ``hull``, ``propeller:port``, ``sensor:speed``, ...
    scale: Mapping[str, float] = field(default_factory=dict)  # factor by parameter
    offset: Mapping[str, float] = field(default_factory=dict)  # shift by parameter, in its unit
    about: str = ""
    source: str = ""  # of the magnitudes
    # of sampled severities: 1 for a part that is there or gone, with nothing between
    least_severity: float = 0.0
    table_5_1: str | None = None  # mode in that table of the thesis, None if it has none
    table_5_2: str | None = None

    def __post_init__(self):
        finite_in_range(f"least severity of fault {self.name}", self.least_severity, 0.0, 1.0)
        for parameter in (*self.scale, *self.offset):
            known_name(f"parameter of fault {self.name}", parameter, PARAMETERS)
        for parameter, factor in self.scale.items():
            finite_in_range(f"scale of {parameter} in fault {self.name}", factor, 0.0, 1e6)
        for parameter, shift in self.offset.items():
            finite_in_range(f"offset of {parameter} in fault {self.name}", shift, -1e6, 1e6)

    @property
    def diagnosis(self) -> str:
        """Diagnosis class: one for all faults of a sensor, else one for each fault."""
        return self.component if self.component.startswith("sensor:") else self.name

    def is_possible(self, vehicle: Vehicle) -> bool:
        """Whether it changes a part of the vehicle, not only a shaft that does not exist."""
        changed = (*self.scale, *self.offset)
        return not changed or not all(is_of_missing_side(name, vehicle) for name in changed)


def _hull_faults() -> list[Fault]:
    return [
        Fault(
            "increased_drag",
            "hull",
            scale={"alpha": 2.0},
            about="Entanglement: severity is the relative increase of drag.",
            source="thesis V.B; its +35 % is severity 0.35",
            table_5_1="increased drag",
            table_5_2="increased drag",
        ),
        Fault(
            "decreased_drag",
            "hull",
            scale={"alpha": 0.5, "gamma": 0.5},
            about="A control surface is lost, with its drag.",
            source="thesis V.B; magnitude estimated",
            table_5_2="decreased drag",
        ),
    ]


def _side_faults(side: str) -> list[Fault]:
    return [
        Fault(
            f"propeller_damage:{side}",
            f"propeller:{side}",
            scale={f"{side}_beta": 0.5, f"{side}_c1": 0.6, f"{side}_c2": 0.6},
            about="Bent or chipped blades: less thrust, and less torque.",
            source="thesis V.B; magnitude estimated",
            table_5_1="degraded propeller",
            table_5_2="decreased propulsion",
        ),
        Fault(
            f"propeller_loss:{side}",
            f"propeller:{side}",
            scale={f"{side}_beta": 0.0, f"{side}_c1": 0.0, f"{side}_c2": 0.0},
            about="The propeller is gone, never a part of it: the shaft turns freely.",
            source="thesis V.D: beta of one propeller to zero",
            least_severity=1.0,
            table_5_1="degraded propeller",
            table_5_2="severe propulsion failure",
        ),
        Fault(
            f"seal_friction:{side}",
            f"shaft:{side}",
            scale={f"{side}_coulomb_friction": 3.0},
            offset={f"{side}_viscous_friction": 2e-4},
            about="The shaft seal binds.",
            source="thesis V.C; magnitude estimated: twice the motor's friction more",
            table_5_1="increased seal friction",
        ),
        Fault(
            f"motor_overheating:{side}",
            f"motor:{side}",
            scale={f"{side}_resistance": 1.4, f"{side}_torque_constant": 0.8},
            about="The motor is 100 K too hot: copper resists more, magnets weaken.",
            source="copper +0.39 %/K, ferrite magnets -0.2 %/K",
        ),
    ]


# Shifts at severity 1 by unit: about what a supply, a shunt or a counter loses when it fails.
BIAS = {"m/s": 0.15, "m/s^2": 0.03, "V": 1.0, "A": 0.4, "rpm": 60.0}


def _sensor_faults(channel: str) -> list[Fault]:
    bias = BIAS[CHANNELS[channel].unit]
    noise = CHANNELS[channel].noise
    cited = "de Benito 1990, as cited by the thesis"
    kinds: dict[str, dict[str, Any]] = {
        "bias": dict(
            offset={f"{channel}_bias": bias},
            about="The zero shifts.",
            source="estimate",
        ),
        "scale": dict(
            scale={f"{channel}_gain": 0.6},
            about="Calibration lost; on the paddle wheel, fouling.",
            source="thesis II.A; magnitude estimated",
        ),
        "stuck": dict(
            offset={f"{channel}_stuck": 1.0},
            about="Severity is the share of the samples that repeat the last reading.",
            source=cited,
        ),
        "dropout": dict(
            offset={f"{channel}_dropout": 1.0},
            about="Disconnected: severity is the share of the samples that read zero.",
            source=cited,
        ),
        "noise": dict(
            offset={f"{channel}_noise": 9.0 * noise},
            about="The noise grows to ten times its default.",
            source=cited,
        ),
    }
    return [
        Fault(f"sensor_{kind}:{channel}", f"sensor:{channel}", **data)
        for kind, data in kinds.items()
    ]


CATALOGUE: dict[str, Fault] = {
    fault.name: fault
    for family in (
        _hull_faults(),
        *map(_side_faults, SIDES),
        *map(_sensor_faults, READINGS),
    )
    for fault in family
}


def fault_effect(severity, scale, offset):
    """Factor on a parameter, and shift, by one fault; numbers or arrays that broadcast."""
    return 1.0 + severity * (scale - 1.0), severity * offset


def fault_of(name: str) -> Fault:
    """The fault of that name; an unknown name is refused with the nearest one and all names."""
    return CATALOGUE[known_name("fault", name, CATALOGUE)]


def fault_classes() -> tuple[str, ...]:
    """Diagnosis classes of the faults, in the order of the catalogue."""
    return tuple(dict.fromkeys(fault.diagnosis for fault in CATALOGUE.values()))


def known_classes() -> tuple[str, ...]:
    """Diagnosis classes that say what the vehicle is like: `normal`, then those of the faults."""
    return (NORMAL, *fault_classes())


def classes() -> tuple[str, ...]:
    """Diagnosis classes, those that a belief is over: the known ones, and last `unknown`.

    The probability of `unknown` is that none of the others explains the readings. No fault of the
    catalogue belongs to it.
    """
    return (*known_classes(), UNKNOWN)


def labels() -> dict[str, tuple[str | None, str | None]]:
    """Modes of every class in Table 5.1 (raw network) and in Table 5.2 (Kalman network).

    None where the table has no mode for the class.

    >>> labels()["propeller_loss:port"]
    ('degraded propeller', 'severe propulsion failure')
    """
    modes = {fault.diagnosis: (fault.table_5_1, fault.table_5_2) for fault in CATALOGUE.values()}
    return {NORMAL: (NORMAL, NORMAL), **modes, UNKNOWN: (None, None)}


def matrices(faults: Iterable[Fault] | None = None) -> Catalogue:
    """The faults, None for those of the catalogue, as arrays for the kernel, in their order."""
    faults = list(CATALOGUE.values() if faults is None else faults)
    names = list(PARAMETERS)
    scale = np.ones((len(faults), len(names)))
    offset = np.zeros((len(faults), len(names)))
    for row, fault in enumerate(faults):
        for parameter, value in fault.scale.items():
            scale[row, names.index(parameter)] = value
        for parameter, value in fault.offset.items():
            offset[row, names.index(parameter)] = value
    is_changed = (scale != 1.0) | (offset != 0.0)
    changed = np.full((len(faults), is_changed.sum(axis=1).max(initial=0)), -1)
    for row, of_fault in enumerate(is_changed):
        parameters = np.flatnonzero(of_fault)
        changed[row, : parameters.size] = parameters
    limits = np.array([(spec.low, spec.high) for spec in PARAMETERS.values()])
    low, high = limits.T.copy()
    return Catalogue(scale, offset, changed, low, high)
