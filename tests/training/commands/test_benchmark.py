import csv
import errno
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from joblib import delayed

from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from diagnosers import REGISTRY, Belief, Entry, Recursive
from training import cli
from training.arguments import Benchmark, Simulate
from training.benchmark import page_figures, timing, workers
from training.benchmark.results import RESULTS
from training.benchmark.suites import load
from training.commands import benchmark
from training.report import run_folder
from training.report.figures import registry

TINY = ["--hours", "0.1", "--counting-hours", "0.05"]
# where the whole missions of the thresholds are of minutes, under cruise and thesis
SHORT_MISSIONS = 4_900_067_132
N_CLASSES = len(classes())


class Even(Recursive):
    name = "limits"

    def initial(self, n_lanes):
        return np.zeros(n_lanes)

    def step(self, state, observation):
        return state + 1, self.spoilt(
            int(state[0]), np.full((len(observation), N_CLASSES), 1.0 / N_CLASSES)
        )

    def spoilt(self, k, probability):
        return Belief(np.log(probability), *(np.zeros_like(probability) for _ in range(2)))


class Unnormalised(Even):
    def spoilt(self, k, probability):
        return super().spoilt(k, probability * (1.0 + 0.5 * (k == 630)))


class Undefined(Even):
    def spoilt(self, k, probability):
        found = super().spoilt(k, probability)
        found.log_probability[-1, 3] = np.nan if k == 640 else found.log_probability[-1, 3]
        return found


class Breaking(Even):
    def spoilt(self, k, probability):
        raise RuntimeError("no\nidea")


class Leaving(Even):
    def spoilt(self, k, probability):
        raise SystemExit("enough")


class Boundless(Even):
    def spoilt(self, k, probability):
        return (
            super().spoilt(k, probability)._replace(severity_mean=np.full_like(probability, np.inf))
        )


class Doubtless(Even):
    def spoilt(self, k, probability):
        return super().spoilt(k, probability)._replace(severity_std=np.full_like(probability, -1.0))


class BreakingAgain(Even):
    """Breaks the second time that it is to watch three lanes: those to count alarms on, and then
    the worst.
    """

    seen = []

    def initial(self, n_lanes):
        self.seen.append(n_lanes)
        if self.seen.count(3) > 1:
            raise RuntimeError("not again")
        return super().initial(n_lanes)


class Certain(Even):
    """Says that a fault is certain, now and then, healthy or not."""

    def spoilt(self, k, probability):
        certain = np.zeros_like(probability)
        certain[:, k // 5 % 2] = 1.0
        with np.errstate(divide="ignore"):
            return super().spoilt(k, certain)


class Told(Even):
    def set_truth(self, healthy, severity):
        pass


@pytest.fixture(autouse=True)
def quick(monkeypatch, request):
    if "page" not in request.node.name:  # drawing takes longer than all the rest
        monkeypatch.setattr(benchmark, "write_report", lambda report, folder: None)
    for name, value in (
        ("WARM_UP", 2),
        ("ONE_BY_ONE", 10),
        ("MANY_LANES", 4),
        ("MANY_SAMPLES", 3),
        ("DIFFERENT", 2),
    ):
        monkeypatch.setattr(timing, name, value)


@pytest.fixture
def mine(tmp_path):
    suite = load("thesis")
    healthy = suite.healthy | {"threshold": SHORT_MISSIONS}
    short = replace(suite, name="mine", episodes=suite.episodes[:6], healthy=healthy)
    path = tmp_path / "mine.json"
    path.write_text(short.text(), encoding="utf-8")
    return path


def command(mine, *more, output="out"):
    return ["benchmark", "--suite", str(mine), "--output", str(mine.parent / output), *TINY, *more]


def results_of(mine, output="out"):
    found = json.loads((mine.parent / output / "results.json").read_text())
    return {name: value for name, value in found.items() if name != "compute"}


def outcomes(mine, output="out"):
    return {path.name: path.read_bytes() for path in (mine.parent / output / "trials").iterdir()}


def test_a_run_leaves_results_rows_and_a_page_behind(mine):
    assert cli.main(command(mine, "--diagnosers", "random", "null", "--workers", "1")) == 0
    results = results_of(mine)
    assert {*results, "compute", "bounds"} == RESULTS.keys()
    assert results["suite"]["hash"] == load(str(mine)).hash
    assert results["suite"] | {"hash": ""} == {
        "name": "mine",
        "about": "faults of the thesis, nominal vehicles at its mean speed",
        "hash": "",
        "plant": {
            "preset": "thesis1992",
            "sensor_noise": 1.0,
            "disturbance": 1.0,
            "healthy_band": 0.0,
        },
        "duration": 65.0,
        "listed": 6,
        "every": 1,
    }
    assert list(results["scores"]) == ["cruise", "thesis"]
    for by_name in results["scores"].values():
        assert list(by_name) == ["random", "null"]
        silent = by_name["null"]
        assert (
            silent["isolation"]["restricted_mean"] == 30.0
            and silent["rates"]["10 h"]["false_alarms"] == 0
        )
        assert len(silent["by_lane"]["isolation"]) == len(results["episodes"]["seed"]) == 6
        assert len(silent["by_lane"]["decision"]) == len(results["decided"]["cruise"])
        assert [one["why"] for one in silent["worst"]] == ["no alarm 30 s after onset"] * 3
        assert {
            len(silent["worst"][0][key]) for key in ("time", "log_normal", "alarm", "fault")
        } == {130}
    assert results["scores"]["cruise"]["null"]["cost"]["energy_ratio"] == 1.0
    assert results["scores"]["thesis"]["null"]["cost"]["speed_rms_ratio"] > 1.5
    with (mine.parent / "out" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["stimulus"], row["diagnoser"], row["mtbfa"]) for row in rows][:3] == [
        ("cruise", "random", "1 h"),
        ("cruise", "random", "10 h"),
        ("cruise", "null", "1 h"),
    ]
    assert "mine" in (mine.parent / "out" / "index.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bits(mine):
    ways = {"one": ["1"], "two": ["2"], "threads": ["2", "--backend", "threading"]}
    for output, way in ways.items():
        more = ["--diagnosers", "random", "raw_network", "--stimuli", "cruise", "--workers", *way]
        assert cli.main(command(mine, *more, output=output)) == 0
    assert outcomes(mine, "one") == outcomes(mine, "two") == outcomes(mine, "threads")
    assert results_of(mine, "one") == results_of(mine, "two") == results_of(mine, "threads")


def test_ray_gives_the_same_bits(mine):
    pytest.importorskip("ray")
    for output, way in (
        ("one", ["--workers", "1"]),
        ("ray", ["--workers", "2", "--backend", "ray"]),
    ):
        run = [
            sys.executable,
            "-m",
            "training.cli",
            *command(mine, "--diagnosers", "random", *way, output=output),
        ]
        subprocess.run(run, check=True, capture_output=True)  # Ray warns of this and that
    assert outcomes(mine, "one") == outcomes(mine, "ray")
    assert results_of(mine, "one") == results_of(mine, "ray")


def test_ray_that_is_not_installed_is_refused(mine, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray.util.joblib", None)
    assert cli.main(command(mine, "--diagnosers", "null", "--backend", "ray")) == 2
    assert "pip install 'auv-fault[distributed]'" in capfd.readouterr().err
    assert [path.name for path in mine.parent.iterdir()] == ["mine.json"]


def test_a_finished_run_is_scored_again_without_running_anything(mine, monkeypatch):
    once = command(mine, "--diagnosers", "random", "--workers", "1")
    assert cli.main(once) == 0
    first = results_of(mine)
    kept = outcomes(mine)
    monkeypatch.setattr(
        "training.benchmark.workers.run_trial", lambda trial: pytest.fail("a trial was run again")
    )
    assert cli.main(once) == 0
    assert results_of(mine) == first and outcomes(mine) == kept


def test_only_what_is_missing_is_run_and_foreign_trials_are_not_read(mine):
    once = command(mine, "--diagnosers", "random", "--workers", "1")
    assert cli.main(once) == 0
    first = results_of(mine)
    kept = outcomes(mine)
    trials = mine.parent / "out" / "trials"
    lost = next(iter(kept))
    (trials / lost).rename(trials / lost.replace(".npz", "0.npz"))
    (mine.parent / "out" / "results.json").unlink()
    assert cli.main(once) == 0
    assert results_of(mine) == first and outcomes(mine)[lost] == kept[lost]


@pytest.mark.slow
def test_killed_half_way_the_same_command_gives_the_same_results(mine):
    more = "--diagnosers", "random", "null", "--stimuli", "cruise", "--workers", "1"
    arguments = command(mine, *more)
    process = subprocess.Popen(
        [sys.executable, "-m", "training.cli", *arguments], stderr=subprocess.DEVNULL
    )
    trials = mine.parent / "out" / "trials"
    deadline = time.monotonic() + 120
    while len(list(trials.glob("[!.]*"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (mine.parent / "out" / "results.json").exists()
    kept = outcomes(mine)
    assert cli.main(arguments) == 0
    assert kept.items() <= outcomes(mine).items()
    assert cli.main(command(mine, *more, output="whole")) == 0
    assert results_of(mine) == results_of(mine, "whole")


def test_an_output_of_another_suite_or_run_is_refused(mine, capfd):
    other = mine.parent / "other.json"
    other.write_text(replace(load(str(mine)), about="another").text(), encoding="utf-8")
    assert cli.main(command(mine, "--diagnosers", "null", "--workers", "1")) == 0
    before = outcomes(mine)
    capfd.readouterr()
    assert cli.main(command(other, "--diagnosers", "null")) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1
    for word in (load(str(mine)).hash, load(str(other)).hash, "choose another --output"):
        assert word in message
    assert outcomes(mine) == before
    run_folder.write_manifest(mine.parent / "out", "simulate", Simulate())
    assert cli.main(command(mine, "--diagnosers", "null")) == 2


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        (Unnormalised, "ValueError: its probabilities sum to 1.5 at 63.0 s"),
        (Undefined, "ValueError: its belief is NaN at 64.0 s"),
        (Breaking, "RuntimeError: no idea"),
        (BreakingAgain, "RuntimeError: not again"),
        (Leaving, "SystemExit: enough"),
        (
            Boundless,
            "ValueError: its severity is infinite, or its standard deviation negative, at 0.0 s",
        ),
        (
            Doubtless,
            "ValueError: its severity is infinite, or its standard deviation negative, at 0.0 s",
        ),
    ],
)
def test_one_that_fails_is_left_out_in_one_line_and_the_others_stay(
    mine, capfd, monkeypatch, kind, why
):
    monkeypatch.setitem(REGISTRY, "limits", Entry(kind))
    assert (
        cli.main(
            command(mine, "--diagnosers", "limits", "null", "--stimuli", "cruise", "--workers", "1")
        )
        == 0
    )
    results = results_of(mine)
    assert results["failures"] == {"limits": why}
    assert list(results["scores"]["cruise"]) == ["null"]
    lines = capfd.readouterr().err.replace("\r", "\n").split("\n")
    assert sum(line.rstrip() == f"limits is left out: {why}" for line in lines) == 1
    assert (
        cli.main(command(mine, "--diagnosers", "limits", "--stimuli", "cruise", "--workers", "1"))
        == 2
    )
    assert "at least one that works" in capfd.readouterr().err


def test_one_that_no_threshold_can_quieten_never_alarms_and_spoils_nothing(mine, monkeypatch):
    monkeypatch.setitem(REGISTRY, "limits", Entry(Certain))
    run = command(
        mine,
        "--diagnosers",
        "limits",
        "null",
        "--stimuli",
        "cruise",
        "--workers",
        "1",
        output="page",
    )
    assert cli.main(run) == 0
    results = results_of(mine, "page")
    assert results["thresholds"]["limits"] == {"1 h": None, "10 h": None}
    certain = results["scores"]["cruise"]["limits"]
    assert (
        certain["rates"]["1 h"]["threshold"] is None and certain["detection"]["probability"] == 0.0
    )
    assert [
        registry.PLOTS["episodes"](
            [page_figures._episode(view_of(results), "cruise", certain["worst"][0])]
        ).axes
    ]


def view_of(results):
    return page_figures.BenchmarkView.of(results)


def test_one_that_is_told_the_truth_is_not_ranked(mine, monkeypatch):
    monkeypatch.setitem(REGISTRY, "limits", Entry(Told))
    assert (
        cli.main(command(mine, "--diagnosers", "limits", "--stimuli", "cruise", "--workers", "1"))
        == 0
    )
    assert results_of(mine)["references"] == ["limits"]


def test_a_process_that_dies_ends_the_run_in_one_line():
    with pytest.raises(InputError, match="workers: got 'a process that has died'"):
        list(workers._outcomes(iter([delayed(os._exit)(3)]), 2, "loky"))


CULPRITS = """
import os, sys
import numpy as np
from diagnosers.references import Null

class Spoils(Null):
    "Answers, and spoils all that it can reach."
    name = "spoils"
    def initial(self, n):
        import diagnosers.references, auv_fault_env.faults
        os.chdir("/")
        diagnosers.references.Null.step = None
        auv_fault_env.faults.CATALOGUE.popitem()
        print(10_000_000 * "x")
        return super().initial(n)
    def step(self, state, observation, step=Null.step):
        return step(self, state, observation)

class Interrupts(Null):
    name = "interrupts"
    def step(self, state, observation):
        if len(observation) == 6:
            raise KeyboardInterrupt("m\\ud800\\x1b[2J")
        return super().step(state, observation)

class Emoji(Null):
    name = "\\U0001f600"
"""


def test_third_parties_cost_nothing_but_their_own_rows(mine, capfd):
    folder = mine.parent
    (folder / "culprits.py").write_text(CULPRITS)
    (folder / "leaves.py").write_text("import os\nos._exit(3)")
    others = ["--diagnosers", "random", "--stimuli", "cruise", "--workers", "2"]
    targets = [f"{folder}/culprits.py:{name}" for name in ("Spoils", "Interrupts", "Emoji")]
    targets.append(f"{folder}/leaves.py:Leaves")
    culprits = [word for target in targets for word in ("--diagnoser", target)]
    assert cli.main(command(mine, *others, *culprits)) == 0
    results = results_of(mine)
    shown = capfd.readouterr()
    assert cli.main(command(mine, *others, output="alone")) == 0
    alone = results_of(mine, "alone")
    assert results["scores"]["cruise"]["random"] == alone["scores"]["cruise"]["random"]
    assert results["thresholds"]["random"] == alone["thresholds"]["random"]
    assert outcomes(mine, "alone").items() <= outcomes(mine).items()
    assert results["third_parties"].keys() <= {"spoils"}
    failures = results["failures"]
    assert failures.keys() - {"spoils"} == {"interrupts", *targets[2:]}
    assert failures["interrupts"] == "KeyboardInterrupt: m\\ud800\\x1b[2J"
    assert failures[targets[3]] == "ended its process with exit code 3"
    assert "up to 60 letters" in failures[targets[2]]
    for name, reason in failures.items():
        assert shown.err.count(f"{name} is left out: {reason}") == 1
    assert "xxxx" not in shown.out + shown.err


def test_a_full_disk_ends_the_run_in_one_line(mine, capfd, monkeypatch):
    def full(*arguments, **arrays):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    assert cli.main(command(mine, "--diagnosers", "null", "--workers", "1")) == 2
    last = capfd.readouterr().err.replace("\r", "\n").strip().split("\n")[-1]
    assert last.startswith("auv-fault benchmark: trial:") and "No space left on device" in last
    assert not outcomes(mine)


@pytest.mark.parametrize("where", ["prepare", "scored"])
def test_a_run_that_is_stopped_says_what_it_leaves(mine, capfd, monkeypatch, where):
    def stopped(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, where, stopped)
    assert (
        cli.main(command(mine, "--diagnosers", "null", "--stimuli", "cruise", "--workers", "1"))
        == 130
    )
    assert "trials that are done are kept" in capfd.readouterr().err


@pytest.mark.parametrize(
    "healthy",
    [{"counting": SHORT_MISSIONS + 1}, {"counting": 4_000_000_003}, {"threshold": 4_010_000_001}],
)
def test_a_suite_whose_vehicles_serve_twice_is_refused(mine, capfd, healthy):
    suite = load(str(mine))
    mine.write_text(replace(suite, healthy=suite.healthy | healthy).text(), encoding="utf-8")
    assert cli.main(command(mine, "--diagnosers", "null")) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1 and "vehicles that serve once" in message
    assert [path.name for path in mine.parent.iterdir()] == ["mine.json"]


def test_the_command_of_the_results_can_be_pasted():
    asked = Benchmark(
        suite="my suite.json", diagnoser=("a b.py:C", "m:D"), hours=12.3456789, lanes=3
    )
    words = shlex.split(benchmark.command(asked))
    assert words[:4] == ["auv-fault", "benchmark", "--suite", "my suite.json"]
    assert ["--hours", "12.3456789"] == words[words.index("--hours") :][:2]
    assert words[-6:] == ["--diagnoser", "a b.py:C", "--diagnoser", "m:D", "--lanes", "3"]


def test_somebody_elses_diagnoser_takes_part(mine):
    foreign = mine.parent / "foreign.py"
    foreign.write_text(
        "import numpy as np\nfrom diagnosers import Belief, Recursive\n"
        "class Mine(Recursive):\n    name = 'mine'\n    def initial(self, n): return ()\n"
        "    def step(self, state, observation):\n"
        "        p = np.full((len(observation), 20), np.log(1 / 20))\n"
        "        return state, Belief(p, 0 * p, 0 * p)\n",
        encoding="utf-8",
    )
    more = [
        "--diagnoser",
        f"{foreign}:Mine",
        "--diagnosers",
        "null",
        "--stimuli",
        "cruise",
        "--workers",
        "2",
    ]
    assert cli.main(command(mine, *more)) == 0
    results = results_of(mine)
    assert list(results["scores"]["cruise"]) == ["null", "mine"]
    assert results["third_parties"] == {"mine": f"{foreign}:Mine"}


def test_fewer_lanes_are_a_fair_sample_and_the_results_say_so(mine):
    assert (
        cli.main(
            command(
                mine,
                "--diagnosers",
                "null",
                "--lanes",
                "3",
                "--stimuli",
                "cruise",
                "--workers",
                "1",
            )
        )
        == 0
    )
    results = results_of(mine)
    assert results["suite"]["every"] == 2
    assert results["episodes"]["seed"] == [
        episode.seed for episode in load(str(mine)).episodes[::2]
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--diagnosers", "nul"], ["diagnoser", "'nul'", "did you mean 'null'"]),
        (["--stimuli", "cruse"], ["stimulus", "did you mean 'cruise'"]),
        (["--suite", "standart"], ["suite", "did you mean 'standard'"]),
        (["--diagnoser", "nowhere:Class"], ["nowhere:Class"]),
        (["--hours", "nan"], ["hours", "nan"]),
        (["--counting-hours", "0"], ["hours", "0"]),
        (["--lanes", "0"], ["lanes", "0"]),
        (["--workers", "0"], ["workers", "0"]),
        (["--time-limit", "0"], ["time-limit", "0", "from 1 to 1000000"]),
        (["--time-limit", "nan"], ["time-limit", "nan"]),
        (["--seed", "-1"], ["seed", "-1"]),
    ],
    ids=lambda value: " ".join(value) if value[0].startswith("--") else "",
)
def test_bad_input_ends_with_two_and_one_line_and_leaves_nothing(tmp_path, capfd, arguments, words):
    assert cli.main(["benchmark", "--output", str(tmp_path / "out"), *arguments]) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())
