"""The networks on raw data of V.C: their training sets from the plant, and the studies on them."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import INDEX
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, follow_mission
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.schedules import FaultEvent, Schedule
from diagnosers.networks.fault_map import MODES_5_1
from training.thesis.backpropagation import (
    LEARNING_RATE,
    MOMENTUM,
    NetworkSettings,
    evaluate,
    rms_error,
    train,
)
from training.thesis.comparison import Comparison
from training.thesis.runs import TEST_RUNS

POINTS = 400  # of each operating mode, thesis Figs 5.7 to 5.10
CHECKPOINTS = (
    24_000,
    60_000,
    90_000,
    150_000,
)  # presentations, thesis Figs 5.7 to 5.10
SIZES = (2, 3, 4, 5, 6, 7, 8)  # hidden nodes
ENOUGH = 6  # hidden nodes, thesis V.C.1
LEARNING_RATES = (0.1, 0.3, 0.5, 0.9)
MOMENTA = (0.0, 0.4, 0.9)
# in the order of Table 5.1
RUNS = ("start_normal", "start_friction", "start_drag", "start_propeller")
# What the readings are divided by: just above the largest of the runs, so that all inputs lie in
# [0, 1] but for noise.
FULL_SCALE = {
    "port_voltage": 6.0,
    "port_current": 1.5,
    "port_rpm": 650.0,
    "speed": 0.5,
}
COLUMNS = [INDEX[name] for name in FULL_SCALE]
TARGETS = np.repeat(np.eye(len(MODES_5_1)), POINTS, axis=0)
TRUE_MODE = np.repeat(np.arange(len(MODES_5_1)), POINTS)
DRAG = MODES_5_1.index("increased drag")


class Fault(NamedTuple):
    """A fault of the catalogue, or a factor on the thrust of both propellers alone as in V.D."""

    schedule: Schedule = ()
    thrust: float = 1.0


DRAG_SEVERITIES = (0.2, 0.35, 0.7, 1.0)
PROPELLER_FAULTS = {
    "port damaged: thrust −25 %, torque −20 %": Fault(
        (FaultEvent("propeller_damage:port", 0.0, 0.5),)
    ),
    "port damaged: thrust −50 %, torque −40 %": Fault(
        (FaultEvent("propeller_damage:port", 0.0, 1.0),)
    ),
    "beta −20 %, torque as before": Fault(thrust=0.80),
    "beta −35 %, torque as before": Fault(thrust=0.65),
    "beta −50 %, torque as before": Fault(thrust=0.50),
}
VARIANTS = tuple(product(DRAG_SEVERITIES, PROPELLER_FAULTS))
THRUST_ALONE = (0.35, "beta −35 %, torque as before")  # with the sizes of IV.C


class RawStudy(NamedTuple):
    """Outputs of the networks, each (n_checkpoints, n_networks, n_points, n_modes).

    `noisy` networks have six hidden nodes and readings with noise of their own; all others are
    without noise: by number of hidden nodes, by (learning rate, momentum), and by (severity of the
    drag fault, kind of propeller fault).
    """

    by_size: dict[int, np.ndarray]
    noisy: np.ndarray
    by_settings: dict[tuple[float, float], np.ndarray]
    by_variant: dict[tuple[float, str], np.ndarray]


def run_study(comparison: Comparison, seeds: Sequence[int], bar: tqdm) -> RawStudy:
    """Train all networks of V.C, one per seed and case."""
    clean = training_sets(comparison.clean.readings, comparison.runs)
    noisy = training_sets(comparison.noisy.readings[:, :, : len(seeds)], comparison.runs)
    inputs = np.concatenate([clean, variant_sets(), noisy])
    groups = _groups(seeds, len(noisy))
    networks = train(groups, inputs, TARGETS, CHECKPOINTS, bar)
    outputs: dict[str, dict] = {
        "size": {},
        "noisy": {},
        "settings": {},
        "variant": {},
    }
    for (kind, case), trained in networks.items():
        data_sets = [network.data_set for network in groups[kind, case]]
        outputs[kind][case] = evaluate(trained, inputs[data_sets]).astype(np.float32)
    noisy_outputs = outputs["noisy"][ENOUGH]
    return RawStudy(outputs["size"], noisy_outputs, outputs["settings"], outputs["variant"])


def _groups(seeds: Sequence[int], n_noisy: int) -> dict[tuple, list[NetworkSettings]]:
    """Settings of the networks by kind of study and case.

    The data sets are the test runs without noise, the variants, and `n_noisy` noisy ones.
    """
    groups: dict[tuple, list[NetworkSettings]] = {}
    for size in SIZES:
        groups["size", size] = [NetworkSettings(seed, size) for seed in seeds]
    for settings in product(LEARNING_RATES, MOMENTA):
        groups["settings", settings] = [NetworkSettings(seed, ENOUGH, *settings) for seed in seeds]
    defaults = (ENOUGH, LEARNING_RATE, MOMENTUM)
    for k, variant in enumerate(VARIANTS):
        groups["variant", variant] = [NetworkSettings(seed, *defaults, 1 + k) for seed in seeds]
    first_noisy = 1 + len(VARIANTS)
    groups["noisy", ENOUGH] = [
        NetworkSettings(seed, *defaults, first_noisy + k % n_noisy) for k, seed in enumerate(seeds)
    ]
    return groups


def training_sets(readings: np.ndarray, runs: Sequence[str]) -> np.ndarray:
    """Training sets (n_seeds, n_points, n_inputs) from the readings of the test runs."""
    rows = [runs.index(run) for run in RUNS]
    recorded = readings[:POINTS, rows][..., COLUMNS]
    return _network_inputs(recorded.transpose(2, 1, 0, 3))


def variant_sets() -> np.ndarray:
    """Training sets (n_variants, n_points, n_inputs) with other sizes of the faults, no noise."""
    faults = [Fault(TEST_RUNS[run].schedule) for run in RUNS[:2]]
    for severity in DRAG_SEVERITIES:
        faults.append(Fault((FaultEvent("increased_drag", 0.0, severity),)))
    faults.extend(PROPELLER_FAULTS.values())
    normal, friction, *others = _simulate(faults)
    drag = dict(zip(DRAG_SEVERITIES, others, strict=False))
    propeller = dict(zip(PROPELLER_FAULTS, others[len(drag) :], strict=True))
    sets = [[normal, friction, drag[severity], propeller[kind]] for severity, kind in VARIANTS]
    return _network_inputs(np.stack(sets))


def _simulate(faults: Sequence[Fault]) -> np.ndarray:
    """Readings (n_faults, POINTS, n_inputs) of the acceleration from rest, without noise."""
    n_lanes = len(faults)
    fleet = Fleet(n_lanes, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    schedules = [fault.schedule for fault in faults]
    missions = [MISSIONS["acceleration"]] * n_lanes
    observation = fleet.reset([0] * n_lanes, schedules=schedules, missions=missions)
    healthy = fleet.plan.healthy.copy()
    names = list(PARAMETERS)
    for parameter in ("port_beta", "starboard_beta"):
        healthy[:, names.index(parameter)] *= [fault.thrust for fault in faults]
    fleet.set_healthy(healthy)
    readings = [observation]
    for _ in range(POINTS - 1):
        observation = fleet.step(follow_mission(observation))
        readings.append(observation)
    return np.stack(readings, axis=1)[..., COLUMNS]


def _network_inputs(readings: np.ndarray) -> np.ndarray:
    """Readings (n_sets, n_modes, POINTS, n_inputs) as inputs (n_sets, n_points, n_inputs)."""
    points = readings.reshape(len(readings), -1, len(COLUMNS))
    return points / np.array(list(FULL_SCALE.values()))


def rms_errors(outputs: np.ndarray) -> np.ndarray:
    """Root mean squared output error, (n_checkpoints, n_networks)."""
    return rms_error(outputs, TARGETS)


def accuracy_by_mode(outputs: np.ndarray, late: bool = False) -> np.ndarray:
    """Share of each mode's points named correctly, (n_checkpoints, n_networks, n_modes).

    `late` takes the second half of each transient alone, where it has settled.
    """
    is_right = outputs.argmax(axis=-1) == TRUE_MODE
    by_mode = is_right.reshape(*outputs.shape[:2], len(MODES_5_1), POINTS)
    first = POINTS // 2 if late else 0
    return by_mode[..., first:].mean(axis=-1)


def friction_accuracy(outputs: np.ndarray) -> np.ndarray:
    """Share of the points of normal and friction where the right one of their outputs is larger.

    (n_checkpoints, n_networks); the outputs of the other modes are ignored.
    """
    both = outputs[..., : 2 * POINTS, :]
    says_friction = both[..., 1] > both[..., 0]
    is_friction = TRUE_MODE[: 2 * POINTS] == 1
    return (says_friction == is_friction).mean(axis=-1)


def first_drag_points_named(outputs: np.ndarray, mode: str, count: int = 100) -> np.ndarray:
    """How many of drag's first points are named `mode`, (n_checkpoints, n_networks)."""
    first = outputs[..., DRAG * POINTS : DRAG * POINTS + count, :]
    return (first.argmax(axis=-1) == MODES_5_1.index(mode)).sum(axis=-1)


def points_until_drag(outputs: np.ndarray) -> np.ndarray:
    """Points of drag until its output stays the largest, (n_checkpoints, n_networks).

    400 if it does not stay the largest to the end.
    """
    points = outputs[..., DRAG * POINTS : (DRAG + 1) * POINTS, :]
    is_wrong = points.argmax(axis=-1) != DRAG
    after_last_wrong = POINTS - np.argmax(is_wrong[..., ::-1], axis=-1)
    return np.where(is_wrong.any(axis=-1), after_last_wrong, 0)
