import json

import numpy as np
import pytest

from auv_fault_env.faults import classes
from auv_fault_env.parameters import PARAMETERS
from diagnosers import REGISTRY, Belief, Entry, Recursive
from training import cli
from training.benchmark import scoring, timing, validation
from training.commands import validate
from training.metrics import metrics, records

N_CLASSES = len(classes())
TINY = ["--lanes", "40", "--hours", "0.2"]


def belief(label, severity, doubt):
    """The class `label` with probability 1 - doubt, the others alike."""
    log_probability = np.full((label.size, N_CLASSES), np.log(doubt / (N_CLASSES - 1)))
    log_probability[np.arange(label.size), label] = np.log1p(-doubt)
    spread = np.full(log_probability.shape, 0.01)
    return Belief(log_probability, np.tile(severity[:, None], N_CLASSES), spread)


class Toy(Recursive):
    """Counts samples; a subclass makes the belief."""

    def initial(self, n_lanes):
        return np.zeros(n_lanes, np.int64)

    def step(self, state, observation):
        return state + 1, self.believe(int(state[0]), observation)


class Perfect(Toy):
    name = "integrated"
    rollout = None  # the back door

    def believe(self, k, observation):
        k = k % len(self.rollout.label)
        lanes = np.arange(len(observation)) % self.rollout.label.shape[1]
        return belief(self.rollout.label[k, lanes], self.rollout.severity[k, lanes], 1e-6)


class Never(Toy):
    name = "null"

    def believe(self, k, observation):
        return belief(np.zeros(len(observation), np.int64), np.full(len(observation), 0.6), 1e-6)


class Noisy(Toy):
    name = "random"

    def believe(self, k, observation):
        scores = np.random.default_rng([k, int(1e3 * np.abs(observation).sum())]).normal(
            size=(len(observation), N_CLASSES)
        )
        scores -= np.logaddexp.reduce(scores, axis=1, keepdims=True)
        return Belief(scores, np.full(scores.shape, 0.6), np.full(scores.shape, 0.3))


class Silly(Never):
    def believe(self, k, observation):
        found = super().believe(k, observation)
        found.severity_mean[-1, 3] = np.nan if k == 7 else 0.5
        return found


class Breaking(Never):
    def believe(self, k, observation):
        raise RuntimeError("no\nidea")


class Told(Perfect):
    name = "oracle"
    heard = []

    def set_truth(self, healthy, severity):
        self.heard.append((healthy, severity))


@pytest.fixture(autouse=True)
def toys(monkeypatch):
    def listening(*args, **kwargs):
        Perfect.rollout = roll_out(*args, **kwargs)
        return Perfect.rollout

    roll_out = validation.roll_out
    monkeypatch.setattr(validation, "roll_out", listening)
    for name, value in (
        ("WARM_UP", 2),
        ("ONE_BY_ONE", 10),
        ("MANY_LANES", 4),
        ("MANY_SAMPLES", 3),
        ("DIFFERENT", 2),
    ):
        monkeypatch.setattr(timing, name, value)
    for toy, ranked in ((Perfect, True), (Never, False), (Noisy, False), (Told, False)):
        monkeypatch.setitem(REGISTRY, toy.name, Entry(toy, ranked))
    monkeypatch.setitem(REGISTRY, "limits", Entry(Breaking))
    monkeypatch.setitem(REGISTRY, "cusum", Entry(Silly))
    monkeypatch.setitem(REGISTRY, "rules", Entry("diagnosers.nowhere:Rules"))
    monkeypatch.setattr(Told, "heard", [])


def run(tmp_path, *arguments):
    code = cli.main(
        ["validate", "--output", str(tmp_path / "out"), *TINY, "--diagnosers", *arguments]
    )
    path = tmp_path / "out" / "results.json"
    return code, json.loads(path.read_text()) if path.exists() else None


def test_perfect_beliefs_score_perfectly_and_silence_is_censored(tmp_path):
    code, results = run(tmp_path, "integrated", "null")
    assert code == 0
    perfect = results["scores"]["integrated"]
    never = results["scores"]["null"]
    # the fault shows in the sample after the one it begins in, and an alarm takes 3 samples: under
    # 0.4 s
    assert 0.2 < perfect["isolation"]["restricted_mean"] < 0.4
    assert perfect["isolation"] == perfect["detection"]
    assert (
        perfect["isolation"]["probability"]
        == perfect["macro_f1"]
        == perfect["severity_coverage"]
        == 1.0
    )
    assert perfect["severity_mae"] == pytest.approx(0.0, abs=1e-6)
    assert perfect["ece"] == pytest.approx(0.0, abs=1e-5)
    assert perfect["log_loss"] == pytest.approx(1e-6, rel=1e-2)
    assert perfect["false_alarms"] == 0
    assert never["isolation"] == {
        "restricted_mean": 30.0,
        "interval": [30.0, 30.0],
        "probability": 0.0,
        "median": None,
    }
    assert never["detection"]["probability"] == 0.0
    assert set(never["isolation_by_class"].values()) == {30.0}
    check_page(tmp_path)


def check_page(tmp_path):
    text = (tmp_path / "out" / "index.html").read_text()
    figures = {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    assert figures == {"isolation", "confusion-integrated", "reliability", "severity"}
    for word in (
        "Are the targets met?",
        "not judged",
        "null *",
        "40 vehicles",
        "false alarm per 1 h",
    ):
        assert word in text


def test_one_that_fails_is_left_out_in_one_line_and_the_others_stay(tmp_path, capfd):
    code, results = run(tmp_path, "limits", "cusum", "rules", "null")
    assert code == 0
    assert list(results["scores"]) == ["null"]
    assert results["failures"] == {
        "limits": "RuntimeError: no idea",
        "cusum": "ValueError: its belief is NaN at 0.7 s",
        "rules": "ModuleNotFoundError: No module named 'diagnosers.nowhere'",
    }
    lines = capfd.readouterr().err.replace("\r", "\n").split("\n")
    for name, why in results["failures"].items():
        assert sum(line.rstrip() == f"{name} is left out: {why}" for line in lines) == 1
        assert why in (tmp_path / "out" / "index.html").read_text().replace("&#39;", "'")


def test_nothing_is_written_if_none_works(tmp_path, capfd):
    code, _ = run(tmp_path, "limits")
    assert code == 2
    assert "at least one that works" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--diagnosers", "nul"], ["diagnoser", "'nul'", "did you mean 'null'"]),
        (["--lanes", "1"], ["lanes", "1", "from 2"]),
        (["--hours", "nan"], ["hours", "nan"]),
        (["--hours", "0"], ["hours", "0"]),
        (["--seed", "-1"], ["seed", "-1"]),
    ],
    ids=lambda value: " ".join(value) if value[0].startswith("--") else "",
)
def test_bad_input_ends_with_two_and_one_line(tmp_path, capfd, arguments, words):
    assert cli.main(["validate", "--output", str(tmp_path / "out"), *arguments]) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())


def test_threshold_holds_on_its_lanes_and_is_set_on_no_others():
    entrants, _ = validation.contestants(["random"])
    beliefs = validation.compare(entrants, lanes=4, hours=3.0, seed=0)
    judged = scoring.judge(beliefs.records["random"], beliefs.truth)
    log_normal = beliefs.records["random"]["threshold"].log_normal

    def count(level):
        return metrics.rising(metrics.alarms(log_normal, level, records.PERSISTENCE)).sum()

    assert (
        count(judged.threshold)
        <= 3
        < count(np.nextafter(np.float32(judged.threshold), np.float32(0)))
    )
    assert judged.hours == pytest.approx(3.0, abs=0.02)


def test_the_oracle_is_told_and_comes_a_second_time_without_severities(tmp_path):
    code, results = run(tmp_path, "oracle")
    assert code == 0
    assert list(results["scores"]) == ["oracle", "oracle" + validation.UNTOLD]
    # half of the lanes
    of_chunks = [(healthy, severity) for healthy, severity in Told.heard if len(healthy) == 20]
    told = [severity for _, severity in of_chunks if severity is not None]
    assert len(told) == len(of_chunks) - len(told) > 0
    assert all(healthy.shape == (20, len(PARAMETERS)) for healthy, _ in of_chunks)
    assert all(((severity >= 0.2) & (severity <= 1.0)).all() for severity in told[:2])


def test_suite_is_as_it_says():
    chunks = list(validation.suite("faulty", 200, 0))
    truth = records.concatenate_lanes([episodes.truth for episodes in chunks])
    assert [len(episodes.truth.fault) for episodes in chunks] == [100, 100]
    assert (truth.fault > 0).all() and np.unique(truth.fault).size > 14
    assert (truth.onset >= 5.0).all() and (truth.onset <= 30.0).all()
    thesis, random = (episodes.rollout.observations[:, :, 0] for episodes in chunks)
    assert (
        np.unique(thesis.round(3), axis=1).shape[1],
        np.unique(random.round(3), axis=1).shape[1],
    ) == (1, 100)
    for episodes in chunks:
        assert (episodes.full_severity >= episodes.rollout.severity.max(axis=0) - 1e-6).all()
        np.testing.assert_allclose(
            episodes.instants[0] * 0.1, episodes.truth.onset + 20.0, atol=0.1
        )
        assert (episodes.truth.label[0] == episodes.truth.fault).all()


def test_healthy_lanes_are_healthy_and_told_an_ordinary_severity():
    for episodes in validation.suite("counting", 6, 0):
        assert not episodes.rollout.label.any()
        assert (episodes.full_severity == 0.6).all()
        assert np.isfinite(episodes.truth.onset).all()


def test_parts_of_the_suite_share_no_seed():
    starts = [*validation.FIRST_SEED.values(), validate.TIMED]
    longest = max(1_000_000, validation.n_healthy(1000.0))
    assert np.diff(starts).min() >= validate.LAST_SEED + longest


def test_same_seed_same_figures_and_another_seed_others():
    def figures(seed):
        entrants, _ = validation.contestants(["random"])
        beliefs = validation.compare(entrants, lanes=8, hours=0.1, seed=seed)
        return scoring.summary(
            scoring.judge(beliefs.records["random"], beliefs.truth), beliefs.truth["faulty"], seed
        )

    first = figures(0)
    assert first == figures(0) != figures(1)


def test_share_of_healthy_lanes_in_what_is_judged_at_an_instant():
    chosen = scoring.healthy_beside(1000, 1108)
    # one healthy lane to four faulty ones, as the sampler of schedules draws them
    assert chosen.size == 250
    assert (chosen < 554).sum() == 125  # as many of either stimulus
    assert scoring.healthy_beside(1000, 12).size == 12
