"""The learned policy: equal to what PPO has trained, kept on disk as data, and run without
stable-baselines3.
"""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import torch

from auv_fault_env.errors import InputError
from diagnosers import storage
from training.learning.agent import Agent
from training.stimuli.policy import LearnedPolicy, policy_shapes
from training.stimuli.policy_inputs import BOUNDS, FEATURES

LOW, HIGH = np.array(list(BOUNDS.values()), np.float32).T


@pytest.fixture(scope="module")
def agent():
    with_truth = np.append(LOW, 0.0).astype(np.float32), np.append(HIGH, 1.0).astype(np.float32)
    spaces = gym.spaces.Box(*with_truth), gym.spaces.Box(-1.0, 1.0, (1,))
    with torch.random.fork_rng():
        torch.manual_seed(3)
        agent = Agent(*spaces, lambda _: 1e-3, n_truth=1)
        for parameter in agent.parameters():
            torch.nn.init.normal_(parameter, std=0.3)
    return agent


@pytest.fixture
def policy(agent):
    return LearnedPolicy(agent.policy_tensors(), "filter_bank")


@pytest.fixture
def features():
    return np.random.default_rng(0).uniform(LOW, HIGH, (50, len(FEATURES))).astype(np.float32)


def predicted(agent, features):
    """Actions of the agent without noise; the truth does not count."""
    truth = np.random.default_rng(1).uniform(size=(len(features), 1)).astype(np.float32)
    return agent.predict(np.hstack([features, truth]), deterministic=True)[0]


def test_actions_are_the_deterministic_ones_of_the_agent(agent, policy, features):
    action = policy.action(features)
    assert action.shape == (50, 1) and action.dtype == np.float32
    assert np.ptp(action) > 0.5 and np.abs(action).max() <= 1.0
    np.testing.assert_allclose(action, predicted(agent, features), rtol=0, atol=1e-6)


def test_one_lane_is_as_many(policy, features):
    alone = np.concatenate([policy.action(row[None]) for row in features])
    np.testing.assert_array_equal(alone, policy.action(features))


def test_a_copy_outlives_later_training(agent, policy, features):
    before = policy.action(features)
    with torch.no_grad():
        agent.action_net[0].bias += 1.0
    after = predicted(agent, features)
    with torch.no_grad():
        agent.action_net[0].bias -= 1.0
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_array_equal(policy.action(features), before)


def test_file_gives_the_same_policy(policy, features, tmp_path):
    path = tmp_path / "policy.safetensors"
    policy.save(path)
    loaded = LearnedPolicy.load(path)
    assert (loaded.diagnoser, loaded.classes) == (policy.diagnoser, policy.classes)
    np.testing.assert_array_equal(loaded.action(features), policy.action(features))


def test_loader_needs_no_stable_baselines3(policy, tmp_path):
    policy.save(tmp_path / "policy.safetensors")
    code = (
        "import sys; sys.modules['stable_baselines3'] = None; import numpy as np; "
        "from training.stimuli.policy import FEATURES, LearnedPolicy; "
        f"policy = LearnedPolicy.load({str(tmp_path / 'policy.safetensors')!r}); "
        "print(policy.action(np.zeros((2, len(FEATURES)))).shape)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == "(2, 1)\n", run.stderr


def header(**changes):
    return {"features": FEATURES, "diagnoser": "filter_bank"} | changes


SWAPPED = [FEATURES[1], FEATURES[0], *FEATURES[2:]]
WRONG = {
    "fewer features": (
        header(features=FEATURES[:-1]),
        r"features of the policy .*: got '30 features'; allowed is the 31 ",
    ),
    "other order": (
        header(features=SWAPPED),
        r"got \"31 features, number 1 'log_odds:increased_drag'\"",
    ),
    "a diagnoser's weights": (
        {"diagnoser": "integrated", "settings": {}},
        "features of the policy .*: got None",
    ),
    "no object": ([1, 2], "features of the policy .*: got None"),
    "diagnoser": (header(diagnoser=3), "diagnoser of the policy .*: got 3"),
}


@pytest.mark.parametrize(("header", "message"), WRONG.values(), ids=WRONG)
def test_a_file_of_another_layout_is_refused_in_one_line(agent, tmp_path, header, message):
    storage.write(tmp_path / "policy.safetensors", agent.policy_tensors(), header)
    with pytest.raises(InputError, match=message) as caught:
        LearnedPolicy.load(tmp_path / "policy.safetensors")
    assert "\n" not in str(caught.value)


def test_other_tensors_are_refused(agent, tmp_path):
    tensors = agent.policy_tensors()
    for wrong in (
        tensors | {"first_bias": np.zeros(3, np.float32)},
        {"first_bias": tensors["first_bias"]},
    ):
        storage.write(tmp_path / "policy.safetensors", wrong, header())
        with pytest.raises(InputError, match=r"tensors of .*allowed is its architecture"):
            LearnedPolicy.load(tmp_path / "policy.safetensors")
        with pytest.raises(InputError, match="tensors of the policy"):
            LearnedPolicy(wrong, "filter_bank")
    assert {name: tensor.shape for name, tensor in tensors.items()} == policy_shapes(31)


def test_a_damaged_file_is_refused(policy, tmp_path):
    path = tmp_path / "policy.safetensors"
    with pytest.raises(InputError, match=r"weights file: got .* an existing safetensors file"):
        LearnedPolicy.load(path)
    policy.save(path)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="complete safetensors file"):
        LearnedPolicy.load(path)


@pytest.mark.parametrize("shape", [(31,), (2, 30), (1, 2, 31)])
def test_features_of_another_shape_are_refused(policy, shape):
    with pytest.raises(InputError, match="shape of the features"):
        policy.action(np.zeros(shape))
