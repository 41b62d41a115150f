"""The stimulus that looks one step ahead: the offset that best separates the likeliest hypotheses.

The information of an offset is bounded from below by ``-sum_i p_i log sum_j p_j exp(-k_ij)`` over
hypotheses, k the Bhattacharyya distance of their predictions (Kolchinsky & Tracey, "Estimating
mixture entropy with pairwise distances", Entropy 19, 2017, 361, doi:10.3390/e19070361).
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX, READINGS
from auv_fault_env.faults import CATALOGUE, fault_classes, fault_effect, matrices
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS, SAMPLE_RATE, SAMPLE_TIME, nominal
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, MISSION_SPEED
from training.stimuli.closed_loop import ClosedLoop, EpisodeState
from training.stimuli.greedy_model import expected_information

VEHICLE = PRESETS["thesis1992"]
# as shares of the largest offset, finer around zero
SHARES = np.array([-1.0, -0.6, -0.4, -0.25, -0.12, 0.0, 0.12, 0.25, 0.4, 0.6, 1.0])
OFFSETS = LARGEST_OFFSET * SHARES  # m/s
N_HYPOTHESES = 4  # the likeliest classes, among which the offset decides
LEAST_ALLOWANCE = 1e-12  # m^2/s^2 times samples: with less, every offset is too expensive
# weight of a new reading in the filtered speed
SPEED_WEIGHT = -math.expm1(-SAMPLE_TIME / VEHICLE.speed_filter_time)
DECISION = round(SAMPLE_RATE)  # samples for which an offset is held
PRICE = 20.0  # nats that the whole allowance must bring: a healthy vehicle hardly pays
SPEED = INDEX["speed"]
ACCELERATION = INDEX["acceleration"]
COMMAND = INDEX["speed_command"]


class GreedyMemory(NamedTuple):
    """The memory of an episode."""

    filtered_speed: np.ndarray  # (n_lanes,) [m/s], as the controller filters the measured speed
    offset: np.ndarray  # (n_lanes,) [m/s], the current one
    effects: tuple[np.ndarray, np.ndarray]  # `fault_effects` at the start


def fault_effects() -> tuple[np.ndarray, np.ndarray]:
    """Scale and offset of the parameters by each class at severity 1, (n_classes, n_parameters).

    A lost calibration stands for all faults of a sensor: the others look alike at any speed.
    """
    scale, offset, *_ = matrices()
    fault_of = {}
    for row, fault in enumerate(CATALOGUE.values()):
        if fault.name.startswith("sensor_scale"):
            fault_of[fault.diagnosis] = row
        fault_of.setdefault(fault.diagnosis, row)
    rows = [fault_of[name] for name in fault_classes()]
    ends = ((1, 1), (0, 0))  # `normal` and `unknown` change nothing
    return np.pad(scale[rows], ends, constant_values=1.0), np.pad(offset[rows], ends)


@cache
def reading_variance() -> np.ndarray:
    """Variance of each reading over a second, (n_readings,).

    A second counts as one reading, not as ten: that stands for the healthy band, which the model
    leaves out. The disturbance adds to the variance of the acceleration.
    """
    variance = np.array([CHANNELS[name].noise ** 2 for name in READINGS])
    variance[READINGS.index("acceleration")] += VEHICLE.disturbance_std**2
    return variance


@cache
def plant_constants() -> np.ndarray:
    """The constants of the plant as an array."""
    return Fleet(1, VEHICLE).constants


class Greedy(ClosedLoop):
    """Each second the offset, of a few, with the most expected information for its price.

    The expected information is what the readings of the next 4 s will at least say about the four
    likeliest classes if the offset stays. The price is its share of the allowance: the less is
    left, the more information it takes. What counts is how differently the readings *change* under
    each class with the mean severity of the belief.

    When it misleads: the model is that of the nominal vehicle, sees no further than 4 s, and takes
    the belief as right; a diagnoser that is sure of the wrong class gets no help. On a healthy
    vehicle the offset is zero as long as the belief is sure of `normal`.
    """

    name = "greedy"
    seed_block = 8

    def initial_memory(self, n_lanes: int) -> GreedyMemory:
        """No speed yet, no offset."""
        return GreedyMemory(np.full(n_lanes, np.nan), np.zeros(n_lanes), fault_effects())

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The current offset, chosen anew every second."""
        memory: GreedyMemory = episode.memory
        observation = observation.astype(np.float64)
        reading = observation[:, SPEED]
        before = np.where(np.isnan(memory.filtered_speed), reading, memory.filtered_speed)
        memory.filtered_speed[:] = before + SPEED_WEIGHT * (reading - before)
        if episode.sample % DECISION == 0:
            memory.offset[:] = _best_offset(observation, belief, episode.allowance, memory)
        return memory.offset


def _best_offset(
    observation: np.ndarray,
    belief: Belief,
    allowance: np.ndarray,
    memory: GreedyMemory,
) -> np.ndarray:
    """The best of `OFFSETS` on each lane."""
    present = (
        memory.filtered_speed,
        observation[:, ACCELERATION],
        observation[:, COMMAND],
    )
    order = np.argsort(-belief.log_probability, axis=1, kind="stable")
    likeliest = order[:, :N_HYPOTHESES]
    log_probability = np.take_along_axis(belief.log_probability, likeliest, axis=1)
    log_total = np.logaddexp.reduce(log_probability, axis=1, keepdims=True)
    information = expected_information(
        _parameters_under(belief, likeliest, memory.effects),
        np.exp(log_probability - log_total),
        np.stack(present, axis=1),
        observation[:, MISSION_SPEED].copy(),
        OFFSETS,
        reading_variance(),
        plant_constants(),
    )
    cost = DECISION * np.square(OFFSETS)
    share = cost / np.maximum(allowance, LEAST_ALLOWANCE)[:, None]
    return OFFSETS[(information - PRICE * share).argmax(axis=1)]


def _parameters_under(
    belief: Belief, hypotheses: np.ndarray, effects: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Parameters (n_lanes, n_hypotheses, n_parameters) under classes (n_lanes, n_hypotheses)."""
    severity = np.take_along_axis(belief.severity_mean, hypotheses, axis=1)[..., None]
    scale, offset = (effect[hypotheses] for effect in effects)
    healthy = np.array(list(nominal(VEHICLE).values()))
    factor, shift = fault_effect(severity, scale, offset)
    return healthy * factor + shift
