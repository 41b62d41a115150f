"""Which faults of a shaft can be isolated from each other by structure, and by information.

Structure is which quantity occurs in which equation, analysed by the Fault Diagnosis Toolbox
(Frisk, Krysander & Jung, IFAC-PapersOnLine 50 (2017) 3287, doi:10.1016/j.ifacol.2017.08.504): a
fault is isolable from another if an equation that it disturbs is still overdetermined, in the sense
of Dulmage & Mendelsohn, without those that the other disturbs. Information is the
distinguishability of Eriksson, Frisk & Krysander (Automatica 49 (2013) 1591,
doi:10.1016/j.automatica.2013.02.045): the least information about a fault that remains when the
other may be any signal.
"""

import importlib.util
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import BIAS
from auv_fault_env.parameters import FOOT, SAMPLE_TIME, SHAFT, Vehicle, vehicle_of
from auv_fault_env.physics import (
    RPM,
    Shaft,
    armature_current,
    equilibrium_shaft_speed,
    equilibrium_voltage,
    motor,
    plant_constants,
    shaft_acceleration,
)

MISSING = (
    "faultdiagnosistoolbox is not installed, so that this comparison is missing. To install it: "
    'pip install -e ".[bench]"'
)
UNKNOWN = ("voltage", "current", "spin", "rate", "torque", "speed", "flux")
KNOWN = ("read_voltage", "read_current", "read_rpm", "read_speed")
FAULTS = (
    *("resistance", "torque_constant", "friction", "propeller"),
    *("voltage_sensor", "current_sensor", "rpm_sensor"),
)
# the equations of a shaft (`auv_fault_env.physics`), each as the names that occur in it
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
# by fault: the parameters that it changes, and their values relative to healthy
PARAMETERS = {
    "resistance": {"resistance": 1.2},
    "torque_constant": {"torque_constant": 0.9},
    "friction": {"coulomb_friction": 2.0},
    "propeller": {"c1": 0.7, "c2": 0.7},
}
# samples
WINDOW = 20
# standard deviation of the equations without noise, in their units
EXACT = 1e-7
CHANNEL_NAMES = ("port_voltage", "port_current", "port_rpm", "speed")
# rpm readings from rad/s, the other readings in the units of the state
READING_FACTORS = np.array([1.0, 1.0, RPM, 1.0])


def isolability_tables() -> dict[str, Any] | None:
    """Whether each fault (row) is isolable from each other (column); None without the toolbox.

    Misleads: a fault counts as an arbitrary signal, though a changed resistance is constant, which
    distinguishes it from a bias of the voltage sensor once the current varies; and the analysis
    ignores noise.

    Returns
    -------
    tables
        faults, isolable (by structure), rates (`distinguishability`).
    """
    if importlib.util.find_spec("faultdiagnosistoolbox") is None:
        return None
    import faultdiagnosistoolbox as toolbox

    relations = [list(names) for names in EQUATIONS] + [toolbox.DiffConstraint("rate", "spin")]
    names = {"x": list(UNKNOWN), "f": list(FAULTS), "z": list(KNOWN)}
    definition = {"type": "VarStruc", "rels": relations} | names
    model = toolbox.DiagnosisModel(definition, name="shaft")
    not_isolable = model.IsolabilityAnalysis(permute=False)
    return {
        "faults": list(FAULTS),
        "isolable": (not_isolable == 0).tolist(),
        "rates": distinguishability().tolist(),
    }


def distinguishability(vehicle: str | Vehicle = "thesis1992", speed: float = FOOT) -> np.ndarray:
    """Rate of evidence [nat/s] for each fault (row) when each other (column) may be any signal.

    The port shaft is linearised in steady motion at a speed [m/s], and observed over `WINDOW`
    samples with default noise.

    Returns
    -------
    rates
        (n_faults, n_faults).
    """
    by_state, by_fault = _linearised(vehicle_of(vehicle), speed)
    system = _over_window(by_state, shaft_moves=True)
    signals = [_over_window(column[:, None], shaft_moves=False) for column in by_fault.T]
    return np.array([[_evidence(system, signal, other) for other in signals] for signal in signals])


def _linearised(vehicle: Vehicle, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of both balances and the four readings by the state and by the faults.

    The state is voltage, current, shaft speed [rad/s] and surge speed; shapes are (6, 4) and (6,
    n_faults).
    """
    constants = plant_constants(vehicle)
    healthy = {name: getattr(vehicle, name) for name in SHAFT}
    healthy_shaft = Shaft(**healthy)
    shaft_speed = equilibrium_shaft_speed(vehicle.alpha, vehicle.beta, speed, constants)
    voltage = equilibrium_voltage(healthy_shaft, shaft_speed, speed, constants)
    current = armature_current(healthy_shaft, shaft_speed, voltage)
    equilibrium = np.array([voltage, current, shaft_speed, speed])

    def balances(state: np.ndarray, **changed: float) -> np.ndarray:
        shaft = Shaft(**healthy | changed)
        v, i, w, u = state
        driving_voltage = shaft.resistance * i + shaft.torque_constant * w
        coefficients = motor(shaft, constants, driving_voltage)
        acceleration = shaft_acceleration(w, u, coefficients)
        return np.array([armature_current(shaft, w, v) - i, acceleration])

    columns = [
        (balances(equilibrium + step) - balances(equilibrium - step)) / 2e-5
        for step in 1e-5 * np.eye(4)
    ]
    by_state = np.array(columns).T
    effects = []
    for factors in PARAMETERS.values():
        changed = {name: factor * healthy[name] for name, factor in factors.items()}
        effects.append(balances(equilibrium, **changed) - balances(equilibrium))
    by_fault = np.array(effects).T
    channels = [CHANNELS[name] for name in CHANNEL_NAMES]
    readings = READING_FACTORS / [channel.noise for channel in channels]
    bias = np.diag([BIAS[channel.unit] / channel.noise for channel in channels])[:, :3]
    by_state = np.vstack([by_state, np.diag(readings)])
    no_bias = np.zeros((2, 3))
    no_effect = np.zeros((4, len(PARAMETERS)))
    return by_state, np.block([[by_fault, no_bias], [no_effect, bias]])


def _over_window(rows: np.ndarray, shaft_moves: bool) -> np.ndarray:
    """The rows (6, n) of one sample repeated for all samples of a window, in units of their noise.

    With `shaft_moves` the columns are states, so that the torque balance links successive samples.
    """
    current_balance = rows[:1] / EXACT
    torque_balance = SAMPLE_TIME * rows[1:2] / EXACT
    readings = rows[2:]
    same_sample = np.eye(WINDOW)
    next_sample = np.eye(WINDOW - 1, WINDOW, 1)
    steps = np.kron(same_sample[:-1], torque_balance)
    if shaft_moves:
        steps -= np.kron(next_sample - same_sample[:-1], np.eye(1, 4, 2)) / EXACT
    return np.vstack([np.kron(same_sample, current_balance), steps, np.kron(same_sample, readings)])


def _evidence(system: np.ndarray, signal: np.ndarray, other: np.ndarray) -> float:
    """Evidence [nat/s] for a constant fault that neither states nor the other signal explain."""
    explanations = np.hstack([system, other])
    norms = np.linalg.norm(explanations, axis=0)
    explanations = explanations / np.maximum(norms, 1e-300)
    effect = signal.sum(axis=1)
    weights = np.linalg.lstsq(explanations, effect, rcond=1e-9)[0]
    residual = effect - explanations @ weights
    return float(0.5 * residual @ residual / (WINDOW * SAMPLE_TIME))
