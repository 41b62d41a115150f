"""The disk cache of compiled code: used when nothing has changed, and never after an edit."""

import ast
import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

from auv_fault_env import compiling

PACKAGE = Path(compiling.__file__).parent
ROOTS = (PACKAGE, *(PACKAGE.parent / name for name in ("diagnosers", "training")))
MODULES = [path for root in ROOTS for path in sorted(root.rglob("*.py"))]
SCRIPT = """
import numpy as np
from auv_fault_env import layout
from auv_fault_env.integration import advance_motions
from mine.loop import total
scratch = np.zeros((layout.N_INTEGRATION, layout.LANES))
scratch[: layout.START + 2, 0] = 0.3, 20.0
for motor in layout.PORT_MOTOR, layout.STARBOARD_MOTOR:
    scratch[motor : motor + 5, 0] = 1000.0, 50.0, 6.0, 0.2, 5e-6
scratch[layout.DRAG, 0] = -0.08
advance_motions(scratch.ravel(), 1)
print(scratch[layout.MOTION : layout.MISFIT, 0].tolist())
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
    """What a kernel of each package gives in a fresh process that imports them from `folder`.

    The home directory is the folder above, so that the user's cache is there.
    """
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {
        "HOME": str(folder.parent),
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT]
    printed = subprocess.run(
        command, cwd=folder, env=environment, check=True, capture_output=True, text=True
    ).stdout
    return printed.splitlines()


def cached(folder):
    return set((folder.parent / ".cache").rglob("*.nb[ci]"))


def edit(path, old, new):
    """Replace text by text of the same length and give the file its old time back."""
    text = path.read_text(encoding="utf-8")
    stat = path.stat()
    assert text.count(old) == 1 and len(old) == len(new)
    path.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


@pytest.fixture
def project(tmp_path):
    """This package, and `MINE` beside it."""
    folder = tmp_path / "project"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / PACKAGE.name, ignore=ignored)
    (folder / "mine").mkdir()
    for name, text in MINE.items():
        (folder / "mine" / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.slow
def test_cache_is_used_until_a_compiled_file_is_edited(project):
    package = project / PACKAGE.name
    first = run(project)
    files = cached(project)
    assert files
    assert run(project) == first and cached(project) == files
    edit(package / "physics.py", "RPM = 30.0 / math.pi", "RPM = 20.0 / math.pi")
    # compiled anew; `advance_motions` itself does not use RPM
    assert run(project) == first and cached(project) > files
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


@pytest.mark.slow
def test_a_clone_uses_what_another_has_compiled(project):
    first = run(project)
    files = cached(project)
    clone = project.with_name("clone")
    shutil.copytree(project, clone)
    for path in clone.rglob("*.py"):
        os.utime(path)
    times = {path: path.stat().st_mtime_ns for path in files}
    assert run(clone) == first
    assert {path: path.stat().st_mtime_ns for path in cached(clone)} == times


def test_packages_of_others_in_the_same_folder_are_not_in_the_digest(tmp_path):
    for name in ("mine", "theirs", "auv_fault_env"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("import auv_fault_env, theirs, mine.loop\n")
    loop = tmp_path / "mine" / "loop.py"
    loop.write_text("import auv_fault_env, theirs\n")
    assert compiling.imported(loop) == {tmp_path / "auv_fault_env" / "__init__.py"}


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_cache_is_compiled_again(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr(compiling.config, "CACHE_DIR", str(tmp_path))
    file = tmp_path / "damaged.py"
    text = (
        "from auv_fault_env.compiling import kernel\n\n@kernel\ndef double(x):\n    return 2 * x\n"
    )
    file.write_text(f"# {suffix}\n{text}", encoding="utf-8")

    def hits():
        """Of the cache, by a kernel as of a new process."""
        spec = importlib.util.spec_from_file_location("damaged", file)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.double(3.0) == 6.0
        return sum(module.double.stats.cache_hits.values())

    assert [hits(), hits()] == [0, 1]
    for share in (0.0, 0.5):
        (path,) = tmp_path.rglob(f"*.{suffix}")
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
        assert [hits(), hits()] == [0, 1]


def test_a_disk_without_room_for_the_cache_is_no_error(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiling.FunctionCache, "_save_overload", full)
    monkeypatch.setattr(compiling.config, "CACHE_DIR", str(tmp_path))
    double = compiling.kernel(lambda x: 2.0 * x)
    assert double(3.0) == 6.0


def module_name(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path):
    """Files of the project whose names a file imports, as Python's import system finds them."""
    package = (
        module_name(path)
        if path.name == "__init__.py"
        else module_name(path.parent / "__init__.py")
    )
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {file_of(alias.name) for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            module = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            found |= {file_of(f"{module}.{alias.name}") or file_of(module) for alias in node.names}
    return found - {None}


def file_of(module):
    """The file of a module of the project, None for others."""
    if module.split(".")[0] not in {root.name for root in ROOTS}:
        return None
    try:
        return Path(importlib.util.find_spec(module).origin)
    except (AttributeError, ModuleNotFoundError):
        return None


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_imports_of_every_file_are_found_as_python_finds_them(path):
    assert compiling.imported(path) == imported(path)


def compiled(module):
    """The compiled functions that a module defines."""
    found = (value for value in vars(module).values() if isinstance(value, Dispatcher))
    return [one for one in found if one.py_func.__module__ == module.__name__]


def reached(function, seen):
    """Files that define what a compiled function uses: other compiled functions, classes and
    modules.
    """
    names = function.py_func.__code__.co_names
    for value in map(function.py_func.__globals__.get, names):
        if isinstance(value, Dispatcher) and value not in seen:
            seen.add(value)
            yield Path(value.py_func.__code__.co_filename)
            yield from reached(value, seen)
        elif isinstance(value, type | ModuleType):
            owner = value if isinstance(value, ModuleType) else sys.modules[value.__module__]
            file = getattr(owner, "__file__", None)
            if file is not None and any(root in Path(file).parents for root in ROOTS):
                yield Path(file)


@pytest.mark.parametrize(
    "path", [path for path in MODULES if "@kernel" in path.read_text()], ids=module_name
)
def test_digest_of_every_kernel_covers_all_files_that_it_depends_on(path):
    functions = compiled(importlib.import_module(module_name(path)))
    assert functions
    for function in functions:
        assert set(reached(function, set())) <= compiling.sources(path)


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ("import mine.deep.sizes", "deep/sizes"),
        ("import mine.deep.sizes as sizes", "deep/sizes"),
        ("from mine.deep.sizes import FACTOR", "deep/sizes"),
        ("from mine.deep import sizes", "deep/sizes"),
        ("from mine.deep import (\n    sizes,\n)", "deep/sizes"),
        ("from mine.deep import NAME", "deep/__init__"),
        ("from mine import deep", "deep/__init__"),
        ("from . import sizes", "deep/sizes"),
        ("from .sizes import FACTOR", "deep/sizes"),
        ("from .. import part", "part"),
        ("from ..deep.sizes import FACTOR", "deep/sizes"),
        ("from ..deep import sizes", "deep/sizes"),
        ("if True:\n    from .sizes import FACTOR", "deep/sizes"),
        ("def late():\n    import mine.part", "part"),
    ],
)
def test_digest_follows_imports_of_every_form_at_any_depth(tmp_path, statement, expected):
    for name in ("__init__", "part", "deep/__init__", "deep/sizes"):
        file = tmp_path / "mine" / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("", encoding="utf-8")
    loop = tmp_path / "mine" / "deep" / "loop.py"
    loop.write_text(f"import math\nfrom numba import njit\n{statement}\n", encoding="utf-8")
    assert compiling.imported(loop) == {tmp_path / "mine" / f"{expected}.py"}


@pytest.mark.parametrize(
    ("asked", "threads"), [(None, 3), ("", 3), ("1", 1), ("2", 2), ("8", 3), ("0", 3), ("many", 3)]
)
def test_threads_are_the_cores_or_as_many_as_the_environment_allows(monkeypatch, asked, threads):
    monkeypatch.setattr(compiling.os, "sched_getaffinity", lambda process: {0, 1, 2}, raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if asked is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert compiling.n_threads() == threads
