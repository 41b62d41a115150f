"""Weights and settings on disk: safetensors with a JSON header, data and never code."""

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from auv_fault_env.errors import refusal

Shapes = dict[str, tuple[int, ...]]  # of tensors, by name
Weights = str | Path | Mapping[str, np.ndarray]  # a file of tensors, or tensors by name
HEADER = "auv_fault"
WEIGHTS = Path(__file__).parent / "weights"  # of the package, each file with its card


def write(path: str | Path, tensors: Mapping[str, np.ndarray], header: Mapping[str, Any]) -> None:
    """Write tensors and header by way of a temporary file, so that no reader finds half a file."""
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        os.close(handle)
        try:
            contiguous = {name: np.asarray(tensor, order="C") for name, tensor in tensors.items()}
            save_file(
                contiguous,
                temporary,
                metadata={HEADER: json.dumps(header, sort_keys=True)},
            )
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        finally:
            Path(temporary).unlink(missing_ok=True)
    except (OSError, SafetensorError) as error:  # the latter for a full disk
        allowed = f"a place that can be written ({getattr(error, 'strerror', None) or error})"
        raise refusal("weights file", str(path), allowed, "choose another path") from None


def read(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Tensors and header of a file that `write` made; anything else is refused in one line."""
    if not Path(path).is_file():
        allowed = "an existing safetensors file"
        raise refusal("weights file", str(path), allowed, "check the path, or train first")
    try:
        with safe_open(path, framework="numpy") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}
            header = json.loads((file.metadata() or {})[HEADER])
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        allowed = f"a complete safetensors file of this package ({reason})"
        raise refusal("weights file", str(path), allowed, "copy it again, or train anew") from None
    return tensors, header


def check_tensors(
    path: str | Path, tensors: Mapping[str, np.ndarray], shapes: Shapes
) -> dict[str, np.ndarray]:
    """The tensors, if they have these names and shapes and are finite; else refused."""
    found = {name: tensor.shape for name, tensor in tensors.items()}
    if found != dict(shapes):
        missing_or_extra = sorted(set(found) ^ set(shapes))
        unequal = [name for name in shapes if found.get(name) != shapes[name]]
        first = (missing_or_extra or unequal)[:3]
        expected = ", ".join(f"{name}: {shapes.get(name)}" for name in first)
        shown = {name: found.get(name) for name in first}
        allowed = f"its architecture, {{{expected}}}"
        raise refusal(f"tensors of {path}", shown, allowed, "take weights of this diagnoser")
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            thing = f"tensor {name} of {path}"
            raise refusal(thing, "NaN or infinity", "finite weights", "train anew")
    return dict(tensors)


def settings_of(weights: Weights) -> dict[str, Any]:
    """The settings beside the tensors in a file of a diagnoser's save; none without a file."""
    if isinstance(weights, Mapping):
        return {}
    header = read(weights)[1]
    settings = header.get("settings") if isinstance(header, dict) else None
    return settings if isinstance(settings, dict) else {}


def load_tensors(weights: Weights, architecture: Shapes) -> dict[str, np.ndarray]:
    """The tensors, from their file if need be, checked for this architecture."""
    if isinstance(weights, Mapping):
        return check_tensors("the network", weights, architecture)
    return check_tensors(weights, read(weights)[0], architecture)
