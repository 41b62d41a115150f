"""The stimulus that looks one step ahead: each second the offset that best tells the likeliest hypotheses apart.

What a second's offset will tell is bounded from below by ``-sum_i p_i log sum_j p_j exp(-k_ij)``
over hypotheses, k the Bhattacharyya distance of what they predict (Kolchinsky & Tracey, "Estimating
mixture entropy with pairwise distances", Entropy 19, 2017, 361, doi:10.3390/e19070361). The same
distances bound the chance of an error (Blackmore & Williams, "Finite horizon control design for
optimal discrimination between several models", IEEE CDC 2006), but that bound counts a rival by the
root of its probability, and so would stir a healthy vehicle for the sake of the unlikely.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX, READINGS
from auv_fault_env.faults import CATALOGUE, classes, fault_effect, matrices
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS, SAMPLE_RATE, SAMPLE_TIME, nominal
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, MISSION_SPEED
from training.stimuli.closed_loop import ClosedLoop
from training.stimuli.greedy_model import expected_information

VEHICLE = PRESETS["thesis1992"]
GRID = LARGEST_OFFSET * np.array(
    [-1.0, -0.6, -0.4, -0.25, -0.12, 0.0, 0.12, 0.25, 0.4, 0.6, 1.0]
)  # m/s
LIKELIEST = 4  # hypotheses that are looked at
LEAST_LEFT = 1e-12  # of the allowance: below it, any offset is beyond price
# of a new reading in the filtered speed
SHARE = -math.expm1(-SAMPLE_TIME / VEHICLE.speed_filter_time)
DECISION = round(SAMPLE_RATE)  # samples for which an offset is held
PRICE = 20.0  # nat that a whole allowance must bring; so a healthy vehicle's is hardly touched
SPEED, ACCELERATION, COMMAND = (INDEX[name] for name in ("speed", "acceleration", "speed_command"))


class Plan(NamedTuple):
    """Of every lane, (n_lanes,): measured speed as the controller filters it, and the offset being held [m/s]."""

    speed: np.ndarray
    held: np.ndarray


@cache
def effects() -> tuple[np.ndarray, np.ndarray]:
    """What severity 1 of each class does to the parameters: scale and offset, (n_classes, n_parameters).

    A sensor's class stands for a lost calibration: its other ails show alike at any speed.
    """
    scale, offset, *_ = matrices()
    rows = {fault.diagnosis: row for row, fault in reversed(list(enumerate(CATALOGUE.values())))}
    rows |= {
        f.diagnosis: row
        for row, f in enumerate(CATALOGUE.values())
        if f.name.startswith("sensor_scale")
    }
    order = [rows[name] for name in classes()[1:]]
    nothing = np.ones((1, scale.shape[1])), np.zeros((1, scale.shape[1]))
    return np.concatenate([nothing[0], scale[order]]), np.concatenate([nothing[1], offset[order]])


@cache
def surroundings() -> tuple[np.ndarray, np.ndarray]:
    """The variances of a second's readings, (8,), and the constants of the plant as an array.

    A second counts as one reading, not as ten: that stands for the spread of healthy vehicles,
    which the model leaves out. The disturbance adds to the accelerometer's variance.
    """
    variance = np.array([CHANNELS[name].noise ** 2 for name in READINGS])
    variance[READINGS.index("acceleration")] += VEHICLE.disturbance_std**2
    return variance, Fleet(1, VEHICLE).constants


class Greedy(ClosedLoop):
    """Each second, for the next one, the offset of a grid that promises most for its price.

    The promise is what the readings of the next 4 s will tell at least of the four likeliest
    classes, if it is held so long; the price is the share of the allowance that it takes, so that
    the less is left, the more it must promise. What counts is how differently the readings
    *change*, under each class with its believed severity.

    When it misleads: the model knows the nominal vehicle only, sees no further than 4 s, and takes
    the belief as given; a diagnoser that is sure of the wrong class is not helped. On a healthy
    vehicle it stays silent as long as the belief does.
    """

    name = "greedy"
    seed_block = 8

    def initial_memory(self, n_lanes: int) -> Plan:
        """No speed yet, no offset."""
        return Plan(np.full(n_lanes, np.nan), np.zeros(n_lanes))

    def choose_offset(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: Plan
    ) -> np.ndarray:
        """The offset that is held, chosen anew every second."""
        reading = observation[:, SPEED].astype(np.float64)
        before = np.where(np.isnan(memory.speed), reading, memory.speed)
        memory.speed[:] = before + SHARE * (reading - before)
        if sample % DECISION == 0:
            memory.held[:] = self._choice(observation, belief, left, memory)
        return memory.held

    def _choice(
        self, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: Plan
    ) -> np.ndarray:
        """The best offset of the grid on each lane."""
        likeliest = np.argsort(-belief.log_probability, axis=1, kind="stable")[:, :LIKELIEST]
        severity = np.take_along_axis(belief.severity_mean, likeliest, axis=1)[..., None]
        scale, offset = (effect[likeliest] for effect in effects())
        healthy = np.array(list(nominal(VEHICLE).values()))
        factor, shift = fault_effect(severity, scale, offset)
        parameters = healthy * factor + shift
        logarithm = np.take_along_axis(belief.log_probability, likeliest, axis=1)
        probability = np.exp(logarithm - np.logaddexp.reduce(logarithm, axis=1, keepdims=True))
        acceleration, command, mission = observation[
            :, [ACCELERATION, COMMAND, MISSION_SPEED]
        ].T.astype(np.float64)
        now = np.stack([memory.speed, acceleration, command], axis=1)
        gain = expected_information(parameters, probability, now, mission, GRID, *surroundings())
        share = DECISION * np.square(GRID) / np.maximum(left, LEAST_LEFT)[:, None]
        return GRID[(gain - PRICE * share).argmax(axis=1)]
