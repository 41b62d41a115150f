"""Limit and trend checking: each reading against its normal value at the operating point, and against its own past.

Sources: Himmelblau, "Fault Detection and Diagnosis in Chemical and Petrochemical Processes",
Elsevier 1978; Pau, "Failure Diagnosis and Performance Monitoring", Dekker 1981.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import exp
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle, vehicle_of
from diagnosers.diagnoser import Belief, Recursive, same_severity
from diagnosers.symptoms import sensor_symptoms
from diagnosers.symptoms.residuals import healthy_band, residuals
from diagnosers.symptoms.rulebook import (
    USUAL,
    Rulebook,
    for_sides,
    log_probability,
    merged,
    parsed,
    truths,
)

# low-passed `RESIDUALS`
LEVELS = ("port_voltage", "port_load", "starboard_voltage", "starboard_load", "push")
EDGES = (*(f"{side}_torn" for side in SIDES), *(f"{side}_supply" for side in SIDES))
SYMPTOMS = (*LEVELS, *EDGES, "trend", "step", *sensor_symptoms.SYMPTOMS)
# columns of the levels
VOLTAGES = [0, 2]
LOADS = [1, 3]
SPEED, ACCELERATION = (INDEX[name] for name in ("speed", "acceleration"))

FORGET = exp(-SAMPLE_TIME / 2.0)  # of the levels and the speed's trend, per sample
# V, N m, V, N m, m/s^2: limits beside the healthy band
BESIDE = np.array([0.017, 0.0007, 0.017, 0.0007, 0.0028])
# limit of voltage and load together, as a share of the sum of their limits: their errors differ
SUPPLY = 0.6
TREND = 0.006  # m/s^2, limit of the measured acceleration less the speed's trend
STEP = 0.07  # m/s, limit of the speed's change over a sample: seven times the paddle wheel's noise
TREND_FORGET = exp(-SAMPLE_TIME / 8.0)
STEP_FORGET = exp(-SAMPLE_TIME / 8.0)  # of such changes, per sample
STEP_SYMPTOM = 1.5  # and what each is worth
WORST_TEAR = 0.6  # of a propeller's torque, left by the worst damage
HALF_SEVERE = 3.0  # limits at which a fault is taken to be of severity 1/2

HULL_RULES = {  # syntax: see `rulebook`
    "increased_drag": ("-push ~port_load ~starboard_load ~trend <step",),
    "decreased_drag": ("+push ~port_load ~starboard_load ~trend <step",),
}
SIDE_RULES = {
    "propeller_damage:{side}": ("-{side}_load ~{side}_voltage >{side}_torn",),
    "propeller_loss:{side}": ("-{side}_load ~{side}_voltage <{side}_torn",),
    "seal_friction:{side}": ("+{side}_load ~{side}_voltage",),
    "motor_overheating:{side}": ("-{side}_voltage -{side}_supply >{side}_load",),
    "sensor:{side}_voltage": (
        "-{side}_voltage -{side}_supply ~{side}_load",
        "+{side}_voltage ~{side}_load",
    ),
    "sensor:{side}_current": (
        "-{side}_voltage +{side}_load ~{side}_supply",
        "+{side}_voltage -{side}_load ~{side}_supply",
    ),
    "sensor:{side}_rpm": ("+{side}_voltage +{side}_load", "-{side}_voltage -{side}_load"),
}
READING_RULES = {
    "sensor:acceleration": ("+trend <step", "-trend <step"),
    "sensor:speed": ("+step",),
}


class LimitsState(NamedTuple):
    """Lane first: last observation, low-passed levels (5), band (5) and torn levels (2), trends, steps, sensor_symptoms."""

    previous: np.ndarray
    levels: np.ndarray
    trend: np.ndarray
    step: np.ndarray
    oddities: sensor_symptoms.Oddities


@dataclass(frozen=True)
class Limits(Recursive):
    """Limits on low-passed single readings, their trends and their plausibility; the class by a table of which exceed.

    Each voltage, current and acceleration is compared with what is normal at the present shaft
    speeds and speed (`residuals`), averaged over 2 s; its limit is what the healthy band allows
    there and `BESIDE` for noise and disturbance. The trend of the speed checks the accelerometer; a
    step between two speed readings, a reading that is held, lost or noisy (`oddities`) needs no
    model. The table is that of `rulebook`. All limits are calibrated on
    ``training.seeds.seeds("calibration", ...)`` to be reached about once an hour.

    Severity: the level relative to what the class's fault does to the operating point is not known
    to limits, so it is a saturating function of the excess x, ``x/(x + 3)``, and of a lost or held
    reading its frequency.

    Misleads: single limits see no pattern in time, so small faults within the sum of all bands are
    never found, and faults that raise the same readings (a shaft's friction, its current sensor)
    are told apart by a hair.
    """

    vehicle: str | Vehicle = "thesis1992"

    name = "limits"

    def __post_init__(self):
        vehicle_of(self.vehicle)

    @cached_property
    def _vehicles(self) -> tuple[Vehicle, Vehicle]:
        """The nominal one, and one with torn propellers."""
        vehicle = vehicle_of(self.vehicle)
        return vehicle, replace(vehicle, c1=WORST_TEAR * vehicle.c1, c2=WORST_TEAR * vehicle.c2)

    @cached_property
    def _rules(self) -> Rulebook:
        return parsed(
            merged(HULL_RULES, for_sides(SIDE_RULES), READING_RULES, sensor_symptoms.RULES),
            SYMPTOMS,
            self.classes,
        )

    def initial(self, n_lanes: int) -> LimitsState:
        """Nothing out of limits."""
        zero = np.zeros((n_lanes, 1))
        levels = np.zeros((n_lanes, 2 * len(LEVELS) + len(SIDES)))
        return LimitsState(
            np.zeros((n_lanes, len(CHANNELS))), levels, zero, zero, sensor_symptoms.initial(n_lanes)
        )

    def step(self, state: LimitsState, observation: np.ndarray) -> tuple[LimitsState, Belief]:
        """Compare, and look up."""
        state = self._advance(state, observation)
        truth = truths(self._rules, self._symptoms(state))
        chances = log_probability(self._rules, truth)
        return state, Belief(chances, *self._severity(truth, state.oddities))

    def _advance(self, state: LimitsState, observation: np.ndarray) -> LimitsState:
        begun = state.oddities.samples > 0
        previous = np.where(begun, state.previous, observation)
        nominal, torn = self._vehicles
        now = np.hstack(
            [
                residuals(previous, observation, nominal).values,
                healthy_band(previous, observation, nominal),
                residuals(previous, observation, torn).values[:, LOADS],
            ]
        )
        change = observation[:, [SPEED]] - previous[:, [SPEED]]
        surplus = observation[:, [ACCELERATION]] - change / SAMPLE_TIME
        return LimitsState(
            observation,
            FORGET * state.levels + (1.0 - FORGET) * now,
            TREND_FORGET * state.trend + (1.0 - TREND_FORGET) * surplus,
            STEP_FORGET * state.step + (np.abs(change) > STEP),
            sensor_symptoms.update(state.oddities, observation),
        )

    def _symptoms(self, state: LimitsState) -> np.ndarray:
        """Every symptom of `SYMPTOMS`, (n_lanes, n_symptoms)."""
        level, band, torn = np.split(state.levels, [len(LEVELS), 2 * len(LEVELS)], axis=1)
        limit = band + BESIDE
        nominal = self._vehicles[0]
        by_load = nominal.resistance / nominal.torque_constant
        supply = level[:, VOLTAGES] + by_load * level[:, LOADS]
        supply /= SUPPLY * (limit[:, VOLTAGES] + by_load * limit[:, LOADS])
        singles = [state.trend / TREND, STEP_SYMPTOM * state.step]
        return np.hstack(
            [
                level / limit,
                torn / limit[:, LOADS],
                supply,
                *singles,
                sensor_symptoms.symptoms(state.oddities),
            ]
        )

    @cached_property
    def _sensors(self) -> list[int]:
        return sensor_symptoms.sensor_columns(self.classes)

    def _severity(
        self, truth: np.ndarray, odd: sensor_symptoms.Oddities
    ) -> tuple[np.ndarray, np.ndarray]:
        severity, error = same_severity((len(truth), self._rules.n_classes), *USUAL)
        excess = np.maximum(truth, 0.0)
        severity[:, self._rules.classes] = excess / (excess + HALF_SEVERE)
        sensor_symptoms.write_severity(severity, self._sensors, odd)
        return severity, error
