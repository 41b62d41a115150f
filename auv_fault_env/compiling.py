"""How this package compiles: two decorators, and a disk cache that notices edits in every compiled file.

numba's own disk cache watches only the file of the cached function, not those it calls. Here the cache folder is named
after a digest of all files that end up in compiled code, so an edit in any of them compiles anew.
"""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

from numba import config, njit

COMPILED = ("compiling", "errors", "channels", "parameters", "noise", "physics", "layout", "lanes", "episodes")
OPTIONS = dict(error_model="numpy", fastmath={"contract"}, nogil=True)

scalar = njit(forceinline=True, **OPTIONS)


def digest() -> str:
    """Digest of the source of all compiled files."""
    folder = Path(__file__).parent
    return hashlib.sha256(b"".join((folder / f"{name}.py").read_bytes() for name in COMPILED)).hexdigest()[:16]


def cache_folder() -> Path:
    """Where compiled code is kept: in NUMBA_CACHE_DIR, this package or the user's cache, the first that is writable."""
    bases = [config.CACHE_DIR] if config.CACHE_DIR else []
    bases += [Path(__file__).parent / "__pycache__", "~/.cache/auv_fault_env"]
    for base in bases:
        with contextlib.suppress(OSError, RuntimeError):  # the latter where there is no home
            folder = Path(base).expanduser() / digest()
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    return Path(tempfile.mkdtemp(prefix="auv_fault_env_"))


FOLDER = cache_folder()


def kernel(function):
    """Compile a loop over lanes and keep it on disk."""
    outer, config.CACHE_DIR = config.CACHE_DIR, str(FOLDER)
    try:
        return njit(cache=True, **OPTIONS)(function)
    finally:
        config.CACHE_DIR = outer
