"""What the inputs of the ablation cost a vehicle: time per sample on one lane."""

import time
from collections.abc import Callable

import numpy as np
import torch

from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS, Vehicle
from diagnosers.networks.features import Features
from training.learning.reproducible import one_thread
from training.rollouts import roll_out
from training.studies.ablation_inputs import INPUTS, SAMPLES, columns
from training.studies.ablation_network import Architecture, Network

WARM_UP = 200  # samples
MEASURED = 2000
VEHICLE = "thesis1992"
Step = Callable[[np.ndarray], None]


def costs(architecture: Architecture, seed: int) -> dict[str, float]:
    """Median time per sample of the filters and the network of each input [us]."""
    vehicle = PRESETS[VEHICLE]
    n_samples = WARM_UP + MEASURED
    observations = roll_out(Fleet(1, vehicle), [seed], n_samples).observations.astype(float)
    of_group = {"raw": 0.0}
    for group, step in _filters(vehicle).items():
        of_group[group] = _median(step, observations)
    with one_thread(), torch.inference_mode():
        return {
            inputs: sum(of_group[group] for group in groups)
            + _median(_network(inputs, architecture), observations) / SAMPLES
            for inputs, groups in INPUTS.items()
        }


def _filters(vehicle: Vehicle) -> dict[str, Step]:
    """By group, what updates its filters with an observation (1, n_channels)."""
    features = Features(vehicle, classes())
    surge, parameters, motors = features.filters
    return {
        "hull": _in_turn(
            surge.update, parameters.update, states=[surge.initial(1), parameters.initial(1)]
        ),
        "motor": _in_turn(motors.update, states=[motors.initial(1)]),
        "bank": _in_turn(
            lambda state, observation: features.bank.step(state, observation)[0],
            states=[features.bank.initial(1)],
        ),
    }


def _in_turn(*updates: Callable, states: list) -> Step:
    """Updates every state with an observation."""

    def step(observation: np.ndarray) -> None:
        for k, update in enumerate(updates):
            states[k] = update(states[k], observation)

    return step


def _network(inputs: str, architecture: Architecture) -> Step:
    """One half second of a network of these inputs, whatever the observation."""
    n_inputs = len(columns(inputs))
    network = Network(n_inputs, architecture)
    values = torch.zeros(1, 1, n_inputs)
    return lambda observation: network(values)


def _median(step: Step, observations: np.ndarray) -> float:
    """Median time of a step [us], after a warm-up."""
    durations = []
    for observation in observations:
        start = time.perf_counter_ns()
        step(observation)
        durations.append(time.perf_counter_ns() - start)
    return float(np.median(durations[WARM_UP:])) / 1e3
