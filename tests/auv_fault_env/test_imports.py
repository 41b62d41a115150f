"""What `import auv_fault_env` brings along, and what it must not."""

import subprocess
import sys

import pytest

HEAVY = [
    "torch",
    "stable_baselines3",
    "matplotlib",
    "pygame",
    "pandas",
    "pyarrow",
    "diagnosers",
    "training",
]
SCRIPT = """
import sys
import auv_fault_env, gymnasium
gymnasium.make("auv_fault_env/Propulsion-v0")
print(" ".join({name.partition(".")[0] for name in sys.modules}))
"""


@pytest.fixture(scope="module")
def loaded():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=True
    )
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.parametrize("name", HEAVY)
def test_import_leaves_heavy_packages_alone(loaded, name):
    assert "auv_fault_env" in loaded and "gymnasium" in loaded
    assert name not in loaded


def test_public_names_are_there():
    import auv_fault_env

    missing = [name for name in auv_fault_env.__all__ if not hasattr(auv_fault_env, name)]
    assert not missing and len(set(auv_fault_env.__all__)) == len(auv_fault_env.__all__)
