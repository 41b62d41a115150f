"""How the project compiles: three decorators, and a disk cache that notices edits in every compiled file.

numba's own disk cache watches only the file of the cached function, not those it calls. Here the
cache folder is named after a digest of that file and of every file of its project that it imports,
so an edit in any of them compiles anew.

A kernel that calls another gets one of two copies of it: the one compiled by itself, in the process
that compiles both, or the one compiled along with the caller, in those that load it from disk. They
may fuse multiplications and additions differently, and so differ in the last bits. A kernel that
calls only what is inlined gives the same always.
"""

import ast
import atexit
import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from numba import config, njit, types
from numba.extending import intrinsic

OPTIONS = dict(error_model="numpy", fastmath={"contract"}, nogil=True)

# loops that belong to a kernel; arithmetic of single numbers
inlined = scalar = njit(forceinline=True, **OPTIONS)


@intrinsic
def fused(typing, one, other, more):
    """``one * other + more``, rounded once.

    Of a sum of two products the compiler may fuse either, and chooses differently for the vectors
    of a loop and for what is left over. Told which, it has no choice.
    """
    signature = types.float64(types.float64, types.float64, types.float64)
    return signature, lambda context, builder, _, numbers: builder.fma(*numbers)


@cache
def imported(file: Path) -> frozenset[Path]:
    """The files of the same project whose names a file imports.

    A project is the folder that holds the outermost package of the file, with all packages beside
    it.
    """
    project = file.parent
    while (project / "__init__.py").is_file():
        project = project.parent
    tree = ast.parse(file.read_bytes(), file)
    return frozenset(
        path for node in ast.walk(tree) for path in _targets(node, file.parent, project)
    )


def _targets(node: ast.AST, folder: Path, project: Path) -> Iterator[Path]:
    """The files that an import statement in a file of `folder` names; a name inside a package may be a module of it."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield from _module(project.joinpath(*alias.name.split(".")))
    elif isinstance(node, ast.ImportFrom):
        start = [folder, *folder.parents][node.level - 1] if node.level else project
        module = start.joinpath(*(node.module or "").split("."))
        for alias in node.names:
            yield from _module(module / alias.name) or _module(module)


def _module(path: Path) -> list[Path]:
    """The file of the module or package at `path`, which has no suffix; none where the project has no such module."""
    return [
        file for file in (path.with_name(f"{path.name}.py"), path / "__init__.py") if file.is_file()
    ]


@cache
def sources(file: Path) -> frozenset[Path]:
    """A file and all files of its project that it imports, directly or not."""
    found: frozenset[Path] = frozenset()
    new = frozenset({file})
    while new:
        found |= new
        new = frozenset().union(*map(imported, new)) - found
    return found


@cache
def digest(file: Path) -> str:
    """Digest of the text of a file and of all that it imports, directly or not."""
    text = b"".join(path.read_bytes() for path in sorted(sources(file)))
    return hashlib.sha256(text).hexdigest()[:16]


@cache
def cache_folder(name: str) -> Path:
    """Where compiled code is kept: in NUMBA_CACHE_DIR, this package or the user's cache, the first that is writable."""
    bases = [config.CACHE_DIR] if config.CACHE_DIR else []
    bases += [Path(__file__).parent / "__pycache__", "~/.cache/auv_fault_env"]
    for base in bases:
        # the latter where nobody knows the home directory
        with contextlib.suppress(OSError, RuntimeError):
            folder = Path(base).expanduser() / name
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    folder = Path(tempfile.mkdtemp(prefix="auv_fault_env_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def n_threads() -> int:
    """Threads that share the lanes of a large batch: the cores of this process, or OMP_NUM_THREADS if that is fewer."""
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(asked)) if asked.isdigit() and int(asked) else cores


def kernel(function):
    """Compile a loop over lanes and keep it on disk."""
    folder = cache_folder(digest(Path(function.__code__.co_filename).resolve()))
    outer = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        return njit(cache=True, **OPTIONS)(function)
    finally:
        config.CACHE_DIR = outer
