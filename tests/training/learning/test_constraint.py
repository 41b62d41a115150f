"""What binds the learning agent: the allowance, and the price of moving a healthy vehicle."""

import numpy as np
import pytest

from auv_fault_env import classes
from diagnosers import Belief, Recursive
from training.active_env.vector import ActiveDiagnosisVectorEnv
from training.learning.constraint import (
    ALLOWANCE,
    DECLARATION_REWARD,
    PRICE_RATE,
    ConstrainedVecEnv,
)
from training.learning.outcomes import HEALTHY_SHARE
from training.sb3 import FleetVecEnv
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET

BUDGET = 0.1
AMPLITUDE = 0.2
GONE = [{"fault": "propeller_loss:port", "onset": 0.0, "severity": 1.0}]


class Certain(Recursive):
    """Doubts nothing, and holds that the port propeller is lost."""

    def initial(self, n_lanes):
        return ()

    def step(self, state, observation):
        sure = np.full((len(observation), len(classes())), -40.0)
        sure[:, classes().index("propeller_loss:port")] = 0.0
        return state, Belief(sure, np.zeros_like(sure), np.zeros_like(sure))


def constrained(schedule=(), least=1.0, budget=BUDGET, n_lanes=3, diagnoser="null"):
    plant = ActiveDiagnosisVectorEnv(n_lanes, 5, diagnoser, AMPLITUDE, budget, 0.0)
    env = ConstrainedVecEnv(FleetVecEnv(plant), least)
    env.seed(1)
    env.set_options({"schedule": list(schedule), "mission": 0.4})
    return env, env.reset()


def test_a_healthy_vehicle_pays_for_its_offsets_and_a_faulty_one_does_not():
    actions = np.array([[0.0], [0.5], [-1.0]], np.float32)
    spent = np.square(AMPLITUDE * actions[:, 0]) / BUDGET**2
    for schedule, paid in (((), 0.5 * spent), (GONE, 0.0)):
        (free, _) = constrained(schedule)
        (dear, _) = constrained(schedule)
        free.price = 0.0
        dear.price = 0.5
        for _ in range(4):
            before, after = (env.step(actions) for env in (free, dear))
            np.testing.assert_allclose(after[1], before[1] - paid, atol=1e-6)
            np.testing.assert_array_equal(after[0], before[0])


def test_a_right_declaration_pays_a_wrong_one_and_the_onset_do_not():
    env, _ = constrained([GONE[0] | {"onset": 0.5}], diagnoser=Certain())
    _, reward, done, _ = env.step(np.zeros((3, 1), np.float32))
    assert done.all() and reward == pytest.approx([DECLARATION_REWARD] * 3)
    env, _ = constrained(
        [{"fault": "increased_drag", "onset": 0.5, "severity": 1.0}], diagnoser=Certain()
    )
    _, reward, done, _ = env.step(np.zeros((3, 1), np.float32))
    assert done.all() and reward == pytest.approx([0.0] * 3)
    env, _ = constrained([{"fault": "increased_drag", "onset": 1.5, "severity": 1.0}])
    rewards = [env.step(np.zeros((3, 1), np.float32))[1] for _ in range(4)]
    assert rewards == [pytest.approx([0.0] * 3)] * 4


def test_no_episode_overdraws_its_budget_and_the_next_begins_with_all_of_it():
    env, first = constrained(budget=0.02)
    whole = 0.02**2 * EPISODE_TIME
    np.testing.assert_allclose(first[:, ALLOWANCE], np.log1p(whole / LARGEST_OFFSET**2), rtol=1e-6)
    costs = []
    for k in range(1, 6):
        observation, _, done, infos = env.step(np.full((3, 1), -1.0, np.float32))
        costs.append([info["cost"] for info in infos])
        last = (
            [info["terminal_observation"][ALLOWANCE] for info in infos]
            if k == 5
            else observation[:, ALLOWANCE]
        )
        left = np.maximum(whole - np.sum(costs, axis=0), 0.0)
        np.testing.assert_allclose(last, np.log1p(left / LARGEST_OFFSET**2), atol=1e-4)
    np.testing.assert_allclose(np.sum(costs, axis=0), whole, rtol=1e-5)
    assert done.all() and costs[-1] == pytest.approx([0.0] * 3, abs=1e-8)
    np.testing.assert_array_equal(observation[:, ALLOWANCE], first[:, ALLOWANCE])


def test_smaller_budgets_are_drawn_from_the_seed():
    (_, first) = constrained(least=0.4, n_lanes=200)
    (_, again) = constrained(least=0.4, n_lanes=200)
    np.testing.assert_array_equal(first, again)
    share = np.sqrt(np.expm1(first[:, ALLOWANCE]) * LARGEST_OFFSET**2 / EPISODE_TIME) / BUDGET
    assert 0.4 < share.min() < 0.45 and 0.95 < share.max() < 1.0 and abs(share.mean() - 0.7) < 0.05


@pytest.mark.parametrize(("share", "overdraft"), [(0.0, -1.0), (1.0, 0.0), (1.2, 0.44), (3.0, 1.0)])
def test_price_follows_the_overdraft_of_the_healthy(share, overdraft):
    env, _ = constrained()
    env.price = 0.1
    observations = [env.step(np.full((3, 1), 0.5, np.float32))[0] for _ in range(4)]
    env.update_price(
        np.array(observations), np.full((4, 3), share * HEALTHY_SHARE * BUDGET / AMPLITUDE)
    )
    # 1 at most: the square would be 8 over
    assert env.price == pytest.approx(0.1 + PRICE_RATE * overdraft, abs=1e-6)


def test_what_faulty_vehicles_do_and_what_the_allowance_forbids_is_no_overdraft():
    for env, observations in (constrained(GONE[:1]), constrained(budget=0.001)):
        env.price = 0.1
        env.step(np.ones((3, 1), np.float32))
        env._healthy_budgets = [np.array([env.venv.env.budget**2, np.nan, np.nan])]
        env.update_price(observations[None], np.array([[0.0, 1.0, 1.0]]))
        assert env.price == pytest.approx(0.1 - PRICE_RATE, abs=1e-6)


def test_price_and_overdraft_are_relative_to_the_budget_of_the_episode():
    env, first = constrained(least=0.4, n_lanes=50)
    budget = np.sqrt(np.expm1(first[:, ALLOWANCE]) * LARGEST_OFFSET**2 / EPISODE_TIME)
    env.price = 0.5
    offsets = 0.1 * budget
    observation, reward, *_ = env.step((offsets / AMPLITUDE).astype(np.float32)[:, None])
    still, _ = constrained(least=0.4, n_lanes=50)
    free = still.step(np.zeros((50, 1), np.float32))[1]
    assert np.ptp(budget) > 0.03
    np.testing.assert_allclose(reward, free - 0.5 * 0.1**2, atol=1e-5)
    env.update_price(observation[None], np.sqrt(1.5) * HEALTHY_SHARE * (budget / AMPLITUDE)[None])
    assert env.price == pytest.approx(0.5 + PRICE_RATE * 0.5, abs=1e-6)


def test_price_never_falls_below_nothing_and_forgets_the_rollout_before():
    env, _ = constrained()
    env.price = 0.0
    observation = env.step(np.zeros((3, 1), np.float32))[0][None]
    env.update_price(observation, np.zeros((1, 3)))
    assert env.price == 0.0
    env.step(np.ones((3, 1), np.float32))
    env.update_price(observation, np.ones((1, 3)))
    assert env.price == pytest.approx(PRICE_RATE)


def test_reset_begins_to_count_anew():
    env, _ = constrained()
    for _ in range(5):
        env.step(np.ones((3, 1), np.float32))
    assert len(env.outcomes.ended) == 3
    env.reset()
    assert not env.outcomes.ended
