"""The scores are sums of rewards on seeds for tests, and PPO has learnt on others."""

import json

import gymnasium as gym
import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError
from training.sb3 import FleetVecEnv
from training.seeds import purpose_of, seeds
from training.studies import reference_scores
from training.studies.reference_scores import ReferenceScores, follow, hand_rule, main, scores


def test_a_score_is_the_sum_of_the_rewards_of_its_episode():
    env = gym.make(reference_scores.ENVIRONMENT, **reference_scores.SETTINGS)
    totals = []
    for seed in seeds("test", 2):
        observation, _ = env.reset(seed=seed)
        totals.append(0.0)
        is_over = False
        while not is_over:
            observation, reward, _, is_over, _ = env.step(hand_rule(observation[None])[0])
            totals[-1] += reward
    assert scores(hand_rule, 2) == pytest.approx(totals, rel=1e-6)


def test_the_hand_rule():
    observation = np.zeros((3, len(CHANNELS)))
    observation[:, INDEX["mission_speed"]] = [0.5, 0.5, 1.0]
    observation[:, INDEX["speed"]] = [0.5, 0.3, -1.0]
    expected = [[-0.15, 0.0, 0.0], [0.25, 0.0, 0.0], [1.0, 0.0, 0.0]]
    np.testing.assert_allclose(hand_rule(observation), expected)
    assert not follow(observation).any()


def test_table_of_a_small_run(tmp_path, monkeypatch):
    started = []
    seed = FleetVecEnv.seed
    monkeypatch.setattr(
        FleetVecEnv, "seed", lambda env, first: started.append(first) or seed(env, first)
    )
    monkeypatch.setattr(reference_scores, "STEPS", 20)
    monkeypatch.setattr(reference_scores, "LANES", 16)
    main(ReferenceScores(episodes=6, steps=2048, trainings=2, seed=3, output=tmp_path / "run"))
    results = json.loads((tmp_path / "run" / "results.json").read_text("utf-8"))
    rows = {row["agent"]: row for row in results["rows"]}
    assert list(rows) == [
        "random actions",
        "follow the mission",
        "hand rule",
        "PPO, training 3",
        "PPO, training 4",
    ]
    assert {purpose_of(first) for first in started} == {"training"}
    assert len(set(started)) == 2
    assert rows["follow the mission"]["gain"] == 0
    assert rows["random actions"]["gain_interval"][1] < 0
    for row in rows.values():
        assert row["score_interval"][0] <= row["score"] <= row["score_interval"][1]
    assert rows["PPO, training 3"]["score"] != rows["PPO, training 4"]["score"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"episodes": 1}, "episodes: got 1"), ({"trainings": -1}, "trainings: got -1")],
)
def test_wrong_arguments_are_refused(wrong, message, tmp_path):
    with pytest.raises(InputError, match=message):
        main(ReferenceScores(output=tmp_path / "run", **wrong))
