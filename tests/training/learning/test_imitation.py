"""The start of the agent: it imitates the rule by hand, and estimates its returns."""

import numpy as np
import pytest
import torch

from auv_fault_env import classes
from diagnosers import Belief
from training.active_env.vector import ActiveDiagnosisVectorEnv
from training.learning.constraint import ConstrainedVecEnv
from training.learning.imitation import demonstrate, imitate
from training.learning.reproducible import seeded_generators
from training.learning.stimulus import StimulusTrainer
from training.sb3 import FleetVecEnv
from training.stimuli import STIMULI
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.light_bank import light_bank
from training.stimuli.policy_inputs import compressed_log_odds, log_probability_of
from training.stimuli.triggered_surge import GAIN, surge_offset


def probabilities(**chances):
    rest = (1.0 - sum(chances.values())) / (len(classes()) - len(chances))
    return np.log([[chances.get(name.replace(":", "_"), rest) for name in classes()]])


def ahead(log_probability, budget=0.1):
    return surge_offset(log_probability, np.array([EPISODE_TIME * budget**2]))[0]


def test_it_goes_ahead_by_the_odds_and_the_budget_where_doubt_is_of_hull_and_propellers():
    for budget in (0.05, 0.1):
        even = ahead(probabilities(normal=0.5, increased_drag=0.49), budget)
        assert even == pytest.approx(GAIN * budget, rel=0.05)
    assert ahead(probabilities(normal=0.6, increased_drag=0.3)) == pytest.approx(
        GAIN * 0.1 * 0.3 / 0.6, rel=0.2
    )
    assert (
        ahead(probabilities(normal=0.01, propeller_damage_port=0.45, propeller_loss_port=0.4))
        == LARGEST_OFFSET
    )
    assert ahead(np.where(np.arange(len(classes())) == 1, -1e-9, -1e30)[None]) == LARGEST_OFFSET
    assert ahead(probabilities(normal=0.1, motor_overheating_port=0.85)) == 0.0


def test_compressed_log_odds_give_back_the_log_probability():
    for normal in (0.999, 0.6, 0.01):
        log_probability = probabilities(normal=normal)
        np.testing.assert_allclose(
            log_probability_of(compressed_log_odds(log_probability)), log_probability, rtol=1e-9
        )


def test_the_stimulus_follows_the_odds():
    reading = np.zeros((1, 12))
    stimulus = STIMULI["triggered_surge"](0.1)
    reading[:, :2] = 0.3
    offsets = []
    for k, normal in enumerate((0.99, 0.5, 0.5, 0.99)):
        log_probability = probabilities(normal=normal, increased_drag=0.9 * (1.0 - normal))
        offsets.append(
            stimulus.offset(
                k,
                reading,
                Belief(
                    log_probability, np.zeros_like(log_probability), np.zeros_like(log_probability)
                ),
            )[0]
        )
    assert offsets[1] == pytest.approx(offsets[2], rel=1e-2) and offsets[1] > 5.0 * offsets[0] > 0.0
    assert offsets[3] == pytest.approx(offsets[0], rel=1e-2)


def test_returns_are_discounted_sums_of_the_rewards_that_follow():
    env = ConstrainedVecEnv(FleetVecEnv(ActiveDiagnosisVectorEnv(3, 4, "random", cost_weight=0.0)))
    env.seed(1)
    demonstration = demonstrate(env, 10, 0.5)
    returns = demonstration.returns.reshape(10, 3)
    gains = []
    env.seed(1)
    env.reset()
    for action in demonstration.actions.reshape(10, 3, 1):
        gains.append(env.step(action.numpy())[1])
    for first in (0, 4):  # an episode is four decisions
        expected = sum(0.5**k * gains[first + k] for k in range(4))
        np.testing.assert_allclose(returns[first], expected, rtol=1e-5, atol=1e-6)


def test_actor_and_critic_learn_the_actions_and_their_returns():
    trainer = StimulusTrainer(0)
    env = ConstrainedVecEnv(
        FleetVecEnv(ActiveDiagnosisVectorEnv(64, diagnoser=light_bank(), cost_weight=0.0))
    )
    env.seed(1)
    demonstration = demonstrate(env, 60, 0.9)
    policy = trainer.model.policy

    def errors():
        with torch.inference_mode():
            mean = policy.get_distribution(demonstration.observations).distribution.mean
            values = policy.predict_values(demonstration.observations)[:, 0]
        return [
            float((a - b).square().mean())
            for a, b in ((mean, demonstration.actions), (values, demonstration.returns))
        ]

    before = errors()
    with seeded_generators(0):
        imitate(policy, trainer.training, demonstration)
    after = errors()
    assert demonstration.actions.max() > 0.5
    assert (
        after[0] < 0.5 * float(demonstration.actions.square().mean()) and after[1] < 0.9 * before[1]
    )
