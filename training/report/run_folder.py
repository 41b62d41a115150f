"""The folder of a run: written beside its place and moved there when it is complete."""

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
    "auv-fault gymnasium joblib matplotlib numba numpy pyarrow safetensors scipy torch".split()
)
MANIFEST = "manifest.json"
# what comes before the name in the commands that write run folders
SUBCOMMAND = "auv-fault "
STUDY = "python -m training.studies."


class UnfinishedRun(NamedTuple):
    """What a run in progress has created: the hidden folder that it writes into, if it exists yet.

    `parents` are those parents of the output that did not exist before, innermost first.
    """

    folder: list[Path]
    parents: list[Path]


unfinished_runs: list[UnfinishedRun] = []


@contextmanager
def run_folder(
    output: Path,
    name: str,
    arguments: Any,
    notes: Mapping[str, Any] | None = None,
    files_to_keep: Sequence[str] = (),
    program: str = SUBCOMMAND,
) -> Iterator[Path]:
    """Yield a folder to write into, which becomes `output` on success and disappears on failure.

    An earlier run at `output` is replaced. Only a killed process (SIGKILL) can leave something
    behind: a hidden folder beside `output`.

    Parameters
    ----------
    output
        Folder of the complete run.
    name, arguments
        Name and arguments of the command, for the manifest.
    notes
        Further entries of the manifest.
    files_to_keep
        Files and folders of an earlier run that move into the new one, by name.
    program
        `SUBCOMMAND` or `STUDY`: what comes before the name in the command.

    Raises
    ------
    InputError
        If `output` holds anything but an earlier run, or cannot be written.
    """
    output = checked_output(output)
    run = UnfinishedRun([], [parent for parent in output.parents if not parent.exists()])
    unfinished_runs.append(run)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{output.name}-", dir=output.parent))
        run.folder.append(folder)
        yield folder
        write_manifest(folder, name, arguments, notes, program)
        folder.chmod(0o755)
        _replace(output, folder, files_to_keep)
    except BaseException as error:
        remove_unfinished_runs()
        if isinstance(error, OSError):
            allowed = f"a place that can be written ({error.strerror or error})"
            raise refusal("output", str(output), allowed, "choose another --output") from None
        raise
    finally:
        unfinished_runs.remove(run)


def checked_output(output: Path) -> Path:
    """The resolved path; refused if anything but an empty folder or an earlier run is there."""
    output = Path(output).resolve()
    is_occupied = os.path.lexists(output) and not _is_empty_folder(output)
    if is_occupied and read_manifest(output) is None:
        allowed = "a new folder or that of an earlier run"
        raise refusal("output", str(output), allowed, "choose another --output")
    return output


def read_manifest(path: Path) -> dict[str, Any] | None:
    """The manifest of the run at `path`; None if there is no run."""
    try:
        manifest = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(manifest, dict):
        return None
    is_run = str(manifest.get("command", "")).startswith((SUBCOMMAND, STUDY))
    return manifest if is_run else None


def remove_unfinished_runs() -> None:
    """Remove what unfinished runs have written, after a failure or before the process ends."""
    for run in unfinished_runs:
        for folder in run.folder:
            shutil.rmtree(folder, ignore_errors=True)
        for parent in filter(_is_empty_folder, run.parents):
            parent.rmdir()


def write_json(path: Path, content: Any) -> None:
    """Write JSON that any reader takes: no NaN, no infinity."""
    path.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())


def write_manifest(
    folder: Path,
    name: str,
    arguments: Any,
    notes: Mapping[str, Any] | None = None,
    program: str = SUBCOMMAND,
) -> None:
    """Write command, arguments, versions and revision: the file by which a run folder is known."""
    manifest = {
        "command": program + name,
        "arguments": asdict(arguments),
        "given": sys.argv[1:],
        **(notes or {}),
        **provenance(),
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=2, default=str), encoding="utf-8")


def _replace(output: Path, folder: Path, files_to_keep: Sequence[str]) -> None:
    """Move the folder to the output; an earlier run stays if that fails."""
    earlier = folder.with_name(folder.name + "-old")
    if output.exists():
        output.rename(earlier)
    try:
        folder.rename(output)
    except OSError:
        if earlier.exists():
            earlier.rename(output)
        raise
    for name in files_to_keep:
        if (earlier / name).exists():
            (earlier / name).rename(output / name)
    shutil.rmtree(earlier, ignore_errors=True)


def provenance() -> dict[str, Any]:
    """Versions of Python and the packages, and the git revision."""
    versions = {package: _version(package) for package in PACKAGES}
    python = {"python": platform.python_version()}
    return {"versions": python | versions, "revision": _revision()}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _revision() -> str | None:
    """Git revision of the code, with a `+` if files were changed; None outside a checkout."""
    try:
        head = _git("rev-parse", "HEAD").strip()
        changes = _git("status", "--porcelain")
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changes else "")


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(Path(__file__).parent), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout
