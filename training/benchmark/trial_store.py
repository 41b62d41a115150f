"""Trials on disk: a small .npz each, its name a digest of all that it was made from.

So a run that was stopped takes over exactly what is still valid, and nothing that other code,
weights, stimuli or episodes have produced.
"""

import hashlib
import inspect
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
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
from training.report.run_folder import held

NOT_IN_FILE_NAMES = re.compile(r"\W+")
ENDING = ".npz"
ASIDE = "."  # begins the name of a trial that is being written
READ_ERRORS = (
    OSError,
    EOFError,
    KeyError,
    NotImplementedError,
    TypeError,
    ValueError,
    zipfile.BadZipFile,
    zlib.error,
)


def weights_digest(diagnoser: Diagnoser) -> str | None:
    """Digest of the weights of a diagnoser, None if it has none."""
    tensors = diagnoser.tensors() if hasattr(diagnoser, "tensors") else {}
    if not tensors:
        return None
    sha = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        sha.update(f"{name} {tensor.dtype} {tensor.shape}".encode())
        sha.update(np.ascontiguousarray(tensor).tobytes())
    return sha.hexdigest()


def fingerprint(entrant: Entrant, diagnoser: Diagnoser) -> str:
    """What the beliefs of a diagnoser depend on: its code, weights and settings.

    Misleads where a file from outside the package imports others: changes of these do not show.
    """
    source = getattr(entrant.make, "source", None) or inspect.getsourcefile(type(diagnoser))
    # which of the classes in a file from outside the package
    class_name = getattr(entrant.make, "target", "").rpartition(":")[2]
    code = digest(Path(source).resolve()) + class_name
    settings = diagnoser.settings() if hasattr(diagnoser, "settings") else {}
    return repr((code, weights_digest(diagnoser), settings))


def path_of(folder: Path, trial: Trial, fingerprint_of_diagnoser: str) -> Path:
    """The file of a trial's outcome."""
    code = digest(Path(trials.__file__).resolve())
    made_from = (
        fingerprint_of_diagnoser,
        code,
        trial.stimulus.policy_digest,
        list(CATALOGUE.values()),
        *trial[1:],
    )
    key = hashlib.sha256(repr(made_from).encode()).hexdigest()[:20]
    name = NOT_IN_FILE_NAMES.sub("_", trial.entrant.name)
    return folder / f"{name}-{trial.stimulus.name}-{trial.part}-{key}{ENDING}"


@contextmanager
def held_folder(folder: Path) -> Iterator[None]:
    """Hold the folder of a run's trials, and remove first what a killed run has half written.

    Where another process holds the folder, or folders cannot be held, nothing is removed.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            stack.enter_context(held(folder))
            for half_written in folder.glob(f"{ASIDE}*{ENDING}"):
                half_written.unlink()
        yield


def write(path: Path, outcome: FaultyOutcome | HealthyOutcome) -> None:
    """Write an outcome to a hidden file and rename it, so that every trial is whole."""
    try:
        handle, temporary = tempfile.mkstemp(prefix=ASIDE, suffix=ENDING, dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(file, **outcome._asdict())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        finally:
            Path(temporary).unlink(missing_ok=True)
    except OSError as error:
        allowed = f"a place that can be written ({error.strerror or error})"
        remedy = "make room, and run the same command again"
        raise refusal("trial", str(path), allowed, remedy) from None


def read(paths: Sequence[Path], part: str) -> Any:
    """The outcomes of some trials of a part as one, lanes in the order of the paths."""
    kind = outcome_kind(part)
    return concatenate_lanes([read_outcome(path, kind) for path in paths])


def outcome_kind(part: str) -> type[FaultyOutcome] | type[HealthyOutcome]:
    """What the trials of a part have as outcome."""
    return FaultyOutcome if part == FAULTY else HealthyOutcome


def read_outcome(path: Path, kind: type) -> Any:
    """An outcome of this kind from its file; a damaged one is refused."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return kind(**arrays)
    except READ_ERRORS as error:
        shown = f"{type(error).__name__}: {error}"
        remedy = "delete it and run the same command again"
        raise refusal(f"trial {path}", shown, "a whole file", remedy) from None
