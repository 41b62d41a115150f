"""What the tests of all libraries share: the two environments, and the rows of docs/ecosystem.md.

A test is a row: its docstring, with its parameters filled in, says what ran; the report of
``--junit-xml`` keeps it beside the library and its version, for `write_table.py`. Tests of a
library that is not installed are not collected; ``make ecosystem`` installs all of them.
"""

import importlib.util
import warnings
from functools import partial
from importlib.metadata import version

import gymnasium as gym
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from training.learning.reproducible import one_thread
from training.sb3 import FleetVecEnv

ENVIRONMENTS = {
    "Propulsion-v0": "auv_fault_env:auv_fault_env/Propulsion-v0",
    "ActiveDiagnosis-v0": "training.active_env:auv_fault_env/ActiveDiagnosis-v0",
}
LANES = 2
# by file; Minari collects with jax, and RLlib is more of ray than the environments step with
NEEDED = {
    "test_minari.py": "jax",
    "test_rllib.py": "ormsgpack",
    "test_sb3_contrib.py": "sb3_contrib",
    "test_tianshou.py": "tianshou",
    "test_torchrl.py": "torchrl",
}
collect_ignore = [
    file for file, module in NEEDED.items() if importlib.util.find_spec(module) is None
]


@pytest.fixture(params=ENVIRONMENTS)
def environment(request):
    """The id of an environment with the module that registers it, as `gymnasium.make` takes it."""
    return ENVIRONMENTS[request.param]


def fleet(environment):
    """One environment of all lanes."""
    many = gym.make_vec(environment, LANES, "vector_entry_point", autoreset_mode="SameStep")
    return FleetVecEnv(many)


def singles(kind, environment):
    """One environment per lane, in a vector of stable-baselines3."""
    return kind([partial(gym.make, environment)] * LANES)


VECTORS = {
    "DummyVecEnv": partial(singles, DummyVecEnv),
    "SubprocVecEnv": partial(singles, SubprocVecEnv),
    "FleetVecEnv": fleet,
}


@pytest.fixture
def learns(environment):
    """Whether an algorithm learns for so many steps on a vector that stable-baselines3 takes."""

    def learns_on(vector, algorithm, policy, n_steps):
        envs = VECTORS[vector](environment)
        model = algorithm(policy, envs, seed=0, device="cpu")
        before = [values.clone() for values in model.policy.parameters()]
        model.learn(n_steps)
        envs.close()
        after = model.policy.parameters()
        has_changed = any((old != new).any() for old, new in zip(before, after, strict=True))
        return model.num_timesteps == n_steps and has_changed

    return learns_on


@pytest.fixture(autouse=True)
def row(request, record_property):
    """Keep what the row of this test says."""
    parameters = dict(request.node.callspec.params)
    library = request.module.LIBRARY
    record_property("library", library)
    record_property("version", version(library))
    record_property("environment", parameters.pop("environment"))
    record_property("what", request.function.__doc__.strip().format(**parameters))


@pytest.fixture(autouse=True)
def one_thread_of_torch():
    """Nothing here is large enough for several, which wait for each other on a busy machine."""
    with one_thread():
        yield


@pytest.fixture(autouse=True)
def no_warning_of_gymnasium():
    """Fail where Gymnasium warns of an environment; how a library uses others is its own affair."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*WARN: ")
        yield
