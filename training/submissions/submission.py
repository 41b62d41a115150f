"""A submission: a diagnoser from outside with the files that it consists of, and their digest."""

import hashlib
import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from auv_fault_env.errors import refusal
from diagnosers import Diagnoser
from diagnosers.third_party import TARGET_FORM, ThirdParty, check_names_a_class
from training.benchmark.third_parties import Party
from training.submissions.onnx_network import OnnxNetwork

ONNX = ".onnx"
FORMS = f"{TARGET_FORM}, or path/to/file{ONNX}"
NOT_SOURCE = "__pycache__"


class Submission(NamedTuple):
    """A diagnoser to be scored."""

    target: str  # as it was named, without the folders of a file
    files: Mapping[str, str]  # SHA-256 of each file, by its path within the submission
    party: Party  # makes the diagnoser

    @property
    def digest(self) -> str:
        """SHA-256 of the target and of all files, their names and contents."""
        return digest_of(self.target, self.files)


@dataclass(frozen=True)
class CopiedClass:
    """A class in a file of a folder that holds nothing but the submission."""

    target: str
    folder: Path

    @property
    def party(self) -> ThirdParty:
        """The place of the class."""
        return ThirdParty(str(self.folder / self.target))

    @property
    def name(self) -> str:
        """Its name."""
        self._enter()
        return self.party.name

    @property
    def source(self) -> Path:
        """The file with the class."""
        return self.folder / self.target.rpartition(":")[0]

    def __call__(self) -> Diagnoser:
        """A diagnoser; the process moves into the folder, whose modules can be imported."""
        self._enter()
        return self.party()

    def _enter(self) -> None:
        os.chdir(self.folder)
        if str(self.folder) not in sys.path:
            sys.path.insert(0, str(self.folder))


@dataclass(frozen=True)
class CopiedNetwork:
    """A network in a file of a folder that holds nothing else."""

    target: str
    folder: Path

    @property
    def name(self) -> str:
        """That of the file, without its ending."""
        return ThirdParty(self.target).checked_name(self.source.stem)

    @property
    def source(self) -> Path:
        """The file."""
        return self.folder / self.target

    def __call__(self) -> Diagnoser:
        """A diagnoser."""
        os.chdir(self.folder)
        return OnnxNetwork(self.source)


def digest_of(target: str, files: Mapping[str, str]) -> str:
    """SHA-256 of a target and of its files, which are given as SHA-256 by name."""
    content = json.dumps([target, sorted(files.items())])
    return hashlib.sha256(content.encode()).hexdigest()


def submission_of(target: str, further: Iterable[Path], folder: Path) -> Submission:
    """The submission of a target.

    Parameters
    ----------
    target
        A class in a file or in a module that can be imported, or an ONNX network, as `FORMS`.
    further
        Files that the file of the target needs, from its folder or below.
    folder
        An empty one, which receives a copy of all files: what is not named is not there. The
        package of a module is not copied, and all of its files are taken as named.

    Raises
    ------
    InputError
        Where a file cannot be read or lies elsewhere, or the target is none.
    """
    place, _, class_name = target.rpartition(":")
    if target.endswith(ONNX):
        source = Path(target)
        shown = source.name
    elif place.endswith(".py"):
        source = Path(place)
        check_names_a_class("submission", target, FORMS)
        shown = f"{source.name}:{class_name}"
    else:
        return _of_module(target, place, further)
    files = {}
    for path in [source, *further]:
        name = _name_within(source.parent, path)
        files[name] = _copied(path, folder / name)
    is_network = target.endswith(ONNX)
    party = CopiedNetwork(shown, folder) if is_network else CopiedClass(shown, folder)
    return Submission(shown, files, party)


def _of_module(target: str, module: str, further: Iterable[Path]) -> Submission:
    check_names_a_class("submission", target, FORMS)
    package = module.partition(".")[0]
    try:
        spec = importlib.util.find_spec(package) if package else None
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        remedy = "check the name of the module, and the folder"
        raise refusal("submission", target, f"what can be imported, {FORMS}", remedy)
    beside = list(further)
    if beside:
        remedy = "leave them out: all files of a module's package belong to it"
        raise refusal("files", str(beside[0]), "files beside a FILE.py", remedy)
    if spec.submodule_search_locations:
        roots = [Path(folder) for folder in spec.submodule_search_locations]
        paths = {
            f"{package}/{path.relative_to(root).as_posix()}": path
            for root in roots
            for path in root.rglob("*")
            if path.is_file() and NOT_SOURCE not in path.parts
        }
    else:
        origin = Path(spec.origin or module)
        paths = {origin.name: origin}
    files = {name: _sha(path) for name, path in sorted(paths.items())}
    return Submission(target, files, ThirdParty(target))


def _name_within(folder: Path, path: Path) -> str:
    """The path of a file from the folder on; one that lies elsewhere is refused."""
    absolute = Path(os.path.abspath(path))
    root = Path(os.path.abspath(folder))
    if not absolute.is_relative_to(root):
        remedy = "move it there"
        raise refusal("files", str(path), f"files in {root} or below", remedy)
    return absolute.relative_to(root).as_posix()


def _copied(path: Path, copy: Path) -> str:
    """SHA-256 of a file, once it is copied."""
    _require_file(path)
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    except OSError as error:
        raise _unreadable(path, error) from None
    return _sha(copy)


def _sha(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise _unreadable(path, error) from None


def _require_file(path: Path) -> None:
    try:
        is_file = path.is_file()
    except (OSError, ValueError):  # ValueError for a path with a null
        is_file = False
    if not is_file:
        raise refusal("submission", str(path), f"a file: {FORMS}", "check the path")


def _unreadable(path: Path, error: OSError) -> Exception:
    allowed = f"a file that can be read ({error.strerror or error})"
    return refusal("submission", str(path), allowed, "check the path")
