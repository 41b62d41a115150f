"""Fleets as a `VecEnv` against stable-baselines3's own `DummyVecEnv` over single environments."""

import time

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from auv_fault_env.errors import InputError
from training.active_env import NAME as ACTIVE
from training.sb3 import FleetVecEnv

PLANT = "auv_fault_env/Propulsion-v0"
LANES = 3
LIMIT = 6
GONE = [{"fault": "propeller_loss:port", "onset": 0.3, "severity": 1.0}]
# of each environment arguments that let episodes end by time, and by a declaration
SETTINGS = {PLANT: {"action": "residual"}, ACTIVE: {"diagnoser": "filter_bank"}}
EACH = pytest.mark.parametrize("name", SETTINGS)


def fleet(name, n_lanes=LANES, limit=LIMIT, **settings):
    given = SETTINGS[name] | {"autoreset_mode": "SameStep", "max_episode_steps": limit} | settings
    return FleetVecEnv(gym.make_vec(name, n_lanes, "vector_entry_point", **given))


def pair(name, **settings):
    """The fleet, and what it must equal."""
    given = SETTINGS[name] | {"max_episode_steps": LIMIT} | settings
    return fleet(name, **settings), DummyVecEnv([lambda: gym.make(name, **given)] * LANES)


def assert_same(ours, theirs):
    """Equality to the bit of arrays, numbers and nested information, types included."""
    if isinstance(theirs, str):
        assert ours == theirs
        return
    assert type(ours) is type(theirs)
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for name in ours:
            assert_same(ours[name], theirs[name])
    elif isinstance(ours, list):
        assert len(ours) == len(theirs)
        for pair_of_values in zip(ours, theirs, strict=True):
            assert_same(*pair_of_values)
    else:
        assert np.asarray(ours).dtype == np.asarray(theirs).dtype
        assert np.asarray(ours).tobytes() == np.asarray(theirs).tobytes()


@EACH
@pytest.mark.parametrize(
    "options", [None, {"schedule": GONE, "mission": "cruise"}], ids=["sampled", "given"]
)
@pytest.mark.parametrize("truth", ["label", "full"])
def test_every_step_equals_dummy_vec_env(name, options, truth):
    envs = pair(name, truth=truth)
    for env in envs:
        env.seed(7)
        env.set_options(options)
    assert_same(*(env.reset() for env in envs))
    random = np.random.default_rng(0)
    ends = set()
    for _ in range(2 * LIMIT + 1):
        actions = random.uniform(-1.2, 1.2, (LANES, *envs[0].action_space.shape))
        ours, theirs = (env.step(actions.astype(np.float32)) for env in envs)
        for result, expected in zip(ours, theirs, strict=True):
            assert_same(result, expected)
        assert_same(*(env.reset_infos for env in envs))
        ends |= {info["TimeLimit.truncated"] for info in ours[3] if "terminal_observation" in info}
    assert True in ends
    assert (False in ends) == (name == ACTIVE and options is not None)


@EACH
def test_seeds_and_options_count_once_and_the_next_reset_goes_on(name):
    envs = pair(name)
    for env in envs:
        env.seed(3)
        env.set_options({"schedule": [], "mission": 0.3})
        env.reset()
    assert_same(*(env.reset() for env in envs))
    assert_same(*(env.reset_infos for env in envs))


def test_an_unseeded_reset_differs_from_the_last():
    env = fleet(PLANT)
    env.seed(None)
    assert env.reset().tobytes() != env.reset().tobytes()


@EACH
def test_options_of_each_lane(name):
    envs = pair(name, truth="full")
    for env in envs:
        env.seed(3)
        env.set_options([{"schedule": GONE if lane % 2 else []} for lane in range(LANES)])
    assert_same(*(env.reset() for env in envs))
    assert [info["truth"]["onset"] for info in envs[0].reset_infos] == [np.inf, 0.3, np.inf]
    envs[0].set_options([{"mission": "cruise"}, *[{}] * (LANES - 1)])
    with pytest.raises(InputError, match=r"reset option mission.*all lanes or none"):
        envs[0].reset()


@EACH
def test_what_a_step_returns_is_the_caller_s_own(name):
    envs = pair(name)
    for env in envs:
        env.seed(1)
        env.reset()
    for _ in range(LIMIT + 1):
        actions = np.ones((LANES, *envs[0].action_space.shape), np.float32)
        ours, theirs = (env.step(actions) for env in envs)
        assert_same(list(ours), list(theirs))
        for values in ours[:3]:
            values[:] = 1
        for info in ours[3]:
            for value in info.values():
                if np.ndim(value):
                    value[:] = 1


@EACH
def test_attributes_are_those_that_dummy_vec_env_gives(name):
    envs = pair(name)
    for attribute in ("action_space", "observation_space", "render_mode"):
        assert_same(*([repr(value) for value in env.get_attr(attribute)] for env in envs))
    assert [env.has_attr("no_such") for env in envs] == [False, False]
    assert envs[0].get_attr("fleet", [0, 2]) == [envs[0].env.unwrapped.fleet] * 2
    assert envs[0].env_is_wrapped(gym.Wrapper) == [False] * LANES


def test_all_lanes_are_set_and_called_at_once():
    env = fleet(ACTIVE)
    env.set_attr("cost_weight", 2.0)
    assert env.get_attr("cost_weight") == [2.0] * LANES
    env.env_method("set_distributions", {"healthy": 1.0})
    assert env.get_attr("fleet")[0].schedules.healthy == 1.0
    env.set_attr("cost_weight", 3.0, indices=range(LANES))
    for call in (
        lambda: env.set_attr("cost_weight", 4.0, indices=0),
        lambda: env.env_method("set_distributions", indices=[1, 2]),
    ):
        with pytest.raises(InputError, match=r"indices of .* allowed is all lanes"):
            call()
    assert env.get_attr("cost_weight") == [3.0] * LANES


def test_attributes_and_methods_are_found_behind_wrappers():
    inner = gym.make_vec(PLANT, LANES, "vector_entry_point", autoreset_mode="SameStep")
    env = FleetVecEnv(gym.wrappers.vector.RescaleAction(inner, np.float32(-2), np.float32(2)))
    assert env.get_attr("action_space")[0].high == pytest.approx(2.0)
    env.env_method("set_distributions", {"healthy": 1.0})
    assert env.get_attr("fleet")[0].schedules.healthy == 1.0
    assert not env.has_attr("no_such")


def test_frames_are_tiled():
    pytest.importorskip("pygame")
    env = fleet(PLANT, 2, render_mode="rgb_array")
    env.reset()
    height, width, _ = env.get_images()[0].shape
    assert env.render().shape in {(height, 2 * width, 3), (2 * height, width, 3)}
    env.close()


def test_environments_that_it_cannot_drive_are_refused():
    later = gym.make_vec(PLANT, 2, "vector_entry_point")
    with pytest.raises(
        InputError, match=r"got 'NextStep'; allowed is SameStep; make .*='SameStep'"
    ):
        FleetVecEnv(later)
    with pytest.raises(InputError, match=r"environment: got 'str'; allowed is a gym\.vector"):
        FleetVecEnv(PLANT)


def test_other_vector_environments_of_gymnasium_run_too():
    mode = gym.vector.AutoresetMode.SAME_STEP
    made = [lambda: gym.make("Pendulum-v1", max_episode_steps=5)] * 2
    env = FleetVecEnv(gym.vector.SyncVectorEnv(made, autoreset_mode=mode))
    theirs = DummyVecEnv(made)
    for one in (env, theirs):
        one.seed(1)
        one.reset()
    for _ in range(11):
        ours, expected = (one.step(np.zeros((2, 1), np.float32)) for one in (env, theirs))
        np.testing.assert_allclose(ours[0], expected[0])
        assert [set(info) for info in ours[3]] == [set(info) for info in expected[3]]


OFF_POLICY = {"learning_starts": 8, "batch_size": 8, "buffer_size": 200}
ALGORITHMS = {
    "PPO": (PPO, "MlpPolicy", {"n_steps": 8, "batch_size": 12, "n_epochs": 1}),
    "SAC": (SAC, "MlpPolicy", OFF_POLICY),
    "TD3": (TD3, "MlpPolicy", OFF_POLICY),
    "RecurrentPPO": (
        "RecurrentPPO",
        "MlpLstmPolicy",
        {"n_steps": 8, "batch_size": 12, "n_epochs": 1},
    ),
}


@EACH
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_algorithms_learn_on_it(name, algorithm):
    kind, policy, settings = ALGORITHMS[algorithm]
    if isinstance(kind, str):
        kind = getattr(pytest.importorskip("sb3_contrib"), kind)
    env = VecMonitor(VecNormalize(fleet(name)))
    model = kind(policy, env, seed=0, device="cpu", **settings)
    before = [values.clone() for values in model.policy.parameters()]
    model.learn(60)
    after = model.policy.parameters()
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    lengths = {info["l"] for info in model.ep_info_buffer}
    assert lengths and lengths <= set(range(1, LIMIT + 1))
    mean, _ = evaluate_policy(model, VecMonitor(fleet(name)), n_eval_episodes=4)
    assert np.isfinite(mean)
    if algorithm in ("SAC", "TD3") and name == PLANT:
        assert model.replay_buffer.timeouts.any()  # an end by time is none for the value


def seconds_of_a_step(env, n_steps):
    action = np.zeros((env.num_envs, *env.action_space.shape), np.float32)
    env.reset()
    start = time.process_time()
    for _ in range(n_steps):
        env.step(action)
    return (time.process_time() - start) / n_steps


def test_64_lanes_cost_a_fifth_of_dummy_vec_env_at_most():
    many = DummyVecEnv([lambda: gym.make(PLANT)] * 64)
    ours = min(seconds_of_a_step(fleet(PLANT, 64, 100), 20) for _ in range(3))
    assert ours < 0.2 * min(seconds_of_a_step(many, 5) for _ in range(3))
