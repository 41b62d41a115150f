"""The disk cache of compiled code: used when nothing has changed, and never after an edit."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from auv_fault_env import compiling

PACKAGE = Path(compiling.__file__).parent
SCRIPT = """
from auv_fault_env.physics import Motion, Motor, advance
side = Motor(1000.0, 50.0, 6.0, 0.2, 5e-6)
print(repr(tuple(advance(Motion(0.3, 20.0, 0.0, 0.0, 0.0), -0.08, 0.0, side, side))))
"""


def run(folder):
    """What `advance` gives in a fresh process that imports the package from `folder`."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT]
    return subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True).stdout


def cached(folder):
    return {path.relative_to(folder) for path in folder.rglob("*.nb[ci]")}


def edit(path, old, new):
    """Replace text by text of the same length and give the file its old time back."""
    text, stat = path.read_text(encoding="utf-8"), path.stat()
    assert text.count(old) == 1 and len(old) == len(new)
    path.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


@pytest.mark.slow
def test_cache_is_used_until_a_compiled_file_is_edited(tmp_path):
    package = tmp_path / "auv_fault_env"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    first = run(tmp_path)
    files = cached(tmp_path)
    assert files
    assert run(tmp_path) == first and cached(tmp_path) == files
    edit(package / "physics.py", "RPM = 30.0 / math.pi", "RPM = 20.0 / math.pi")
    assert run(tmp_path) == first and cached(tmp_path) > files  # compiled anew; `advance` itself does not use RPM
    edit(package / "parameters.py", "SAMPLE_RATE = 10.0", "SAMPLE_RATE = 20.0")
    assert run(tmp_path) != first
    edit(package / "parameters.py", "SAMPLE_RATE = 20.0", "SAMPLE_RATE = 10.0")
    edit(package / "physics.py", "135135.0 + x", "135136.0 + x")
    assert run(tmp_path) != first


def imported(name):
    """Modules of this package that a module imports."""
    tree = ast.parse((PACKAGE / f"{name}.py").read_text(encoding="utf-8"))
    froms = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    return {module.removeprefix("auv_fault_env.") for module in froms if module.startswith("auv_fault_env.")}


def test_digest_covers_every_file_that_ends_up_in_compiled_code():
    decorated = {path.stem for path in PACKAGE.glob("*.py") if {"compiling"} & imported(path.stem)}
    needed = decorated | {"compiling"} | {module for name in decorated for module in imported(name)}
    assert needed - {"errors"} <= set(compiling.COMPILED)
