"""TorchRL takes both environments as `GymEnv`, in vectors of its own and as native vectors."""

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper, ParallelEnv, SerialEnv
from torchrl.envs.utils import RandomPolicy, check_env_specs

LIBRARY = "torchrl"
LANES = 2
STEPS = 150
LIMIT = 40
INFORMATION = ("cost", "energy", "mission_speed", "true_class")


def native(mode, name, **limit):
    many = gym.make_vec(name, LANES, "vector_entry_point", autoreset_mode=mode, **limit)
    return GymWrapper(many)


def informed(*arguments, **limit):
    return GymEnv(*arguments, **limit).auto_register_info_dict()


def vector(kind, name, **limit):
    return kind(LANES, partial(GymEnv, name, **limit))


FORMS = {
    "`GymEnv`": GymEnv,
    "`GymEnv` with the information reader": informed,
    "`GymEnv(num_envs=2)`, information included": partial(GymEnv, num_envs=LANES),
    "`SerialEnv`": partial(vector, SerialEnv),
    "`ParallelEnv`": partial(vector, ParallelEnv),
    "the native vector that resets within the step": partial(native, "SameStep"),
    "the native vector that TorchRL resets": partial(native, "Disabled"),
}


@pytest.mark.parametrize("form", FORMS)
def test_rollout(environment, form):
    """`check_env_specs` and a rollout over several episodes in {form}"""
    env = FORMS[form](environment, max_episode_steps=LIMIT)
    check_env_specs(env)
    steps = env.rollout(STEPS, break_when_any_done=False)
    assert steps.batch_size[-1] == STEPS
    assert steps["next", "done"].sum() >= STEPS // LIMIT
    assert steps["next", "observation"].isfinite().all()
    assert steps["next", "reward"].std() > 0
    if "information" in form:
        assert set(INFORMATION) <= set(steps["next"].keys())
        assert steps["next", "energy"].max() > 0
    env.close()


def test_the_rollout_is_the_episode(environment):
    """A rollout in `GymEnv` equals the steps of the environment to the bit"""
    env = GymEnv(environment)
    env.set_seed(3)  # resets with the seed; the rollout begins with another reset
    steps = env.rollout(20)
    ours = gym.make(environment)
    ours.reset(seed=3)
    observation, _ = ours.reset()
    for action, theirs in zip(steps["action"], steps["observation"], strict=True):
        np.testing.assert_array_equal(theirs.numpy(), observation)
        observation, *_ = ours.step(action.numpy())


def test_collector(environment):
    """A `Collector` over `GymEnv` collects frames"""
    env = GymEnv(environment)
    collector = Collector(
        env, RandomPolicy(env.action_spec), frames_per_batch=100, total_frames=200
    )
    assert sum(batch.numel() for batch in collector) == 200
    collector.shutdown()
