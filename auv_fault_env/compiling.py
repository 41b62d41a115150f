"""Decorators that compile, and a disk cache that notices edits in every compiled file.

The cache folder is named by a digest of the kernel's file and of every file of its project that it
imports, because numba itself notices edits of the kernel's own file alone.

A kernel that calls another kernel uses one of two copies of it: in the process that compiles both
the one compiled by itself, in later processes the one compiled with the caller. The copies may fuse
multiplications and additions differently. A kernel that calls only inlined functions always gives
the same.
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
from numba.core.caching import FunctionCache
from numba.extending import intrinsic

OPTIONS = dict(error_model="numpy", fastmath={"contract"}, nogil=True)

# `inlined` for loops that belong to a kernel, `scalar` for arithmetic of single numbers
inlined = scalar = njit(forceinline=True, **OPTIONS)


@intrinsic
def fused(typing, factor, other_factor, summand):
    """``factor * other_factor + summand``, rounded once.

    In a sum of two products the compiler may fuse either, differently in the parts of a loop.
    """
    signature = types.float64(types.float64, types.float64, types.float64)
    return signature, lambda context, builder, _, numbers: builder.fma(*numbers)


@cache
def imported(file: Path) -> frozenset[Path]:
    """The files that a file imports from its project, the folder of its outermost package."""
    project = file.parent
    while (project / "__init__.py").is_file():
        project = project.parent
    tree = ast.parse(file.read_bytes(), file)
    return frozenset(
        path for node in ast.walk(tree) for path in _targets(node, file.parent, project)
    )


def _targets(node: ast.AST, folder: Path, project: Path) -> Iterator[Path]:
    """The files that an import statement in a file of `folder` names."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield from _module(project.joinpath(*alias.name.split(".")))
    elif isinstance(node, ast.ImportFrom):
        start = [folder, *folder.parents][node.level - 1] if node.level else project
        module = start.joinpath(*(node.module or "").split("."))
        for alias in node.names:
            yield from _module(module / alias.name) or _module(module)


def _module(path: Path) -> list[Path]:
    """The file of the module or package at `path`, which has no suffix; empty if there is none."""
    candidates = (path.with_name(f"{path.name}.py"), path / "__init__.py")
    return [file for file in candidates if file.is_file()]


@cache
def sources(file: Path) -> frozenset[Path]:
    """A file and all files of its project that it imports, directly or not."""
    reached: frozenset[Path] = frozenset()
    new = frozenset({file})
    while new:
        reached |= new
        new = frozenset().union(*map(imported, new)) - reached
    return reached


@cache
def digest(file: Path) -> str:
    """Digest of the text of all `sources` of a file."""
    text = b"".join(path.read_bytes() for path in sorted(sources(file)))
    return hashlib.sha256(text).hexdigest()[:16]


@cache
def cache_folder(name: str) -> Path:
    """A folder for compiled code.

    In the first that can be written of NUMBA_CACHE_DIR, this package, the user's cache, a temporary
    folder.
    """
    bases = [config.CACHE_DIR] if config.CACHE_DIR else []
    bases += [Path(__file__).parent / "__pycache__", "~/.cache/auv_fault_env"]
    for base in bases:
        # RuntimeError where there is no home directory
        with contextlib.suppress(OSError, RuntimeError):
            folder = Path(base).expanduser() / name
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    folder = Path(tempfile.mkdtemp(prefix="auv_fault_env_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def n_threads() -> int:
    """Threads for a large batch: the cores of this process, at most OMP_NUM_THREADS."""
    cores = os.cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    limit = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(limit)) if limit.isdigit() and int(limit) else cores


class MendedCache(FunctionCache):
    """A cache on disk whose damaged files are replaced; a disk that is full is not an error."""

    def load_overload(self, signature, target_context):
        """The compiled code; None where there is none that can be read."""
        try:
            return super().load_overload(signature, target_context)
        # whatever unpickling the half of a file raises
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, signature, compiled):
        """Write the compiled code if there is room."""
        with contextlib.suppress(OSError):
            super().save_overload(signature, compiled)


def kernel(function):
    """Compile a loop over lanes and cache it on disk."""
    folder = cache_folder(digest(Path(function.__code__.co_filename).resolve()))
    cache_before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        dispatcher = njit(**OPTIONS)(function)
        # as its method enable_caching does
        dispatcher._cache = MendedCache(function)
        return dispatcher
    finally:
        config.CACHE_DIR = cache_before
