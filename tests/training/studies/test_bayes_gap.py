"""The study on few episodes, and its scores by hand."""

import json

import numpy as np
import pytest

from auv_fault_env.faults import CATALOGUE, UNKNOWN, classes
from training.benchmark import suites
from training.studies import bayes_gap
from training.studies.bayes_gap import BayesGap, chosen_episodes, judged, main, prior_of_suite


def test_prior_is_that_of_the_episodes():
    prior = prior_of_suite(tuple(CATALOGUE))
    assert prior.probability.sum() == pytest.approx(0.8)
    by_class = {}
    for fault, share in zip(CATALOGUE.values(), prior.probability, strict=True):
        by_class[fault.diagnosis] = by_class.get(fault.diagnosis, 0.0) + share
    assert list(by_class.values()) == pytest.approx([0.8 / len(by_class)] * len(by_class))


def test_a_fifth_of_the_episodes_is_healthy_and_no_episode_is_double():
    suite = suites.load(suites.IDEAL)
    episodes = chosen_episodes(suite, 300, 3)
    assert len({episode.seed for episode in episodes}) == 300
    assert [bool(episode.schedule) for episode in episodes] == [True] * 240 + [False] * 60
    assert episodes[0] == suite.episodes[3]


def test_beliefs_are_judged_without_unknown():
    n_classes = len(classes())
    probability = np.full(n_classes, 1e-12)
    probability[0] = 0.25
    probability[2] = 0.25
    probability[classes().index(UNKNOWN)] = 0.5
    beliefs = judged(np.log(probability)[None, None], np.array([[2]]))
    assert beliefs.loss == pytest.approx(np.log(2.0))
    assert beliefs.entropy == pytest.approx(np.log(2.0), abs=1e-6)
    assert beliefs.named in (0, 2)


def test_table_of_a_small_run(tmp_path, monkeypatch):
    monkeypatch.setattr(bayes_gap, "DIAGNOSERS", ("oracle", "gaussian_bank"))
    arguments = BayesGap(
        episodes=5, particles=200, output=tmp_path / "run", cache=tmp_path / "cache"
    )
    main(arguments)
    results = json.loads((tmp_path / "run" / "results.json").read_text("utf-8"))
    rows = {row["name"]: row for row in results["rows"]}
    assert list(rows) == ["reference", "oracle", "gaussian_bank"]
    assert rows["reference"]["loss_gap"] == 0.0
    gap = rows["gaussian_bank"]["loss"] - rows["reference"]["loss"]
    assert rows["gaussian_bank"]["loss_gap"] == pytest.approx(gap)
    assert len(results["ranks"]["onset"]) == results["faulty"] == 4
    assert (tmp_path / "run" / "figures" / "ranks.png").is_file()
