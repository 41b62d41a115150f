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
COMPILED = [
    path
    for package in (PACKAGE, *(PACKAGE.parent / name for name in ("diagnosers", "training")))
    for path in sorted(package.glob("*.py"))
    if "auv_fault_env.compiling" in path.read_text(encoding="utf-8")
]
SCRIPT = """
from auv_fault_env.physics import Motion, Motor, advance
from mine.loop import total
side = Motor(1000.0, 50.0, 6.0, 0.2, 5e-6)
print(repr(tuple(advance(Motion(0.3, 20.0, 0.0, 0.0, 0.0), -0.08, 0.0, side, side))))
print(total(3))
"""
MINE = {  # another package, of whose files only the first is watched by numba itself
    "__init__": "",
    "loop": """
from auv_fault_env.compiling import kernel
from mine.part import term

@kernel
def total(n):
    sum = 0.0
    for i in range(n):
        sum += term(i)
    return sum
""",
    "part": """
from auv_fault_env.compiling import scalar
from mine import (
    sizes,
)

@scalar
def term(i):
    return sizes.FACTOR * i
""",
    "sizes": "FACTOR = 2.0\n",
}


def run(folder):
    """What a kernel of each package gives in a fresh process that imports them from `folder`."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT]
    printed = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True).stdout
    return printed.splitlines()


def cached(folder):
    return {path.relative_to(folder) for path in folder.rglob("*.nb[ci]")}


def edit(path, old, new):
    """Replace text by text of the same length and give the file its old time back."""
    text, stat = path.read_text(encoding="utf-8"), path.stat()
    assert text.count(old) == 1 and len(old) == len(new)
    path.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


@pytest.fixture
def project(tmp_path):
    """This package, and `MINE` beside it."""
    shutil.copytree(PACKAGE, tmp_path / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "mine").mkdir()
    for name, text in MINE.items():
        (tmp_path / "mine" / f"{name}.py").write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_cache_is_used_until_a_compiled_file_is_edited(project):
    package = project / PACKAGE.name
    first = run(project)
    files = cached(project)
    assert files
    assert run(project) == first and cached(project) == files
    edit(package / "physics.py", "RPM = 30.0 / math.pi", "RPM = 20.0 / math.pi")
    assert run(project) == first and cached(project) > files  # compiled anew; `advance` itself does not use RPM
    edit(package / "parameters.py", "SAMPLE_RATE = 10.0", "SAMPLE_RATE = 20.0")
    assert run(project)[0] != first[0]
    edit(package / "parameters.py", "SAMPLE_RATE = 20.0", "SAMPLE_RATE = 10.0")
    edit(package / "physics.py", "135135.0 + x", "135136.0 + x")
    assert run(project)[0] != first[0]


@pytest.mark.slow
def test_cache_of_another_package_notices_edits_in_its_own_files_alone(project):
    physics, total = run(project)
    files = cached(project)
    edit(project / "mine" / "part.py", "FACTOR * i", "FACTOR + i")
    assert run(project) == [physics, "9.0"] and total == "6.0"
    edit(project / "mine" / "sizes.py", "FACTOR = 2.0", "FACTOR = 3.0")
    assert run(project) == [physics, "12.0"]
    assert all("loop" in path.name for path in cached(project) - files)


def imported(path):
    """Files of the project whose names a file imports, by its syntax tree."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in tree.body:
        assert not (isinstance(node, ast.Import) and node.names[0].name.startswith(("auv_fault_env", "diagnosers")))
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            found |= {PACKAGE.parent / f"{module.replace('.', '/')}.py" for module in modules}
    return {file for file in found if file.is_file()}


@pytest.mark.parametrize("path", COMPILED, ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_digest_follows_every_import_of_a_file_that_is_compiled(path):
    assert compiling.imported(path) == imported(path)
    assert PACKAGE / "compiling.py" in compiling.imported(path)


@pytest.mark.parametrize(
    ("asked", "threads"), [(None, 3), ("", 3), ("1", 1), ("2", 2), ("8", 3), ("0", 3), ("many", 3)]
)
def test_threads_are_the_cores_or_as_many_as_the_environment_allows(monkeypatch, asked, threads):
    monkeypatch.setattr(compiling.os, "sched_getaffinity", lambda process: {0, 1, 2}, raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if asked is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert compiling.n_threads() == threads
