"""What is shipped: the wheel with its data, the container, the citation and the hooks."""

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

from training.arguments import COMMANDS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("auv_fault_env", "diagnosers", "training")
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
LOAD_ALL_DATA = """
import diagnosers
from training.benchmark.suites import load
from training.known_names import SUITES
from training.stimuli import STIMULI

for name in diagnosers.NAMES:
    diagnosers.make(name).reset(1)
for stimulus in STIMULI.values():
    stimulus().policy_digest
for suite in SUITES:
    load(suite)
print(diagnosers.__file__)
"""


def run(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built as `make dist` builds it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    return next(folder.glob("*.whl"))


def test_the_wheel_has_every_file_of_the_packages_and_nothing_else(wheel):
    files = [path for name in PACKAGES for path in (ROOT / name).rglob("*") if path.is_file()]
    sources = {path.relative_to(ROOT).as_posix() for path in files if path.suffix != ".pyc"}
    assert {f"{name}/py.typed" for name in PACKAGES} <= sources
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert packed == sources


@pytest.fixture(scope="module")
def installation(wheel, tmp_path_factory):
    """The wheel in a fresh environment, beside the libraries of this one; its scripts."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder)
    site = Path(sysconfig.get_path("purelib", "venv", {"base": folder}))
    # a path in a .pth file adds the libraries, but not this project, which a .pth of theirs adds
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib"))
    pip = (sys.executable, "-m", "pip", "--python", folder)
    run(*pip, "install", "-q", "--no-deps", "--no-index", wheel)
    return Path(sysconfig.get_path("scripts", "venv", {"base": folder}))


@pytest.fixture
def outside(tmp_path):
    """Options of a process that has neither this project's folder nor its path."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return {"cwd": tmp_path, "env": environment}


@pytest.mark.slow
def test_the_wheel_loads_all_its_weights_policies_and_suites(installation, outside):
    place = run(installation / "python", "-c", LOAD_ALL_DATA, **outside)
    assert Path(place.strip()).is_relative_to(installation.parent)


@pytest.mark.slow
def test_the_command_of_the_wheel_writes_a_report(installation, outside):
    command = installation / "auv-fault"
    assert run(command, "--version", **outside) == f"auv-fault {PROJECT['version']}\n"
    run(command, "simulate", "--vehicles", "1", "--duration", "1", **outside)
    assert (outside["cwd"] / "runs" / "simulate" / "index.html").is_file()


def test_the_container_has_what_the_installation_needs():
    copied = [line.split()[1:-1] for line in re.findall(r"^COPY .*", DOCKERFILE, re.MULTILINE)]
    sources = {name for names in copied for name in names}
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert sources == {line[1:] for line in ignored if line.startswith("!")}
    assert all((ROOT / name).exists() for name in sources)
    needed = {PROJECT["readme"], *PROJECT["license-files"], *PACKAGES, "pyproject.toml"}
    assert needed <= sources


def test_the_container_runs_commands_of_auv_fault():
    entry = json.loads(re.search(r"^ENTRYPOINT (.*)", DOCKERFILE, re.MULTILINE)[1])
    default = json.loads(re.search(r"^CMD (.*)", DOCKERFILE, re.MULTILINE)[1])
    examples = re.findall(r"docker run .* auv-fault (\w+)", DOCKERFILE)
    assert entry == list(PROJECT["scripts"])
    assert default[0] in COMMANDS
    assert set(examples) == {"watch", "diagnose"}


def test_the_container_compiles_before_its_first_start():
    cache = re.search(r"^ENV NUMBA_CACHE_DIR=(.*)", DOCKERFILE, re.MULTILINE)[1]
    code = re.search(r'^RUN python -c "(.*)" ', DOCKERFILE, re.MULTILINE)[1]
    exec(code, {})
    assert f"chmod -R a+rwX {cache}\n" in DOCKERFILE


def test_the_citation_is_that_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= citation.keys()
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_the_hooks_are_the_linters_of_make_lint():
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    hooks = [hook for repository in config["repos"] for hook in repository["hooks"]]
    assert {repository["repo"] for repository in config["repos"]} == {"local"}
    assert [hook["entry"].split()[:2] for hook in hooks] == [
        [".venv/bin/ruff", "check"],
        [".venv/bin/ruff", "format"],
    ]
