"""Expert rules on identified parameters: resistance, friction, drag ... leave their band, and rules say what that is.

Source: Isermann & Freyermuth, "Process fault diagnosis based on process model knowledge", ASME J.
Dyn. Sys., Meas., Control 113(4), 1991: estimated parameters as symptoms, rules from symptoms to
faults.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import exp
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle, vehicle_of
from diagnosers.diagnoser import Belief, Recursive, same_severity
from diagnosers.kalman import Estimate, ParameterFilter, SurgeFilter
from diagnosers.motor_filter import MotorEstimate, MotorFilter
from diagnosers.symptoms import sensor_symptoms
from diagnosers.symptoms.rulebook import (
    USUAL,
    Rulebook,
    for_sides,
    log_probability,
    merged,
    parsed,
    truths,
)

# Estimated: the vehicle's parameter, and by how many standard deviations a healthy one leaves its
# band once an hour.
HULL = {"alpha": ("alpha", 1.6), "beta": ("beta", 0.9)}
SHAFT = {
    "resistance": ("resistance", 2.6),
    "torque_constant": ("torque_constant", 2.4),
    "coulomb_friction": ("coulomb_friction", 2.2),
    "propeller_torque": ("c1", 2.6),
}
ESTIMATES = HULL | {f"{side}_{name}": SHAFT[name] for side in SIDES for name in MotorFilter.states}
BANDS = np.array(
    [Vehicle.__dataclass_fields__[name].metadata["band"] for name, _ in ESTIMATES.values()]
)
DEVIATIONS = np.array([deviation for _, deviation in ESTIMATES.values()])
# left by propeller damage, by overheating
WORST = {"propeller_torque": ("torn", 0.6), "torque_constant": ("hot", 0.8)}
EDGES = {
    f"{side}_{edge}": (f"{side}_{name}", value)
    for side in SIDES
    for name, (edge, value) in WORST.items()
}
AT_EDGE = [list(ESTIMATES).index(name) for name, _ in EDGES.values()]
SYMPTOMS = (*ESTIMATES, *EDGES, "push", "jump", *sensor_symptoms.SYMPTOMS)

FORGET = exp(-SAMPLE_TIME / 8.0)  # of counts and averages, per sample
PUSH = 0.0017  # m/s^2, averaged unexplained acceleration, healthy, once an hour
JUMP = 6.0  # standard deviations of the innovation that no vehicle reaches
ODD = 1.5  # symptom of an impossible jump that is not yet forgotten

# Syntax: see `rulebook`.
HULL_RULES = {"increased_drag": ("+alpha ~beta",), "decreased_drag": ("-alpha ~beta",)}
SIDE_RULES = {
    "propeller_damage:{side}": ("-{side}_propeller_torque ~{side}_torque_constant >{side}_torn",),
    "propeller_loss:{side}": ("-{side}_propeller_torque ~{side}_torque_constant <{side}_torn",),
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
}
JUMP_RULES = {
    "sensor:speed": ("+jump", "+alpha -beta", "-alpha +beta"),
    "sensor:acceleration": ("+push <jump", "-push <jump"),
}


class RulesState(NamedTuple):
    """Lane first: the three filters, oddities of the readings, averaged push [m/s^2], jumps not yet forgotten."""

    surge: Estimate
    hull: Estimate
    motors: MotorEstimate
    oddities: sensor_symptoms.Oddities
    push: np.ndarray
    jump: np.ndarray


@dataclass(frozen=True)
class Rules(Recursive):
    """Rules over symptoms: how far an estimate is from nominal, in units of ``sqrt(variance + band^2)``.

    Filters identify drag, thrust, and each shaft's resistance, torque constant, friction and
    propeller torque. Besides, held, lost (zero) and noisy readings, an impossible jump of the
    speed, and an accelerometer that disagrees with the identified hull are symptoms. A rule is as
    true as the least of the symptoms it requires, less half of what speaks against it; a class as
    its truest rule (`rulebook`). What a healthy vehicle shows once an hour is calibrated on
    ``training.seeds.seeds("calibration", ...)``.

    Severity: by least squares from the parameters that the class's fault scales, relative to what
    they are at severity 1; of a lost or held reading its frequency, of other sensor faults the mean
    of what is drawn, 0.6.

    Misleads: until the speed has changed the filters cannot tell a motor's resistance from its
    constant, nor drag from thrust, and the rules wait; a sensor fault that imitates two parameters
    may fit a rule by accident.
    """

    vehicle: str | Vehicle = "thesis1992"

    name = "rules"

    def __post_init__(self):
        vehicle_of(self.vehicle)

    @cached_property
    def _filters(self) -> tuple[SurgeFilter, ParameterFilter, MotorFilter]:
        vehicle = vehicle_of(self.vehicle)
        hull = ParameterFilter(vehicle, prior_std=(0.6, 0.1, 0.5), walk_std=(0.1, 0.03, 0.03))
        return SurgeFilter(vehicle), hull, MotorFilter(vehicle)

    @cached_property
    def _rules(self) -> Rulebook:
        return parsed(
            merged(HULL_RULES, for_sides(SIDE_RULES), JUMP_RULES, sensor_symptoms.RULES),
            SYMPTOMS,
            self.classes,
        )

    def initial(self, n_lanes: int) -> RulesState:
        """Nominal parameters, no oddity seen."""
        filters = (one.initial(n_lanes) for one in self._filters)
        return RulesState(
            *filters, sensor_symptoms.initial(n_lanes), np.zeros(n_lanes), np.zeros(n_lanes)
        )

    def step(self, state: RulesState, observation: np.ndarray) -> tuple[RulesState, Belief]:
        """Identify, and apply the rules."""
        state = self._advance(state, observation)
        mean, std = _parameters(state)
        truth = truths(self._rules, _symptoms(mean, std, state))
        chances = log_probability(self._rules, truth)
        return state, Belief(chances, *self._severity(mean, std, state.oddities))

    def _advance(self, state: RulesState, observation: np.ndarray) -> RulesState:
        filters = [
            one.update(old, observation) for one, old in zip(self._filters, state[:3], strict=True)
        ]
        surge = filters[0]
        jump = np.abs(surge.innovation) > JUMP * np.sqrt(surge.innovation_variance)
        push = FORGET * state.push + (1.0 - FORGET) * self._unexplained(surge, observation)
        return RulesState(
            *filters,
            sensor_symptoms.update(state.oddities, observation),
            push,
            FORGET * state.jump + jump,
        )

    def _unexplained(self, surge: Estimate, observation: np.ndarray) -> np.ndarray:
        """Measured acceleration less that of the identified hull [m/s^2], (n_lanes,)."""
        vehicle = vehicle_of(self.vehicle)
        (speed, alpha, beta, gamma, disturbance) = surge.mean.T
        channel = dict(zip(CHANNELS, observation.T, strict=True))
        deflection = channel["rudder"] ** 2 + channel["stern_plane"] ** 2
        drag = vehicle.alpha * alpha + vehicle.gamma * gamma * deflection
        thrust = (
            vehicle.beta * beta * 0.5 * (channel["port_rpm"] ** 2 + channel["starboard_rpm"] ** 2)
        )
        return channel["acceleration"] - drag * speed * np.abs(speed) - thrust - disturbance

    @cached_property
    def _sensors(self) -> list[int]:
        return sensor_symptoms.sensor_columns(self.classes)

    def _severity(
        self, mean: np.ndarray, std: np.ndarray, odd: sensor_symptoms.Oddities
    ) -> tuple[np.ndarray, np.ndarray]:
        severity, error = same_severity((len(mean), self._rules.n_classes), *USUAL)
        known, change = self._changes
        information = std**-2.0 @ change.T**2
        fitted = ((mean - 1.0) * std**-2.0) @ change.T / information
        severity[:, known] = np.minimum(np.maximum(fitted, 0.0), 1.0)
        error[:, known] = np.minimum(information**-0.5, USUAL[1])
        sensor_symptoms.write_severity(severity, self._sensors, odd)
        return severity, error

    @cached_property
    def _changes(self) -> tuple[list[int], np.ndarray]:
        """Classes (n,) that scale identified parameters, and the parameters' relative changes (n, 10) at severity 1."""
        changes = {}
        for fault in CATALOGUE.values():
            factor = {"alpha": fault.scale.get("alpha", 1.0)}
            factor["beta"] = sum(fault.scale.get(f"{side}_beta", 1.0) for side in SIDES) / len(
                SIDES
            )
            for side, (name, (parameter, _)) in product(SIDES, SHAFT.items()):
                factor[f"{side}_{name}"] = fault.scale.get(f"{side}_{parameter}", 1.0)
            change = np.array([factor[name] - 1.0 for name in ESTIMATES])
            if change.any():
                changes[self.classes.index(fault.diagnosis)] = change
        return list(changes), np.array(list(changes.values()))


def _parameters(state: RulesState) -> tuple[np.ndarray, np.ndarray]:
    """Identified parameters (n_lanes, 10) relative to nominal, and their standard deviation from a healthy one."""
    n_lanes = len(state.push)
    hull = state.hull.covariance[:, [1, 2], [1, 2]]
    shafts = np.einsum("lsii->lsi", state.motors.covariance)
    mean = np.hstack([state.hull.mean[:, 1:3], state.motors.mean.reshape(n_lanes, -1)])
    return mean, np.sqrt(np.hstack([hull, shafts.reshape(n_lanes, -1)]) + BANDS**2)


def _symptoms(mean: np.ndarray, std: np.ndarray, state: RulesState) -> np.ndarray:
    """Every symptom of `SYMPTOMS`, (n_lanes, n_symptoms)."""
    edges = (mean[:, AT_EDGE] - [value for _, value in EDGES.values()]) / std[:, AT_EDGE]
    singles = np.column_stack([state.push / PUSH, ODD * state.jump])
    return np.hstack(
        [(mean - 1.0) / std / DEVIATIONS, edges, singles, sensor_symptoms.symptoms(state.oddities)]
    )
