"""What a first start compiles: the time of the compiler grows with the number of functions."""

import json
import os
import subprocess
import sys
from collections import Counter

import pytest

from training.studies import cold_start

COUNTED = """
import json
from numba.core import event

compiled = []


class Listener(event.Listener):
    def on_start(self, event):
        pass

    def on_end(self, event):
        function = event.data["dispatcher"].py_func
        compiled.append(f"{function.__module__}.{function.__name__}")


event.register("numba:compile", Listener())
"""
OWN = ("auv_fault_env", "diagnosers", "training")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "most", "twice"),
    [
        pytest.param(cold_start.ENVIRONMENT, 90, 12, id="environment"),
        pytest.param(cold_start.FILTER_BANK, 140, 12, id="filter bank"),
    ],
)
def test_a_first_start_compiles_few_functions_and_each_for_few_types(tmp_path, script, most, twice):
    program = f"{COUNTED}{script}print(json.dumps(compiled))"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def compiled():
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        return json.loads(done.stdout), done.stderr

    names, said = compiled()
    assert len(names) <= most
    own = Counter(name for name in names if name.startswith(OWN))
    assert own
    assert own.total() - len(own) <= twice
    assert said.count("compiling") == 1 and "about" in said and "realism" not in said
    assert not [name for name in own if "real" in name or "surroundings" in name]
    names, said = compiled()
    # what Python calls by itself
    assert len(names) <= 3 and not said


def test_the_page_shows_each_start_and_its_target():
    seconds = {"clock": 2.0, "cpu": 1.5}
    row = {"what": "a start", "target": 3.0, "first": seconds, "later": seconds}
    page = cold_start.page({"command": "it", "rows": [row]})
    (section,) = page["sections"]
    assert section["table"]["rows"] == [["a start", "2.0", "1.5", "3.0", "2.0", "1.5"]]


def test_a_start_that_fails_is_an_error(tmp_path):
    start = cold_start.Start("fails", ("-c", "raise SystemExit(1)"), 1.0)
    with pytest.raises(subprocess.CalledProcessError):
        cold_start.measured(start, str(tmp_path))
