"""The folder of a run: written aside and moved into place when complete, so that nothing half-written stays."""

import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.errors import refusal

PACKAGES = (
    "auv-fault",
    "gymnasium",
    "joblib",
    "matplotlib",
    "numba",
    "numpy",
    "pyarrow",
    "safetensors",
    "scipy",
    "torch",
)
MANIFEST = "manifest.json"


class Unfinished(NamedTuple):
    """A run in progress: its folder, once it is made, and the parents it has to make, innermost first."""

    folder: list[Path]
    parents: list[Path]


unfinished: list[Unfinished] = []


@contextmanager
def run_folder(
    output: Path,
    name: str,
    arguments: Any,
    notes: Mapping[str, Any] | None = None,
    keeps: Sequence[str] = (),
) -> Iterator[Path]:
    """A folder to write into; on success it becomes `output` with a manifest, on any failure it disappears.

    An earlier run at `output` is replaced; anything else there, and a place that cannot be written,
    is refused. Only a killed process (SIGKILL) can leave something: a hidden folder beside
    `output`.

    Parameters
    ----------
    output
        Where the run is to be.
    name, arguments
        Of the command.
    notes
        What the manifest says besides.
    keeps
        What is taken over of an earlier run.
    """
    output = free_place(output)
    run = Unfinished([], _missing_parents(output))
    unfinished.append(run)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{output.name}-", dir=output.parent))
        run.folder.append(aside)
        yield aside
        write_manifest(aside, name, arguments, notes)
        aside.chmod(0o755)
        _replace(output, aside, keeps)
    except BaseException as error:
        abandon()
        if isinstance(error, OSError):
            allowed = f"a place that can be written ({error.strerror or error})"
            raise refusal("output", str(output), allowed, "choose another --output") from None
        raise
    finally:
        unfinished.remove(run)


def free_place(output: Path) -> Path:
    """The resolved path if a run may be put there: where nothing is, or an earlier run; else a refusal."""
    output = Path(output).resolve()
    if os.path.lexists(output) and earlier_run(output) is None and not _is_empty_folder(output):
        raise refusal(
            "output",
            str(output),
            "a new folder or that of an earlier run",
            "choose another --output",
        )
    return output


def earlier_run(path: Path) -> dict[str, Any] | None:
    """The manifest of the run at `path`; None if there is no run."""
    try:
        manifest = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    ours = isinstance(manifest, dict) and str(manifest.get("command", "")).startswith("auv-fault ")
    return manifest if ours else None


def abandon() -> None:
    """Remove what unfinished runs have written, for a run that has failed or a process that is about to end."""
    for run in unfinished:
        for folder in run.folder:
            shutil.rmtree(folder, ignore_errors=True)
        for parent in filter(_is_empty_folder, run.parents):
            parent.rmdir()


def write_json(path: Path, content: Any) -> None:
    """Write JSON that any reader takes: no NaN, no infinity."""
    path.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())


def _missing_parents(path: Path) -> list[Path]:
    return [parent for parent in path.parents if not parent.exists()]


def write_manifest(
    folder: Path, name: str, arguments: Any, notes: Mapping[str, Any] | None = None
) -> None:
    """Write what was asked for, and what made it: by this file a folder is known as that of a run."""
    manifest = {
        "command": f"auv-fault {name}",
        "arguments": asdict(arguments),
        "given": sys.argv[1:],
        **(notes or {}),
        **provenance(),
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=2, default=str), encoding="utf-8")


def _replace(output: Path, aside: Path, keeps: Sequence[str]) -> None:
    old = aside.with_name(aside.name + "-old")
    if output.exists():
        output.rename(old)
    try:
        aside.rename(output)
    except OSError:
        if old.exists():
            old.rename(output)
        raise
    for kept in filter(Path.exists, (old / name for name in keeps)):
        kept.rename(output / kept.name)
    shutil.rmtree(old, ignore_errors=True)


def provenance() -> dict[str, Any]:
    """Versions of Python and the packages, and the git revision: what made a result, besides its command."""
    versions = {"python": platform.python_version()} | {
        package: _version(package) for package in PACKAGES
    }
    return {"versions": versions, "revision": _revision()}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _revision() -> str | None:
    """Git revision of the code, `+` behind it if files were changed; None outside a checkout."""
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        head = subprocess.run(
            [*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
        ).stdout.strip()
        changed = subprocess.run(
            [*git, "status", "--porcelain"], capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changed else "")
