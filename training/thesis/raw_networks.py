"""The networks on unprocessed data of V.C: their training sets from the plant, and every study trained on them."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.schedules import FaultEvent, Schedule
from diagnosers.networks.fault_map import MODES_5_1
from training.thesis.backpropagation import MOMENTUM, RATE, Lane, recall, rms, train
from training.thesis.comparison import Comparison
from training.thesis.runs import TEST_RUNS

POINTS = 400  # of each operating mode, thesis Figs 5.7 to 5.10
CHECKPOINTS = (24_000, 60_000, 90_000, 150_000)  # presentations, thesis Figs 5.7 to 5.10
SIZES = (2, 3, 4, 5, 6, 7, 8)
RATES = (0.1, 0.3, 0.5, 0.9)
MOMENTA = (0.0, 0.4, 0.9)
# in the order of Table 5.1
RUNS = ("start_normal", "start_friction", "start_drag", "start_propeller")
# What the readings are divided by: just above the largest of the runs, so that all inputs lie in
# [0, 1] but for noise.
FULL_SCALE = {"port_voltage": 6.0, "port_current": 1.5, "port_rpm": 650.0, "speed": 0.5}
COLUMNS = [list(CHANNELS).index(name) for name in FULL_SCALE]
TARGETS = np.repeat(np.eye(len(MODES_5_1)), POINTS, axis=0)
MODE = np.repeat(np.arange(len(MODES_5_1)), POINTS)


class Propeller(NamedTuple):
    """A way to degrade the propeller: a fault of the catalogue, or the thrust of both alone as in V.D."""

    schedule: Schedule = ()
    thrust: float = 1.0


DRAGS = (0.2, 0.35, 0.7, 1.0)
PROPELLERS = {
    "port damaged: thrust −25 %, torque −20 %": Propeller(
        (FaultEvent("propeller_damage:port", 0.0, 0.5),)
    ),
    "port damaged: thrust −50 %, torque −40 %": Propeller(
        (FaultEvent("propeller_damage:port", 0.0, 1.0),)
    ),
    "beta −20 %, torque as before": Propeller(thrust=0.80),
    "beta −35 %, torque as before": Propeller(thrust=0.65),
    "beta −50 %, torque as before": Propeller(thrust=0.50),
}
VARIANTS = tuple(product(DRAGS, PROPELLERS))
THRUST_ALONE = (0.35, "beta −35 %, torque as before")  # with the sizes of IV.C


class RawStudy(NamedTuple):
    """Outputs (n_checkpoints, n_networks, n_points, n_modes) of the networks, by study and case.

    size: by hidden nodes, noise-free; noisy: six nodes, every network with readings of its own
    noise; setting: by (rate, momentum); variant: by (size of the drag fault, kind of propeller
    fault).
    """

    size: dict[int, np.ndarray]
    noisy: np.ndarray
    setting: dict[tuple[float, float], np.ndarray]
    variant: dict[tuple[float, str], np.ndarray]


def study(view: Comparison, seeds: Sequence[int], bar: tqdm) -> RawStudy:
    """Train every network of V.C, one per seed."""
    noisy = training_sets(view.noisy.readings[:, :, : len(seeds)], view.runs)
    inputs = np.concatenate([training_sets(view.clean.readings, view.runs), variant_sets(), noisy])
    first_noisy = 1 + len(VARIANTS)
    groups = {("size", size): [Lane(seed, size) for seed in seeds] for size in SIZES}
    groups |= {
        ("setting", setting): [Lane(seed, 6, *setting) for seed in seeds]
        for setting in product(RATES, MOMENTA)
    }
    groups |= {
        ("variant", case): [Lane(seed, 6, RATE, MOMENTUM, 1 + k) for seed in seeds]
        for k, case in enumerate(VARIANTS)
    }
    groups[("noisy", 6)] = [
        Lane(seed, 6, RATE, MOMENTUM, first_noisy + k % len(noisy)) for k, seed in enumerate(seeds)
    ]
    networks = train(groups, inputs, TARGETS, CHECKPOINTS, bar)
    outputs: dict[str, dict] = {"size": {}, "noisy": {}, "setting": {}, "variant": {}}
    for (kind, case), trained in networks.items():
        seen = inputs[[lane.data for lane in groups[kind, case]]]
        outputs[kind][case] = recall(trained, seen).astype(np.float32)
    return RawStudy(outputs["size"], outputs["noisy"][6], outputs["setting"], outputs["variant"])


def training_sets(readings: np.ndarray, runs: Sequence[str]) -> np.ndarray:
    """Training sets (n_seeds, n_points, n_inputs) from recorded readings (n_samples, n_runs, n_seeds, n_channels)."""
    chosen = readings[:POINTS, [runs.index(run) for run in RUNS]][..., COLUMNS]
    return _scaled(chosen.transpose(2, 1, 0, 3))


def variant_sets() -> np.ndarray:
    """Noise-free training sets (n_variants, n_points, n_inputs) with other sizes of the drag and propeller faults."""
    normal, friction = (Propeller(TEST_RUNS[run].schedule) for run in RUNS[:2])
    drags = [Propeller((FaultEvent("increased_drag", 0.0, severity),)) for severity in DRAGS]
    first, second, *rest = _simulated([normal, friction, *drags, *PROPELLERS.values()])
    drag = dict(zip(DRAGS, rest, strict=False))
    propeller = dict(zip(PROPELLERS, rest[len(drags) :], strict=True))
    return _scaled(
        np.stack([[first, second, drag[size], propeller[kind]] for size, kind in VARIANTS])
    )


def _simulated(faults: Sequence[Propeller]) -> np.ndarray:
    """Readings (n_faults, POINTS, n_inputs) of the acceleration from rest, noise-free."""
    fleet = Fleet(len(faults), sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    missions = [MISSIONS["acceleration"]] * len(faults)
    observation = fleet.reset(
        [0] * len(faults), schedules=[fault.schedule for fault in faults], missions=missions
    )
    healthy = fleet.plan.healthy.copy()
    names = list(PARAMETERS)
    for side in ("port_beta", "starboard_beta"):
        healthy[:, names.index(side)] *= [fault.thrust for fault in faults]
    fleet.set_healthy(healthy)
    readings = [observation]
    for _ in range(POINTS - 1):
        observation = fleet.step(observation[:, :1] * [1.0, 0.0, 0.0])
        readings.append(observation)
    return np.stack(readings, axis=1)[..., COLUMNS]


def _scaled(readings: np.ndarray) -> np.ndarray:
    """Readings (n_sets, n_modes, POINTS, n_inputs) as inputs (n_sets, n_points, n_inputs)."""
    return readings.reshape(len(readings), -1, len(COLUMNS)) / np.array(list(FULL_SCALE.values()))


def errors(outputs: np.ndarray) -> np.ndarray:
    """Root mean squared output error, (n_checkpoints, n_networks)."""
    return rms(outputs, TARGETS)


def named_correctly(outputs: np.ndarray, late: bool = False) -> np.ndarray:
    """Share of each mode's points whose own output is the largest, (n_checkpoints, n_networks, n_modes).

    ``late`` takes the second half of each transient alone, where it has settled.
    """
    right = (outputs.argmax(axis=-1) == MODE).reshape(*outputs.shape[:2], len(MODES_5_1), POINTS)
    return right[..., POINTS // 2 if late else 0 :].mean(axis=-1)


def friction_told_from_normal(outputs: np.ndarray) -> np.ndarray:
    """Share of the points of these two modes where the right one of their two outputs is the larger, per network."""
    friction_larger = outputs[..., : 2 * POINTS, 1] > outputs[..., : 2 * POINTS, 0]
    return (friction_larger == (MODE[: 2 * POINTS] == 1)).mean(axis=-1)


def first_drag_points_named(outputs: np.ndarray, mode: str, count: int = 100) -> np.ndarray:
    """How many of the first points of the drag fault are named `mode`, (n_checkpoints, n_networks)."""
    drag = outputs[..., 2 * POINTS : 2 * POINTS + count, :]
    return (drag.argmax(axis=-1) == MODES_5_1.index(mode)).sum(axis=-1)


def drag_settled(outputs: np.ndarray) -> np.ndarray:
    """Points of the drag fault until its output stays the largest, (n_checkpoints, n_networks); 400 for never."""
    wrong = outputs[..., 2 * POINTS : 3 * POINTS, :].argmax(axis=-1) != 2
    last = POINTS - np.argmax(wrong[..., ::-1], axis=-1)
    return np.where(wrong.any(axis=-1), last, 0)
