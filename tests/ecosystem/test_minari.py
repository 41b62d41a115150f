"""Minari collects episodes of both environments, and gives back what was seen."""

import gymnasium as gym
import minari
import numpy as np

LIBRARY = "minari"
STEPS = 40
EPISODES = 8


def test_what_was_collected_comes_back(environment, tmp_path, monkeypatch):
    """`DataCollector` with `record_infos`; the data set read back; its environment repeats it"""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    collector = minari.DataCollector(
        gym.make(environment, max_episode_steps=STEPS), record_infos=True, data_format="arrow"
    )
    collector.action_space.seed(0)
    seen = []
    for seed in range(EPISODES):
        observation, info = collector.reset(seed=seed)
        seen.append([(observation, 0.0, info)])
        is_over = False
        while not is_over:
            action = collector.action_space.sample()
            observation, reward, terminated, truncated, info = collector.step(action)
            seen[-1].append((observation, reward, info))
            is_over = terminated or truncated
    collector.create_dataset("auv/collected-v0", ref_min_score=0.0)
    collector.close()

    data = minari.load_dataset("auv/collected-v0")
    again = data.recover_environment()
    assert data.total_episodes == EPISODES
    assert data.total_steps == sum(len(rows) - 1 for rows in seen) >= 100
    for seed, (episode, rows) in enumerate(zip(data, seen, strict=True)):
        observations, rewards, infos = zip(*rows, strict=True)
        np.testing.assert_array_equal(episode.observations, observations)
        np.testing.assert_array_equal(episode.rewards, rewards[1:])
        for name in infos[0]:
            given = np.stack([info[name] for info in infos])
            np.testing.assert_array_equal(np.stack(episode.infos[name]), given)
        observation, _ = again.reset(seed=seed)
        for action in episode.actions:
            observation, *_ = again.step(action)
        np.testing.assert_array_equal(observation, observations[-1])
