"""Limit and trend checking: readings against normal values at the operating point and their past.

Sources: Himmelblau, "Fault Detection and Diagnosis in Chemical and Petrochemical Processes",
Elsevier 1978; Pau, "Failure Diagnosis and Performance Monitoring", Dekker 1981.
"""

from dataclasses import replace
from functools import cached_property
from math import exp
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle
from diagnosers.diagnoser import Belief, same_severity
from diagnosers.symptoms import sensor_symptoms
from diagnosers.symptoms.residuals import healthy_band, residuals
from diagnosers.symptoms.rule_based import DEFAULT_SEVERITY, RuleBased
from diagnosers.symptoms.rulebook import support

# low-passed `RESIDUALS`
LEVELS = ("port_voltage", "port_load", "starboard_voltage", "starboard_load", "push")
# a load below that of a damaged propeller; voltage and load together
SIDE_SYMPTOMS = [f"{side}_{kind}" for kind in ("damage", "supply") for side in SIDES]
SYMPTOMS = (*LEVELS, *SIDE_SYMPTOMS, "trend", "step", *sensor_symptoms.SYMPTOMS)
VOLTAGES = [0, 2]  # columns of the levels
LOADS = [1, 3]
SPEED = INDEX["speed"]
ACCELERATION = INDEX["acceleration"]

LEVEL_FORGETTING = exp(-SAMPLE_TIME / 2.0)  # per sample
FORGETTING = exp(-SAMPLE_TIME / 8.0)  # of the trend and the count of steps
# V, N m, V, N m, m/s^2: limits for noise and disturbance, beside the healthy band
NOISE_LIMITS = np.array([0.017, 0.0007, 0.017, 0.0007, 0.0028])
# limit of voltage and load together, as a share of the sum of their limits: their errors differ
SUPPLY_SHARE = 0.6
TREND_LIMIT = 0.006  # m/s^2, of the measured acceleration less the trend of the speed
# m/s, of the change of the speed over a sample: seven times the noise of the paddle wheel
STEP_LIMIT = 0.07
STEP_SYMPTOM = 1.5  # symptom of one step
DAMAGE_FACTOR = 0.6  # of the torque of a propeller at severity 1 of its damage
HALF_SEVERITY_EXCESS = 3.0  # excess at which a fault counts as severity 1/2

RULES = {  # syntax: see `rulebook`
    "increased_drag": ("-push ~port_load ~starboard_load ~trend <step",),
    "decreased_drag": ("+push ~port_load ~starboard_load ~trend <step",),
    "propeller_damage:{side}": ("-{side}_load ~{side}_voltage >{side}_damage",),
    "propeller_loss:{side}": ("-{side}_load ~{side}_voltage <{side}_damage",),
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
    "sensor:{side}_rpm": (
        "+{side}_voltage +{side}_load",
        "-{side}_voltage -{side}_load",
    ),
    "sensor:acceleration": ("+trend <step", "-trend <step"),
    "sensor:speed": ("+step",),
}


class LimitsState(NamedTuple):
    """What the limits remember of every lane."""

    previous: np.ndarray  # (n_lanes, n_channels), the last observation
    # (n_lanes, 12), of five residuals, their healthy bands, and the loads of damaged propellers
    levels: np.ndarray
    trend: np.ndarray  # (n_lanes, 1)
    step: np.ndarray  # (n_lanes, 1)
    sensors: sensor_symptoms.SensorSymptoms


class Limits(RuleBased):
    """Limits on single readings, their trends and plausibility; a table of them isolates the class.

    Each voltage, current and acceleration is compared with its normal value at the present shaft
    speeds and speed (`residuals`), averaged over 2 s; its limit is what the healthy band allows
    there and `NOISE_LIMITS`. The trend of the speed checks the accelerometer; a step between two
    speed readings and `sensor_symptoms` need no model. All limits are calibrated on
    ``training.seeds.seeds("calibration", ...)``: a healthy vehicle reaches them about once an hour.

    Severity: a saturating function of the excess x, ``x/(x + 3)``, because limits do not show how
    far a level is from that of the fault at severity 1; of a zero or repeated reading its share.

    Misleads: single limits see no pattern in time, so small faults within the sum of all bands are
    never detected, and faults that raise the same readings (the friction of a shaft, its current
    sensor) are isolated by small differences.
    """

    name = "limits"
    symptom_names = SYMPTOMS
    own_rules = RULES

    @cached_property
    def _damaged(self) -> Vehicle:
        """The nominal vehicle with damaged propellers."""
        nominal = self._nominal
        return replace(nominal, c1=DAMAGE_FACTOR * nominal.c1, c2=DAMAGE_FACTOR * nominal.c2)

    def initial(self, n_lanes: int) -> LimitsState:
        """The state with nothing out of limits."""
        zero = np.zeros((n_lanes, 1))
        previous = np.zeros((n_lanes, len(CHANNELS)))
        levels = np.zeros((n_lanes, 2 * len(LEVELS) + len(SIDES)))
        return LimitsState(previous, levels, zero, zero, sensor_symptoms.initial(n_lanes))

    def step(self, state: LimitsState, observation: np.ndarray) -> tuple[LimitsState, Belief]:
        """The next state, and the belief by the table."""
        state = self._next_state(state, observation)
        class_support = support(self._rules, self._symptoms(state))
        mean, std = same_severity((len(observation), len(self.known_classes)), *DEFAULT_SEVERITY)
        excess = np.maximum(class_support, 0.0)
        mean[:, self._rules.classes] = excess / (excess + HALF_SEVERITY_EXCESS)
        return state, self._belief(class_support, (mean, std), state.sensors)

    def _next_state(self, state: LimitsState, observation: np.ndarray) -> LimitsState:
        sensors = sensor_symptoms.update(state.sensors, observation)
        observation = sensor_symptoms.filled(sensors, observation)
        is_later = state.sensors.n_samples > 0
        previous = np.where(is_later, state.previous, observation)
        of_nominal = residuals(previous, observation, self._nominal).values
        of_damaged = residuals(previous, observation, self._damaged).values
        band = healthy_band(previous, observation, self._nominal)
        now = np.hstack([of_nominal, band, of_damaged[:, LOADS]])
        change = observation[:, [SPEED]] - previous[:, [SPEED]]
        unexplained = observation[:, [ACCELERATION]] - change / SAMPLE_TIME
        return LimitsState(
            observation,
            LEVEL_FORGETTING * state.levels + (1.0 - LEVEL_FORGETTING) * now,
            FORGETTING * state.trend + (1.0 - FORGETTING) * unexplained,
            FORGETTING * state.step + (np.abs(change) > STEP_LIMIT),
            sensors,
        )

    def _symptoms(self, state: LimitsState) -> np.ndarray:
        """Every symptom of `SYMPTOMS`, (n_lanes, n_symptoms)."""
        level, band, damaged_load = np.split(state.levels, [len(LEVELS), 2 * len(LEVELS)], axis=1)
        limit = band + NOISE_LIMITS
        volts_per_torque = self._nominal.resistance / self._nominal.torque_constant
        supply = level[:, VOLTAGES] + volts_per_torque * level[:, LOADS]
        supply /= SUPPLY_SHARE * (limit[:, VOLTAGES] + volts_per_torque * limit[:, LOADS])
        damage = damaged_load / limit[:, LOADS]
        trend = state.trend / TREND_LIMIT
        step = STEP_SYMPTOM * state.step
        of_sensors = sensor_symptoms.symptoms(state.sensors)
        return np.hstack([level / limit, damage, supply, trend, step, of_sensors])
