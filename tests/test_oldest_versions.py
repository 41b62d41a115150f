"""The oldest versions of packages: constraints-oldest.txt has the lower bounds, which work.

`make oldest` runs this file with these versions, the whole suite with those of constraints.txt.
"""

import importlib.util
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.version import Version

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import PRESETS
from training.field.vehicle_file import Column, VehicleFile, write_vehicle

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# where the module has not the name of its package
MODULES = {
    "import-linter": "importlinter",
    "PyYAML": "yaml",
    "pytest-xdist": "xdist",
    "scikit-learn": "sklearn",
}
COMMAND = "-m", "training.cli"
FAULT = {"fault": "propeller_loss:port", "onset": 10.0, "severity": 1.0}


def requirements():
    """Lower bound by package of everything that pyproject.toml names."""
    project = PROJECT["project"]
    named = [*PROJECT["build-system"]["requires"], *project["dependencies"]]
    for extra in project["optional-dependencies"].values():
        named += extra
    bounds = {}
    for text in named:
        if not text.startswith(project["name"]):
            name, bound = re.fullmatch(r"([\w.-]+)>=([\d.]+)", text).groups()
            bounds[name] = Version(bound)
    return bounds


def pins(file):
    """Version by package in a file of constraints."""
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    named = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonical(name): Version(version) for name, version in named}


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def test_the_oldest_versions_are_the_lower_bounds():
    bounds = requirements()
    oldest = pins("constraints-oldest.txt")
    # of torch there is a CPU build of this version only
    assert oldest["torch"] == pins("constraints.txt")["torch"] >= bounds.pop("torch")
    assert {name: oldest[canonical(name)] for name in bounds} == bounds


def run(folder, *arguments, code=0):
    """A process of its own, in which warnings of old packages are not errors."""
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done.stdout


def test_packages_import_beside_each_other(tmp_path):
    names = [MODULES.get(name, name.replace("-", "_")) for name in requirements()]
    # what builds the package is not installed beside it
    present = [name for name in names if importlib.util.find_spec(name)]
    assert {"numpy", "matplotlib", "pyarrow", "torch", "stable_baselines3"} <= set(present)
    run(tmp_path, "-c", f"import {', '.join(present)}")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log of a vehicle that loses a propeller, by `auv-fault simulate`."""
    folder = tmp_path_factory.mktemp("oldest")
    (folder / "fault.json").write_text(json.dumps([FAULT]))
    options = "--vehicles", "1", "--duration", "30", "--mission", "thesis"
    run(folder, *COMMAND, "simulate", *options, "--schedule", "fault.json", "--output", "run")
    return folder / "run" / "episodes.parquet"


def test_a_log_is_diagnosed(log):
    columns = {name: Column(name) for name in CHANNELS}
    write_vehicle(
        log.parent / "vehicle.toml", VehicleFile(PRESETS["thesis1992"], columns, Column("time"))
    )
    options = "--vehicle", "vehicle.toml", "--diagnoser", "rules", "--output", "diagnosis"
    assert "propeller_loss:port" in run(
        log.parent, *COMMAND, "diagnose", *options, log.name, code=3
    )
    assert (log.parent / "diagnosis" / "index.html").exists()
