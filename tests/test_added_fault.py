"""A fault that joins the catalogue is a class of every diagnoser, stimulus, environment and
benchmark.
"""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from training.benchmark.suites import load

# where the whole missions of the thresholds are of minutes, under the stimulus learned
SHORT_MISSIONS = 4_900_067_132
FEATURES = 31
ADDED = ["ice_on_hull", "hot_motors"]
LAST = [*ADDED, "unknown"]

ADD = """
from auv_fault_env.faults import CATALOGUE, Fault
hot = {"resistance": 1.4, "torque_constant": 0.8}
scale = {f"{side}_{name}": factor for side in ("port", "starboard") for name, factor in hot.items()}
CATALOGUE["ice_on_hull"] = Fault("ice_on_hull", "hull", scale={"alpha": 1.4, "gamma": 1.2})
CATALOGUE["hot_motors"] = Fault("hot_motors", "motor:port", scale=scale)
"""
IMPORTS = """
import json
import gymnasium as gym
import numpy as np
import diagnosers.integrated
import training.active_env
import training.formats.onnx
import training.stimuli
"""
USE = """
from auv_fault_env import FaultEvent, Fleet, classes
from diagnosers import NAMES, load, make
from training.stimuli import STIMULI

EVENT = {"fault": "hot_motors", "onset": 2.0, "severity": 1.0}
N_LANES = 3
names = classes()
fleet = Fleet(N_LANES)
observation = fleet.reset(range(N_LANES), schedules=[(FaultEvent(**EVENT),)] * N_LANES)
observations = [observation]
for _ in range(150):
    observations.append(fleet.step(observations[-1][:, :1] * [1.0, 0.0, 0.0]))

beliefs = {}
for name in NAMES:
    diagnoser = make(name)
    diagnoser.reset(N_LANES)
    for observation in observations:
        belief = diagnoser.update(observation)
    probability = np.exp(belief.log_probability)
    beliefs[name] = {
        "classes": diagnoser.classes,
        "sum": probability.sum(axis=1).tolist(),
        "hot": probability[:, names.index("hot_motors")].tolist(),
        "severity": belief.severity_mean[:, names.index("hot_motors")].tolist(),
    }

make("integrated").save("saved.safetensors")
loaded = load("saved.safetensors")

offsets = {}
for name in ("learned", "greedy", "triggered_surge"):
    stimulus = STIMULI[name]()
    bank = make("filter_bank")
    bank.reset(N_LANES)
    for k, observation in enumerate(observations[:40]):
        offset = stimulus.offset(k, observation, bank.update(observation))
    offsets[name] = offset.tolist()

NAME = "training.active_env:auv_fault_env/ActiveDiagnosis-v0"
single = gym.make(NAME)
first, _ = single.reset(seed=1, options={"schedule": [EVENT], "mission": "cruise"})
terminated = False
while not terminated:
    _, _, terminated, truncated, info = single.step([0.0])
vector = gym.make_vec(NAME, num_envs=N_LANES, vectorization_mode="vector_entry_point")
many, _ = vector.reset(seed=1, options={"schedule": [EVENT]})
many, *_ = vector.step(np.zeros((N_LANES, 1)))

plant = gym.make_vec(
    "auv_fault_env/Propulsion-v0",
    num_envs=N_LANES,
    vectorization_mode="vector_entry_point",
    truth="full",
)
readings, _ = plant.reset(seed=1, options={"schedule": [EVENT]})
for _ in range(30):
    readings, _, _, _, plant_info = plant.step(readings[:, :1] * [1.0, 0.0, 0.0])

print(json.dumps({
    "beliefs": beliefs,
    "trained": len(loaded.trained_classes),
    "loaded": loaded.classes,
    "offsets": offsets,
    "single": first.shape,
    "many": many.shape,
    "declared": classes()[info["declared_class"]],
    "labels": list(plant_info["truth"]["label"]),
}))
"""
BENCHMARK = """
import sys
from training.benchmark import timing
from training.cli import main
timing.ONE_BY_ONE = 10
timing.MANY_LANES = 4
sys.exit(main([
    "benchmark", "--suite", "mine.json", "--hours", "0.05", "--counting-hours", "0.05",
    "--diagnosers", *sys.argv[1:], "--stimuli", "learned", "--workers", "2", "--output", "out",
]))
"""


def run(code, folder, *arguments):
    """The last line that a new process with this code prints."""
    command = [sys.executable, "-W", "ignore", "-c", code, *arguments]
    result = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    assert result.returncode == 0, result.stderr[-3000:]
    return result.stdout.splitlines()[-1]


@pytest.fixture(scope="module", params=["before", "after"])
def results(request, tmp_path_factory):
    """The results of all uses, the faults added before or after the modules are imported."""
    code = ADD + IMPORTS if request.param == "before" else IMPORTS + ADD
    return json.loads(run(code + USE, tmp_path_factory.mktemp(request.param)))


def test_every_diagnoser_has_the_classes_and_a_belief_that_sums_to_one(results):
    for name, belief in results["beliefs"].items():
        assert belief["classes"][-3:] == LAST, name
        np.testing.assert_allclose(belief["sum"], 1.0, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("name", ["filter_bank", "integrated", "cusum"])
def test_an_active_added_fault_gets_a_high_posterior(results, name):
    assert min(results["beliefs"][name]["hot"]) > 0.9


@pytest.mark.parametrize("name", ["filter_bank", "integrated"])
def test_the_severity_of_an_added_fault_is_that_of_the_bank(results, name):
    assert min(results["beliefs"][name]["severity"]) > 0.8


@pytest.mark.parametrize("name", ["raw_network", "kalman_network"])
def test_a_network_without_a_bank_gives_an_added_fault_a_share(results, name):
    assert all(0.0 < probability < 1.0 / 20 for probability in results["beliefs"][name]["hot"])


def test_saved_weights_keep_the_classes_of_their_training(results):
    assert results["trained"] == 20
    assert results["loaded"][-3:] == LAST


def test_stimuli_that_depend_on_the_belief_work(results):
    for offset in results["offsets"].values():
        assert len(offset) == 3 and np.isfinite(offset).all()


def test_the_active_environments_observe_and_declare_the_fault(results):
    assert results["single"] == [FEATURES + 2]
    assert results["many"] == [3, FEATURES + 2]
    assert results["declared"] == "hot_motors"


def test_the_plant_has_the_fault(results):
    assert results["labels"] == ["hot_motors"] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "diagnosers"),
    [
        (ADD + BENCHMARK, ("filter_bank", "integrated")),
        ("import training.cli" + ADD + BENCHMARK, ("filter_bank",)),
    ],
    ids=["before", "after"],
)
def test_a_benchmark_scores_diagnosers_over_the_added_classes(code, diagnosers, tmp_path):
    suite = load("thesis")
    healthy = suite.healthy | {"threshold": SHORT_MISSIONS}
    small = replace(suite, name="mine", episodes=suite.episodes[:4], healthy=healthy)
    (tmp_path / "mine.json").write_text(small.text(), encoding="utf-8")
    run(code, tmp_path, *diagnosers)
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert found["classes"][-3:] == LAST
    assert not found["failures"]


def test_workers_have_the_catalogue_of_the_process_that_planned_the_work(tmp_path):
    code = (
        ADD
        + "from joblib import Parallel, delayed\n"
        + "from auv_fault_env.faults import classes\n"
        + "from training.benchmark.workers import with_catalogue\n"
        + "job = delayed(with_catalogue)(dict(CATALOGUE), classes)\n"
        + "print(*Parallel(n_jobs=2)([job])[0])"
    )
    assert run(code, tmp_path).split()[-3:] == LAST
