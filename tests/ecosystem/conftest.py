"""What the tests of all libraries share: the two environments, and the rows of docs/ecosystem.md.

A test is a row: its docstring, with its parameters filled in, says what ran; the report of
``--junit-xml`` keeps it beside the library and its version, for `write_table.py`. Tests of a
library that is not installed are not collected; ``make ecosystem`` installs all of them.
"""

import importlib.util
import warnings
from importlib.metadata import version

import pytest

ENVIRONMENTS = {
    "Propulsion-v0": "auv_fault_env:auv_fault_env/Propulsion-v0",
    "ActiveDiagnosis-v0": "training.active_env:auv_fault_env/ActiveDiagnosis-v0",
}
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
def no_warning_of_gymnasium():
    """Fail where Gymnasium warns of an environment; how a library uses others is its own affair."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*WARN: ")
        yield
