"""What the networks of the ablation see: groups of the features of `integrated`, by half seconds.

The features are those of `diagnosers.networks.features`, averaged over half a second; of the steps
of the readings it is their mean size. The physical residuals among them are left out, because they
are neither raw data nor the output of a filter.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.compiling import digest
from auv_fault_env.faults import classes
from diagnosers import storage
from diagnosers.networks.features import ESTIMATES, feature_names
from training.learning.episode_sets import LANES, SCHEDULES, UNKNOWN_SHARE, features_over_time
from training.learning.episodes import training_episodes

SAMPLES = 5  # of half a second
OF_HULL = ("surge", "parameter", "speed", "acceleration")
OF_READING = ("step", "repeated", "zero", "repeats", "zeros")
INPUTS = {
    "raw": ("raw",),
    "hull filter": ("hull",),
    "motor filter": ("motor",),
    "both filters": ("hull", "motor"),
    "raw and filters": ("raw", "hull", "motor"),
    "bank": ("bank",),
    "bank, raw and filters": ("raw", "hull", "motor", "bank"),
}


class FeatureSet(NamedTuple):
    """Features (n_halves, n_lanes, n_features) float16 and true classes (n_halves, n_lanes)."""

    features: np.ndarray
    label: np.ndarray


def group_of(feature: str) -> str | None:
    """The group of a feature: raw, hull, motor or bank; None of a physical residual."""
    name, _, part = feature.partition(":")
    if name.startswith("bank_"):
        return "bank"
    if (name in CHANNELS and not part) or (name in READINGS and part in OF_READING):
        return "raw"
    if name in ("disturbance", "speed_correction"):
        return "hull"
    if name in ESTIMATES or name.endswith("_innovation"):
        return "hull" if name.split("_")[0] in OF_HULL else "motor"
    return None


def columns(inputs: str) -> np.ndarray:
    """The columns of the features that these inputs are, (n_inputs,)."""
    groups = INPUTS[inputs]
    names = feature_names(classes())
    return np.array([k for k, name in enumerate(names) if group_of(name) in groups])


def by_half_seconds(observations: np.ndarray) -> np.ndarray:
    """Averaged features (n_halves, n_lanes, n_features) of (n_samples, n_lanes, n_channels)."""
    names = feature_names(classes())
    is_step = np.array([name.endswith(":step") for name in names])
    n_samples, n_lanes, _ = observations.shape
    averaged = np.empty((n_samples // SAMPLES, n_lanes, len(names)), np.float16)
    total = np.zeros((n_lanes, len(names)), np.float32)
    for k, features in enumerate(features_over_time(observations), start=1):
        total += np.where(is_step, np.abs(features), features)
        if k % SAMPLES == 0:
            averaged[k // SAMPLES - 1] = total / SAMPLES
            total[:] = 0.0
    return averaged


def training_set(cache: Path, purpose: str, number: int) -> Path:
    """The file of the number-th `LANES` training episodes of a purpose; made if it is missing."""
    key = digest(Path(__file__))
    path = cache / f"{purpose}-{number:04d}-{key}.safetensors"
    if not path.exists():
        first = number * LANES
        rollouts = list(training_episodes(purpose, LANES, first, SCHEDULES, UNKNOWN_SHARE))
        observations = np.concatenate([rollout.observations for rollout in rollouts], axis=1)
        label = np.concatenate([rollout.label for rollout in rollouts], axis=1)
        episodes = FeatureSet(by_half_seconds(observations), of_halves(label))
        storage.write(path, episodes._asdict(), {})
    return path


def of_halves(label: np.ndarray) -> np.ndarray:
    """The classes (n_samples, n_lanes) at the end of each half second, uint8."""
    return label[SAMPLES - 1 :: SAMPLES].astype(np.uint8)


def read(paths: Sequence[Path], chosen: np.ndarray) -> FeatureSet:
    """The episodes of these files as one set, with the chosen columns (n_inputs,) alone."""
    features = []
    label = []
    for path in paths:
        tensors, _ = storage.read(path)
        features.append(tensors["features"][:, :, chosen])
        label.append(tensors["label"])
    return FeatureSet(np.concatenate(features, axis=1), np.concatenate(label, axis=1))


def read_features(paths: Sequence[Path], chosen: np.ndarray) -> np.ndarray:
    """The chosen columns of the features in these files, lanes after each other."""
    parts = [storage.read(path)[0]["features"][:, :, chosen] for path in paths]
    return np.concatenate(parts, axis=1)
