"""Which faults of a shaft can be told apart by structure alone, and by numbers if each may be any signal.

Structure is which quantity stands in which equation, analysed by the Fault Diagnosis Toolbox
(Frisk, Krysander & Jung, IFAC-PapersOnLine 50 (2017) 3287, doi:10.1016/j.ifacol.2017.08.504): a
fault is isolable from another if an equation that it disturbs is still overdetermined, in the sense
of Dulmage & Mendelsohn, without those that the other disturbs. The numbers are the
distinguishability of Eriksson, Frisk & Krysander (Automatica 49 (2013) 1591,
doi:10.1016/j.automatica.2013.02.045): the least information that a fault leaves when the other may
be any signal.
"""

import importlib.util
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import BIAS
from auv_fault_env.parameters import ENERGY_WEIGHT, FOOT, SAMPLE_TIME, SHAFT, Vehicle, vehicle_of
from auv_fault_env.physics import (
    RPM,
    PlantConstants,
    Shaft,
    armature_current,
    equilibrium_shaft_speed,
    equilibrium_voltage,
    motor,
    shaft_acceleration,
)

MISSING = 'faultdiagnosistoolbox is not installed; its comparison is left out. To have it: pip install -e ".[bench]"'
UNKNOWN = ("voltage", "current", "spin", "rate", "torque", "speed", "flux")
KNOWN = ("read_voltage", "read_current", "read_rpm", "read_speed")
FAULTS = (
    "resistance",
    "torque_constant",
    "friction",
    "propeller",
    "voltage_sensor",
    "current_sensor",
    "rpm_sensor",
)
# The shaft's equations (`auv_fault_env.physics`) as the names that stand in them.
EQUATIONS = (
    ("voltage", "current", "spin", "flux", "resistance"),
    ("rate", "current", "torque", "flux", "friction"),
    ("flux", "torque_constant"),
    ("torque", "spin", "speed", "propeller"),
    ("read_voltage", "voltage", "voltage_sensor"),
    ("read_current", "current", "current_sensor"),
    ("read_rpm", "spin", "rpm_sensor"),
    ("read_speed", "speed"),
)
PARAMETERS = {  # fault: the parameters that it changes, and their values relative to healthy
    "resistance": {"resistance": 1.2},
    "torque_constant": {"torque_constant": 0.9},
    "friction": {"coulomb_friction": 2.0},
    "propeller": {"c1": 0.7, "c2": 0.7},
}
WINDOW = 20  # samples
EXACT = 1e-7  # standard deviation of the equations without noise, in their units


def isolability_tables() -> dict[str, Any] | None:
    """Faults, and whether each (row) can be told from each other (column); None if the toolbox is not installed.

    Misleads: a fault is taken for an arbitrary signal, though a resistance that has changed stays
    changed, which tells it from a voltage sensor's bias once the current varies; and noise is no
    part of it.
    """
    if importlib.util.find_spec("faultdiagnosistoolbox") is None:
        return None
    import faultdiagnosistoolbox as toolbox

    relations = [list(names) for names in EQUATIONS] + [toolbox.DiffConstraint("rate", "spin")]
    definition = {
        "type": "VarStruc",
        "x": list(UNKNOWN),
        "f": list(FAULTS),
        "z": list(KNOWN),
        "rels": relations,
    }
    alike = toolbox.DiagnosisModel(definition, name="shaft").IsolabilityAnalysis(permute=False)
    return {
        "faults": list(FAULTS),
        "isolable": (alike == 0).tolist(),
        "rates": distinguishability().tolist(),
    }


def distinguishability(vehicle: str | Vehicle = "thesis1992", speed: float = FOOT) -> np.ndarray:
    """Rate of evidence [nat/s] for each fault (row) if each other (column) may be any signal, (n_faults, n_faults).

    Of the port shaft in steady motion at a speed [m/s], linearised there, over `WINDOW` samples
    with default noise.
    """
    by_state, by_fault = _linearised(vehicle_of(vehicle), speed)
    system = _over_time(by_state, step=True)
    signals = [_over_time(column[:, None], step=False) for column in by_fault.T]
    return np.array([[_evidence(system, signal, other) for other in signals] for signal in signals])


def _linearised(vehicle: Vehicle, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of both balances and the four readings, by the state (6, 4) and by the faults (6, n_faults).

    The state is voltage, current, shaft speed [rad/s] and surge speed.
    """
    water = PlantConstants(
        *(getattr(vehicle, name) for name in PlantConstants._fields[:-1]), ENERGY_WEIGHT
    )
    healthy = {name: getattr(vehicle, name) for name in SHAFT}
    spin = equilibrium_shaft_speed(vehicle.alpha, vehicle.beta, speed, water)
    voltage = equilibrium_voltage(Shaft(**healthy), spin, speed, water)
    point = np.array([voltage, armature_current(Shaft(**healthy), spin, voltage), spin, speed])

    def balances(state: np.ndarray, **changed: float) -> np.ndarray:
        shaft = Shaft(**healthy | changed)
        (v, i, w, u) = state
        # the voltage that drives this current
        behind = shaft.resistance * i + shaft.torque_constant * w
        return np.array(
            [
                armature_current(shaft, w, v) - i,
                shaft_acceleration(w, u, motor(shaft, water, behind)),
            ]
        )

    by_state = np.array(
        [(balances(point + step) - balances(point - step)) / 2e-5 for step in 1e-5 * np.eye(4)]
    ).T
    changes = [
        {name: factor * healthy[name] for name, factor in fault.items()}
        for fault in PARAMETERS.values()
    ]
    by_fault = np.array([balances(point, **changed) - balances(point) for changed in changes]).T
    channels = [CHANNELS[name] for name in ("port_voltage", "port_current", "port_rpm", "speed")]
    unit = np.array([1.0, 1.0, RPM, 1.0]) / [channel.noise for channel in channels]
    bias = np.diag([BIAS[channel.unit] / channel.noise for channel in channels])[:, :3]
    faulty = np.block([[by_fault, np.zeros((2, 3))], [np.zeros((4, len(PARAMETERS))), bias]])
    return np.vstack([by_state, np.diag(unit)]), faulty


def _over_time(rows: np.ndarray, step: bool) -> np.ndarray:
    """Rows (6, n) of a sample as those of a window, each in units of its noise; with `step` the shaft's speed moves."""
    ohm = rows[:1] / EXACT
    torque = SAMPLE_TIME * rows[1:2] / EXACT
    readings = rows[2:]
    here = np.eye(WINDOW)
    onward = np.eye(WINDOW - 1, WINDOW, 1)
    moves = np.kron(here[:-1], torque)
    if step:
        moves -= np.kron(onward - here[:-1], np.eye(1, 4, 2)) / EXACT
    return np.vstack([np.kron(here, ohm), moves, np.kron(here, readings)])


def _evidence(system: np.ndarray, signal: np.ndarray, other: np.ndarray) -> float:
    """Half the squared norm [nat/s] of a constant fault that neither states nor the other fault's signal explain."""
    explained = np.hstack([system, other])
    explained = explained / np.maximum(np.linalg.norm(explained, axis=0), 1e-300)
    constant = signal.sum(axis=1)
    left = constant - explained @ np.linalg.lstsq(explained, constant, rcond=1e-9)[0]
    return float(0.5 * left @ left / (WINDOW * SAMPLE_TIME))
