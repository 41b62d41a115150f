"""Decorators that compile, and a disk cache that notices edits in every compiled file.

The cache folder is named by a digest of the kernel's file and of every file of its project that it
imports, because numba itself notices edits of the kernel's own file alone. The path of the files is
not in the name, so that all clones and installations of a user share what one has compiled.

What a kernel calls is a part of it (`parts`): compiled with it, from its source, whether the other
function is a kernel too or not.
"""

import ast
import atexit
import contextlib
import hashlib
import logging
import os
import shutil
import tempfile
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

from numba import config, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.extending import intrinsic

from auv_fault_env.parts import CompiledFunction

OPTIONS = dict(nopython=True, error_model="numpy", fastmath={"contract"}, nogil=True)
LOGGER = logging.getLogger("auv_fault_env")
OWN_PACKAGES = frozenset({"auv_fault_env", "diagnosers", "training"})


def scalar(function):
    """Compile arithmetic of single numbers, inlined wherever a compiled function calls it."""
    return CompiledFunction(function, targetoptions=OPTIONS | {"forceinline": True})


def part(function):
    """Compile loops that kernels call; a kernel has one copy, however often it calls them."""
    return CompiledFunction(function, targetoptions=dict(OPTIONS))


@intrinsic
def fused(typing, factor, other_factor, summand):
    """``factor * other_factor + summand``, rounded once.

    In a sum of two products the compiler may fuse either, differently in the parts of a loop.
    """
    signature = types.float64(types.float64, types.float64, types.float64)
    return signature, lambda context, builder, _, numbers: builder.fma(*numbers)


@cache
def imported(file: Path) -> frozenset[Path]:
    """The files that a file imports from its project: its outermost package and ours beside it."""
    package = file
    while (package.parent / "__init__.py").is_file():
        package = package.parent
    project = package.parent
    followed = {project / name for name in OWN_PACKAGES | {package.name}}
    tree = ast.parse(file.read_bytes(), file)
    targets = {path for node in ast.walk(tree) for path in _targets(node, file.parent, project)}
    return frozenset(path for path in targets if followed & {path, *path.parents})


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

    In the first that can be written of NUMBA_CACHE_DIR, the user's cache, this package, a temporary
    folder.
    """
    bases = [config.CACHE_DIR] if config.CACHE_DIR else []
    bases += ["~/.cache/auv_fault_env", Path(__file__).parent / "__pycache__"]
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


class LocatorByName(UserProvidedCacheLocator):
    """Places the code of a file in a folder with the file's name, wherever the file is."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file):
        """The folder within numba's cache folder, which here has the digest as its name."""
        return Path(py_file).stem


class SharedCacheImpl(CompileResultCacheImpl):
    """Compiled code whose place does not depend on the path of its source."""

    _locator_classes = [LocatorByName]


class SharedCache(FunctionCache):
    """A cache on disk whose damaged files are replaced; a disk that is full is not an error.

    Where it has nothing, a warning is logged with the `notice`, if any.
    """

    _impl_class = SharedCacheImpl

    def __init__(self, function, notice):
        super().__init__(function)
        self.notice = notice

    def load_overload(self, signature, target_context):
        """The compiled code; None where there is none that can be read."""
        compiled = None
        try:
            compiled = super().load_overload(signature, target_context)
        # whatever unpickling the half of a file raises
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()
        if compiled is None and self.notice:
            LOGGER.warning("compiling %s, once for this version", self.notice)
        return compiled

    def save_overload(self, signature, compiled):
        """Write the compiled code if there is room."""
        with contextlib.suppress(OSError):
            super().save_overload(signature, compiled)


def kernel(function=None, *, notice=""):
    """Compile a loop over lanes and cache it on disk.

    `notice` says what is compiled and about how long that takes, where it takes seconds.
    """
    if function is None:
        return partial(kernel, notice=notice)
    folder = cache_folder(digest(Path(function.__code__.co_filename).resolve()))
    cache_before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        dispatcher = CompiledFunction(function, targetoptions=dict(OPTIONS))
        # as its method enable_caching does
        dispatcher._cache = SharedCache(function, notice)
        return dispatcher
    finally:
        config.CACHE_DIR = cache_before
