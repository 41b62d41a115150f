"""Expert rules on identified parameters: which of them leave their bands names the fault.

Source: Isermann & Freyermuth, "Process fault diagnosis based on process model knowledge", ASME J.
Dyn. Sys., Meas., Control 113(4), 1991.
"""

from functools import cached_property
from itertools import product
from math import exp
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import CATALOGUE, Fault
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle
from diagnosers.diagnoser import Belief, same_severity
from diagnosers.kalman import Estimate, ParameterFilter, SurgeFilter
from diagnosers.motor_filter import MotorEstimate, MotorFilter
from diagnosers.symptoms import sensor_symptoms
from diagnosers.symptoms.rule_based import DEFAULT_SEVERITY, RuleBased
from diagnosers.symptoms.rulebook import support

# by estimate: the vehicle's parameter, and the standard deviations from its band that a healthy
# vehicle reaches once an hour
HULL = {"alpha": ("alpha", 1.6), "beta": ("beta", 0.9)}
SHAFT = {
    "resistance": ("resistance", 2.6),
    "torque_constant": ("torque_constant", 2.4),
    "coulomb_friction": ("coulomb_friction", 2.2),
    "propeller_torque": ("c1", 2.6),
}
ESTIMATES = HULL | {f"{side}_{name}": SHAFT[name] for side in SIDES for name in MotorFilter.states}
SPECIFICATIONS = Vehicle.__dataclass_fields__
BANDS = np.array([SPECIFICATIONS[name].metadata["band"] for name, _ in ESTIMATES.values()])
DEVIATIONS = np.array([deviation for _, deviation in ESTIMATES.values()])
# by estimate: what is left at severity 1 of propeller damage, and of overheating
SEVEREST = {"propeller_torque": ("damage", 0.6), "torque_constant": ("hot", 0.8)}
SEVEREST_ESTIMATES = [f"{side}_{name}" for side in SIDES for name in SEVEREST]
SEVEREST_COLUMNS = [list(ESTIMATES).index(name) for name in SEVEREST_ESTIMATES]
SEVEREST_VALUES = [value for _, value in SEVEREST.values()] * len(SIDES)
SEVEREST_SYMPTOMS = [f"{side}_{symptom}" for side in SIDES for symptom, _ in SEVEREST.values()]
SYMPTOMS = (*ESTIMATES, *SEVEREST_SYMPTOMS, "push", "jump", *sensor_symptoms.SYMPTOMS)

READINGS_OF_SHAFT = ("voltage", "current", "rpm")
FORGETTING = exp(-SAMPLE_TIME / 8.0)  # of counts and averages, per sample
PUSH_LIMIT = 0.0017  # m/s^2, mean unexplained acceleration of a healthy vehicle once an hour
JUMP_LIMIT = 6.0  # standard deviations of the innovation, which no vehicle reaches
JUMP_SYMPTOM = 1.5  # symptom of one jump

RULES = {  # syntax: see `rulebook`
    "increased_drag": ("+alpha ~beta",),
    "decreased_drag": ("-alpha ~beta",),
    "propeller_damage:{side}": ("-{side}_propeller_torque ~{side}_torque_constant >{side}_damage",),
    "propeller_loss:{side}": ("-{side}_propeller_torque ~{side}_torque_constant <{side}_damage",),
    "seal_friction:{side}": ("+{side}_coulomb_friction >{side}_resistance",),
    "motor_overheating:{side}": (
        "-{side}_torque_constant >{side}_resistance >{side}_propeller_torque >{side}_hot",
    ),
    "sensor:{side}_voltage": (
        "-{side}_torque_constant <{side}_resistance <{side}_hot",
        "+{side}_torque_constant <{side}_propeller_torque",
        "+{side}_resistance +{side}_torque_constant",
    ),
    "sensor:{side}_current": (
        "+{side}_coulomb_friction -{side}_resistance",
        "-{side}_coulomb_friction -{side}_propeller_torque",
        "-{side}_coulomb_friction +{side}_resistance",
    ),
    "sensor:{side}_rpm": (
        "+{side}_torque_constant +{side}_propeller_torque",
        "-{side}_torque_constant -{side}_propeller_torque",
    ),
    "sensor:speed": ("+jump", "+alpha -beta", "-alpha +beta"),
    "sensor:acceleration": ("+push <jump", "-push <jump"),
}


class RulesState(NamedTuple):
    """What the rules remember of every lane."""

    surge: Estimate
    hull: Estimate
    motors: MotorEstimate
    sensors: sensor_symptoms.SensorSymptoms
    push: np.ndarray  # (n_lanes,), mean unexplained acceleration [m/s^2]
    jump: np.ndarray  # (n_lanes,), decaying count of jumps


class Rules(RuleBased):
    """Rules over symptoms: deviations of estimates, in units of ``sqrt(variance + band^2)``.

    Filters identify drag, thrust, and each shaft's resistance, torque constant, friction and
    propeller torque. Other symptoms are those of the sensors, an impossible jump of the speed, and
    an accelerometer that disagrees with the identified hull. What a healthy vehicle reaches once an
    hour is calibrated on ``training.seeds.seeds("calibration", ...)``.

    Severity: by least squares from the parameters that the class's fault scales, relative to their
    values at severity 1; of a zero or repeated reading its share, of other sensor faults the mean
    of the sampled severities, 0.6.

    Misleads: until the speed has changed the filters cannot separate the resistance of a motor from
    its torque constant, nor drag from thrust, and no rule applies; a sensor fault that imitates two
    parameters may fit a rule by accident.
    """

    name = "rules"
    symptom_names = SYMPTOMS
    own_rules = RULES

    @cached_property
    def _filters(self) -> tuple[SurgeFilter, ParameterFilter, MotorFilter]:
        nominal = self._nominal
        hull = ParameterFilter(nominal, prior_std=(0.6, 0.1, 0.5), walk_std=(0.1, 0.03, 0.03))
        return SurgeFilter(nominal), hull, MotorFilter(nominal)

    def initial(self, n_lanes: int) -> RulesState:
        """The state with nominal parameters and no symptom."""
        surge, hull, motors = (each.initial(n_lanes) for each in self._filters)
        sensors = sensor_symptoms.initial(n_lanes)
        return RulesState(surge, hull, motors, sensors, np.zeros(n_lanes), np.zeros(n_lanes))

    def step(self, state: RulesState, observation: np.ndarray) -> tuple[RulesState, Belief]:
        """The next state, and the belief by the rules."""
        state = self._next_state(state, observation)
        mean, std = _parameters(state)
        class_support = support(self._rules, _symptoms(mean, std, state))
        return state, self._belief(class_support, self._severity(mean, std), state.sensors)

    def _next_state(self, state: RulesState, observation: np.ndarray) -> RulesState:
        is_missing = np.isnan(observation)
        sensors = sensor_symptoms.update(state.sensors, observation)
        observation = sensor_symptoms.filled(sensors, observation)
        filters = zip(self._filters, state[:3], strict=True)
        surge, hull, motors = (each.update(last, observation) for each, last in filters)
        motors = _without_gaps(state.motors, motors, is_missing)
        is_jump = np.abs(surge.innovation) > JUMP_LIMIT * np.sqrt(surge.innovation_variance)
        unexplained = self._unexplained_acceleration(surge, observation)
        push = FORGETTING * state.push + (1.0 - FORGETTING) * unexplained
        return RulesState(surge, hull, motors, sensors, push, FORGETTING * state.jump + is_jump)

    def _unexplained_acceleration(self, surge: Estimate, observation: np.ndarray) -> np.ndarray:
        """Measured acceleration less that of the identified hull [m/s^2], (n_lanes,)."""
        vehicle = self._nominal
        speed, alpha, beta, gamma, disturbance = surge.mean.T
        channel = dict(zip(CHANNELS, observation.T, strict=True))
        deflection = channel["rudder"] ** 2 + channel["stern_plane"] ** 2
        drag = vehicle.alpha * alpha + vehicle.gamma * gamma * deflection
        squared_rpm = channel["port_rpm"] ** 2 + channel["starboard_rpm"] ** 2
        thrust = vehicle.beta * beta * 0.5 * squared_rpm
        return channel["acceleration"] - drag * speed * np.abs(speed) - thrust - disturbance

    def _severity(self, mean: np.ndarray, std: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means and standard deviations (n_lanes, n_classes), from parameters (n_lanes, 10)."""
        severity, severity_std = same_severity(
            (len(mean), len(self.known_classes)), *DEFAULT_SEVERITY
        )
        graded, change = self._changes
        information = std**-2.0 @ change.T**2
        fitted = ((mean - 1.0) * std**-2.0) @ change.T / information
        severity[:, graded] = np.minimum(np.maximum(fitted, 0.0), 1.0)
        severity_std[:, graded] = np.minimum(information**-0.5, DEFAULT_SEVERITY[1])
        return severity, severity_std

    @cached_property
    def _changes(self) -> tuple[list[int], np.ndarray]:
        """Classes (n,) that scale identified parameters, and the changes (n, 10) at severity 1."""
        changes = {}
        for fault in CATALOGUE.values():
            change = _relative_change(fault)
            if change.any() and fault.diagnosis in self.classes:
                changes[self.classes.index(fault.diagnosis)] = change
        return list(changes), np.array(list(changes.values()))


def _without_gaps(
    before: MotorEstimate, after: MotorEstimate, is_missing: np.ndarray
) -> MotorEstimate:
    """The estimate after a sample, as before on the shafts of which a reading has not arrived."""
    columns = [[INDEX[f"{side}_{name}"] for name in READINGS_OF_SHAFT] for side in SIDES]
    has_gap = np.stack([is_missing[:, of_side].any(axis=1) for of_side in columns], axis=1)
    kept = []
    for old, new in zip(before, after, strict=True):
        on_shafts = has_gap.reshape(*has_gap.shape, *[1] * (new.ndim - 2))
        kept.append(np.where(on_shafts, old, new))
    last_shaft_speed = np.where(has_gap, np.nan, after.last_shaft_speed)
    return MotorEstimate(*kept)._replace(last_shaft_speed=last_shaft_speed)


def _relative_change(fault: Fault) -> np.ndarray:
    """Relative changes (10,) of the `ESTIMATES` by a fault at severity 1."""
    thrust = sum(fault.scale.get(f"{side}_beta", 1.0) for side in SIDES) / len(SIDES)
    factor = {"alpha": fault.scale.get("alpha", 1.0), "beta": thrust}
    for side, (name, (parameter, _)) in product(SIDES, SHAFT.items()):
        factor[f"{side}_{name}"] = fault.scale.get(f"{side}_{parameter}", 1.0)
    return np.array([factor[name] - 1.0 for name in ESTIMATES])


def _parameters(state: RulesState) -> tuple[np.ndarray, np.ndarray]:
    """Identified parameters (n_lanes, 10) relative to nominal, and their healthy scatter."""
    n_lanes = len(state.push)
    hull = state.hull.covariance[:, [1, 2], [1, 2]]
    shafts = np.einsum("lsii->lsi", state.motors.covariance)
    mean = np.hstack([state.hull.mean[:, 1:3], state.motors.mean.reshape(n_lanes, -1)])
    variance = np.hstack([hull, shafts.reshape(n_lanes, -1)])
    return mean, np.sqrt(variance + BANDS**2)


def _symptoms(mean: np.ndarray, std: np.ndarray, state: RulesState) -> np.ndarray:
    """Every symptom of `SYMPTOMS`, (n_lanes, n_symptoms)."""
    beyond_severest = (mean[:, SEVEREST_COLUMNS] - SEVEREST_VALUES) / std[:, SEVEREST_COLUMNS]
    deviation = (mean - 1.0) / std / DEVIATIONS
    of_hull = np.column_stack([state.push / PUSH_LIMIT, JUMP_SYMPTOM * state.jump])
    of_sensors = sensor_symptoms.symptoms(state.sensors)
    return np.hstack([deviation, beyond_severest, of_hull, of_sensors])
