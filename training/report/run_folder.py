"""The folder of a run: written beside its place and moved there when it is complete."""

import glob
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.errors import refusal
from auv_fault_env.text_files import text_of

PACKAGES = (
    "auv-fault gymnasium joblib matplotlib numba numpy pyarrow safetensors scipy torch".split()
)
DEEPEST = 500  # folders above an output: they are made by recursion
MANIFEST = "manifest.json"
# what comes before the name in the commands that write run folders
SUBCOMMAND = "auv-fault "
STUDY = "python -m training.studies."
EARLIER = "-earlier"  # ends the name of an earlier run while another takes its place


class UnfinishedRun(NamedTuple):
    """What a run in progress has created: the hidden folder that it writes into, if it exists yet.

    `parents` are those parents of the output that did not exist before, innermost first.
    """

    output: Path
    files_to_keep: Sequence[str]
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

    An earlier run of the same command at `output` is replaced. A killed process (SIGKILL) can leave
    a hidden folder beside `output`, which the next run there removes, or moves to its place if it
    was complete.

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
        If `output` holds anything but an earlier run of the command, or cannot be written.
    """
    output = checked_output(output, program + name, files_to_keep)
    parents = [parent for parent in output.parents if not parent.exists()]
    run = UnfinishedRun(output, files_to_keep, [], parents)
    unfinished_runs.append(run)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=_prefix(output), dir=output.parent))
        run.folder.append(folder)
        with ExitStack() as stack:
            with suppress(OSError):
                stack.enter_context(held(folder))
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


def checked_output(output: Path, command: str, files_to_keep: Sequence[str] = ()) -> Path:
    """The resolved path, once what a killed run has left is settled.

    Refused if anything but an empty folder or an earlier run of the command is there.
    """
    try:
        resolved = Path(output).resolve()
        _settle_killed_runs(resolved, files_to_keep)
        is_occupied = resolved.exists() and not _is_empty_folder(resolved)
    # RuntimeError for links in a circle, ValueError for a path with a null
    except (OSError, RuntimeError, ValueError) as error:
        allowed = f"a place that can be written ({getattr(error, 'strerror', None) or error})"
        raise refusal("output", str(output), allowed, "choose another --output") from None
    if len(resolved.parents) > DEEPEST:
        allowed = f"a place within {DEEPEST} folders"
        raise refusal("output", str(output), allowed, "choose another --output")
    manifest = read_manifest(resolved)
    if is_occupied and (manifest is None or manifest["command"] != command):
        found = f"a run of {manifest['command']}" if manifest else "other files"
        allowed = f"a new folder or that of an earlier run of {command}, and it holds {found}"
        raise refusal("output", str(resolved), allowed, "choose another --output")
    return resolved


def read_manifest(path: Path) -> dict[str, Any] | None:
    """The manifest of the run at `path`; None if there is no run."""
    try:
        manifest = json.loads(text_of(path / MANIFEST, "manifest", "that of a run"))
    except (ValueError, RecursionError):
        return None
    if not isinstance(manifest, dict):
        return None
    is_run = str(manifest.get("command", "")).startswith((SUBCOMMAND, STUDY))
    return manifest if is_run else None


def remove_unfinished_runs() -> None:
    """Remove what unfinished runs have written, after a failure or before the process ends."""
    for run in unfinished_runs:
        for folder in run.folder:
            with suppress(OSError):
                _settle(folder, run.output, run.files_to_keep)
        for parent in filter(_is_empty_folder, run.parents):
            parent.rmdir()


def write_json(path: Path, content: Any) -> None:
    """Write JSON that any reader takes: no NaN, no infinity; the file is whole at any time."""
    aside = path.with_name(f".{path.name}")
    aside.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")
    aside.replace(path)


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
    earlier = _earlier(folder)
    if output.exists():
        output.rename(earlier)
    try:
        folder.rename(output)
    except OSError:
        if earlier.exists():
            earlier.rename(output)
        raise
    _settle(folder, output, files_to_keep)


def _settle(folder: Path, output: Path, files_to_keep: Sequence[str]) -> None:
    """Finish a replacement that has begun, whose folder is complete; else remove the folder."""
    earlier = _earlier(folder)
    if earlier.exists():
        if not output.exists():
            (folder if folder.exists() else earlier).rename(output)
        for name in files_to_keep:
            if (earlier / name).exists() and not (output / name).exists():
                (earlier / name).rename(output / name)
    shutil.rmtree(earlier, ignore_errors=True)
    shutil.rmtree(folder, ignore_errors=True)


def _settle_killed_runs(output: Path, files_to_keep: Sequence[str]) -> None:
    """Settle every hidden folder of this output that no process holds."""
    for left in output.parent.glob(f"{glob.escape(_prefix(output))}*"):
        # of a replacement that has begun one or both folders exist
        folder = left.with_name(left.name.removesuffix(EARLIER))
        with suppress(OSError), held(folder if folder.exists() else left):
            _settle(folder, output, files_to_keep)


def _prefix(output: Path) -> str:
    return f".{output.name}.unfinished-"


def _earlier(folder: Path) -> Path:
    return folder.with_name(folder.name + EARLIER)


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder until the context or the process ends; `OSError` if another process holds it.

    Also `OSError` where folders cannot be held: on Windows, and on some file systems.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        import fcntl  # not on Windows, which opens no folder

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


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
