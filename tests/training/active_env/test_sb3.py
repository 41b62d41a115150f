"""The fleet as a `VecEnv` against stable-baselines3's own `DummyVecEnv` over single environments,
step by step.
"""

from collections.abc import Mapping

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from auv_fault_env.errors import InputError
from training.active_env import NAME, ActiveDiagnosisVectorEnv
from training.active_env.sb3 import ActiveVecEnv

LANES = 5
LIMIT = 12
GONE = [{"fault": "propeller_loss:port", "onset": 3.0, "severity": 1.0}]


def pair(**settings):
    """The adapter, and what it must equal."""
    adapter = ActiveVecEnv(ActiveDiagnosisVectorEnv(LANES, LIMIT, **settings))
    reference = DummyVecEnv(
        [lambda: gym.make(NAME, max_episode_steps=LIMIT, horizon=LIMIT, **settings)] * LANES
    )
    return adapter, reference


def assert_same(first, second):
    """Equality of arrays, and of nested information that may hold arrays too, types of its values
    included.
    """
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        assert first.keys() == second.keys()
        for name in first:
            assert_same(first[name], second[name])
    elif isinstance(first, np.ndarray):
        assert first.dtype == second.dtype and first.tobytes() == second.tobytes()
    else:
        assert type(first) is type(second) and first == second


@pytest.mark.parametrize("given", [False, True], ids=["sampled", "given_fault_and_mission"])
def test_every_step_equals_dummy_vec_env(given):
    envs = pair()
    random = np.random.default_rng(0)
    ends = []
    for env in envs:
        env.seed(7)
        env.set_options({"schedule": GONE, "mission": "cruise"} if given else None)
    assert_same(*(env.reset() for env in envs))
    for _ in range(3 * LIMIT):
        actions = random.uniform(-1.2, 1.2, (LANES, 1)).astype(np.float32)
        ours, theirs = (env.step(actions) for env in envs)
        for result, expected in zip(ours[:3], theirs[:3], strict=True):
            assert_same(result, expected)
        for result, expected in zip(
            ours[3] + envs[0].reset_infos, theirs[3] + envs[1].reset_infos, strict=True
        ):
            assert_same(result, expected)
        ends += [
            (info["TimeLimit.truncated"], info["declared"])
            for info in ours[3]
            if "terminal_observation" in info
        ]
    assert (True, "normal") in ends
    assert not given or (False, "propeller_loss:port") in ends


def test_seeds_and_options_count_once_and_the_next_reset_goes_on():
    adapter, reference = pair()
    for env in (adapter, reference):
        env.seed(3)
        env.set_options({"schedule": [], "mission": 0.3})
        env.reset()
    assert_same(adapter.reset(), reference.reset())
    for mine, theirs in zip(adapter.reset_infos, reference.reset_infos, strict=True):
        assert_same(mine, theirs)


def test_a_lane_s_truth_can_be_read_after_later_steps():
    adapter, _ = pair()
    adapter.seed(3)
    adapter.set_options({"schedule": GONE, "mission": "cruise"})
    adapter.reset()
    actions = np.zeros((LANES, 1), np.float32)
    infos = [adapter.step(actions)[3][2] for _ in range(4)]
    assert [info["truth"]["label"] for info in infos] == ["normal"] * 3 + ["propeller_loss:port"]
    assert infos[3]["truth"]["severity"]["propeller_loss:port"] == 1.0


def test_options_of_each_lane():
    adapter, reference = pair()
    options = [{"schedule": GONE if lane % 2 else []} for lane in range(LANES)]
    for env in (adapter, reference):
        env.seed(3)
        env.set_options(options)
    assert_same(adapter.reset(), reference.reset())
    assert [info["truth"]["onset"] for info in adapter.reset_infos] == [
        np.inf,
        3.0,
        np.inf,
        3.0,
        np.inf,
    ]
    adapter.set_options([{"mission": "cruise"}, *[{}] * (LANES - 1)])
    with pytest.raises(InputError, match=r"reset option mission.*all lanes or none"):
        adapter.reset()


def test_what_a_step_returns_is_the_caller_s_own():
    adapter, reference = pair()
    for env in (adapter, reference):
        env.seed(1)
        env.reset()
    for _ in range(LIMIT + 1):
        mine, theirs = (env.step(np.ones((LANES, 1), np.float32)) for env in (adapter, reference))
        assert_same(mine[0], theirs[0])
        for values in mine[:3]:
            values[:] = 1


def test_attributes_and_methods():
    adapter, _ = pair(amplitude=0.1)
    assert (
        adapter.get_attr("amplitude") == [0.1] * LANES
        and adapter.get_attr("amplitude", [0, 2]) == [0.1] * 2
    )
    adapter.set_attr("cost_weight", 2.0)
    assert adapter.env.cost_weight == 2.0
    assert adapter.env_is_wrapped(gym.Wrapper) == [False] * LANES
    assert adapter.env_method("__repr__", indices=1) == ["ActiveDiagnosisVectorEnv(num_envs=5)"]
    adapter.close()


def test_an_environment_that_resets_on_the_next_step_is_refused():
    with pytest.raises(InputError, match="autoreset_mode: got 'NextStep'; allowed is SameStep"):
        ActiveVecEnv(ActiveDiagnosisVectorEnv(2, autoreset_mode="NextStep"))


def test_ppo_learns_on_it():
    env = VecMonitor(ActiveVecEnv(ActiveDiagnosisVectorEnv(4, 8)))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [values.clone() for values in model.policy.parameters()]
    model.learn(128)
    assert any(
        (old != new).any() for old, new in zip(before, model.policy.parameters(), strict=True)
    )
    assert model.ep_info_buffer and {info["l"] for info in model.ep_info_buffer} <= set(range(1, 9))
