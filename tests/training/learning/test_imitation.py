"""The start of the agent: it imitates a rule by hand, and estimates its returns."""

import numpy as np
import pytest
import torch

from auv_fault_env import classes
from diagnosers import Belief
from training.learning.agent import LOG_STD
from training.learning.budgeted import BudgetedVecEnv
from training.learning.imitation import demonstrate, imitate, rule
from training.learning.reproducible import seeded_generators
from training.learning.stimulus import StimulusTrainer
from training.stimuli import STIMULI
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.light_bank import light_bank
from training.stimuli.policy import REACH
from training.stimuli.policy_inputs import compressed_log_odds, log_probability_of
from training.stimuli.standing import StandingSurge
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
        nothing = np.zeros_like(log_probability)
        belief = Belief(log_probability, nothing, nothing)
        offsets.append(stimulus.offset(k, reading, belief)[0])
    assert offsets[1] == pytest.approx(offsets[2], rel=1e-2) and offsets[1] > 5.0 * offsets[0] > 0.0
    assert offsets[3] == pytest.approx(offsets[0], rel=1e-2)


def test_the_rule_is_the_surge_of_standing_surge():
    env = BudgetedVecEnv(40, "random")
    env.seed(2)
    observation = env.reset()
    log_probability = env.env.belief.log_probability
    surge = surge_offset(log_probability, EPISODE_TIME * env.budget**2, StandingSurge.gain)
    expected = np.minimum(surge, REACH * env.budget)
    offsets = env.clipped_offsets(rule(observation, env))[:, 0]
    np.testing.assert_allclose(offsets, expected, rtol=1e-3, atol=1e-6)
    assert np.ptp(offsets) > 0.1


def test_returns_are_discounted_sums_of_the_rewards_that_follow():
    env = BudgetedVecEnv(3, "random")
    env.seed(1)
    demonstration = demonstrate(env, 70, 0.5, np.random.default_rng(0))
    returns = demonstration.returns.reshape(70, 3)
    # an episode is 65 decisions; the returns of its last one are its reward
    env.seed(1)
    env.reset()
    noise = np.random.default_rng(0)
    rewards = []
    for action in demonstration.actions.reshape(70, 3, 1).numpy():
        shaken = action + np.exp(LOG_STD) * noise.standard_normal(action.shape)
        rewards.append(env.step(np.clip(shaken, -1.0, 1.0).astype(np.float32))[1])
    for first in (20, 62):
        expected = sum(0.5**k * rewards[first + k] for k in range(min(30, 65 - first)))
        np.testing.assert_allclose(returns[first], expected, rtol=1e-4, atol=1e-5)


def test_actor_and_critic_learn_the_actions_and_their_returns():
    trainer = StimulusTrainer(0)
    env = BudgetedVecEnv(256, light_bank())
    env.seed(1)
    demonstration = demonstrate(env, 60, 0.9, np.random.default_rng(0))
    policy = trainer.model.policy

    def errors():
        with torch.inference_mode():
            mean = policy.mean_action(demonstration.observations)
            values = policy.predict_values(demonstration.observations)[:, 0]
        pairs = (mean, demonstration.actions), (values, demonstration.returns)
        return [float((found - aim).square().mean()) for found, aim in pairs]

    before = errors()
    with seeded_generators(0):
        imitate(policy, trainer.training, demonstration)
    after = errors()
    assert demonstration.actions.max() > 0.5
    assert after[0] < 0.5 * float(demonstration.actions.square().mean())
    assert after[1] < 0.5 * before[1]


def test_the_actor_does_not_see_the_truth():
    trainer = StimulusTrainer(0)
    observation = torch.from_numpy(trainer.validation_env.reset())
    changed = observation.clone()
    changed[:, -trainer.env.n_truth :] += 1.0
    policy = trainer.model.policy
    with torch.inference_mode():
        torch.testing.assert_close(
            policy.mean_action(changed), policy.mean_action(observation), rtol=0, atol=0
        )
        values = policy.predict_values(changed) - policy.predict_values(observation)
    assert values.abs().min() > 1e-6
