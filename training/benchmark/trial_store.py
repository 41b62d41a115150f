"""Trials on disk: a small .npz each, named after a digest of all that it was made from.

So a run that was broken off takes over exactly what is still valid, and nothing that other code,
weights, stimuli or episodes have made.
"""

import hashlib
import inspect
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.compiling import digest
from auv_fault_env.errors import refusal
from auv_fault_env.faults import CATALOGUE
from diagnosers import Diagnoser
from training.benchmark import trials
from training.benchmark.trials import FAULTY, Entrant, FaultyOutcome, Trial
from training.metrics.records import HealthyOutcome, concatenate_lanes

ODD = re.compile(r"\W+")


def weights_digest(diagnoser: Diagnoser) -> str | None:
    """Digest of what a diagnoser has learnt, None if nothing."""
    tensors = diagnoser.tensors() if hasattr(diagnoser, "tensors") else {}
    found = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        found.update(f"{name} {tensor.dtype} {tensor.shape}".encode())
        found.update(np.ascontiguousarray(tensor).tobytes())
    return found.hexdigest() if tensors else None


def fingerprint(entrant: Entrant, diagnoser: Diagnoser) -> str:
    """What the beliefs of a diagnoser depend on: its code, weights and settings. A foreign file's imports go unseen."""
    source = getattr(entrant.make, "source", None) or inspect.getsourcefile(type(diagnoser))
    # which of the classes in a foreign file
    of_file = getattr(entrant.make, "target", "").rpartition(":")[2]
    settings = diagnoser.settings() if hasattr(diagnoser, "settings") else {}
    return repr((digest(Path(source).resolve()) + of_file, weights_digest(diagnoser), settings))


def path_of(folder: Path, trial: Trial, made_by: str) -> Path:
    """Where a trial's outcome is kept; `made_by` is the fingerprint of its diagnoser."""
    made_from = (
        made_by,
        digest(Path(trials.__file__).resolve()),
        trial.stimulus.policy_digest,
        list(CATALOGUE.values()),
        *trial[1:],
    )
    key = hashlib.sha256(repr(made_from).encode()).hexdigest()[:20]
    return (
        folder / f"{ODD.sub('_', trial.entrant.name)}-{trial.stimulus.name}-{trial.part}-{key}.npz"
    )


def write(path: Path, outcome: FaultyOutcome | HealthyOutcome) -> None:
    """Write an outcome, aside first, so that a file is whole whenever the process dies."""
    try:
        handle, aside = tempfile.mkstemp(prefix=".", suffix=".npz", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(file, **outcome._asdict())
            os.chmod(aside, 0o644)
            os.replace(aside, path)
        finally:
            Path(aside).unlink(missing_ok=True)
    except OSError as error:
        allowed = f"a place that can be written ({error.strerror or error})"
        raise refusal(
            "trial", str(path), allowed, "make room, and run the same command again"
        ) from None


def read(paths: Sequence[Path], part: str) -> Any:
    """The outcomes of some trials of a part as one, lanes in the order of the paths: `FaultyOutcome` or `HealthyOutcome`."""
    kind = FaultyOutcome if part == FAULTY else HealthyOutcome
    return concatenate_lanes([_read(path, kind) for path in paths])


def _read(path: Path, kind: type) -> Any:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return kind(**arrays)
    except (
        OSError,
        EOFError,
        KeyError,
        TypeError,
        ValueError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        shown = f"{type(error).__name__}: {error}"
        raise refusal(
            f"trial {path}", shown, "a whole file", "delete it and run the same command again"
        ) from None
