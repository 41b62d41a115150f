"""The learned stimulus: the same closed loop as the environment it was trained in, and policies
that are data.
"""

import numpy as np
import pytest

from auv_fault_env import FaultEvent, Fleet, classes
from auv_fault_env.channels import INDEX
from auv_fault_env.errors import InputError
from diagnosers import Belief, make, storage
from training.active_env import FEATURES as ENV_FEATURES
from training.learning import budgeted
from training.learning.budgeted import BudgetedVecEnv
from training.stimuli import STIMULI
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES
from training.stimuli.learned import Learned, LearnedHeld
from training.stimuli.light_bank import light_bank
from training.stimuli.policy import REACH, LearnedPolicy, policy_shapes
from training.studies.stimulus_comparisons import LEARNED as SEEDS_OF_TRAINING

SEEDS = (3, 4, 5)
DECISIONS = 13
SCHEDULES = [
    (),
    (FaultEvent("increased_drag", 12.2, 0.9),),
    (FaultEvent("propeller_damage:port", 11.5, 0.5),),
]
MISSIONS = [0.25, 0.3, 0.4]
LEARNED = [name for name in STIMULI if SEEDS_OF_TRAINING.fullmatch(name)]


def random_policy(seed, scale=0.3):
    random = np.random.default_rng(seed)
    tensors = {
        name: random.normal(0.0, scale, shape).astype(np.float32)
        for name, shape in policy_shapes(31).items()
    }
    return LearnedPolicy(tensors, "filter_bank")


@pytest.fixture
def policy(tmp_path, monkeypatch):
    monkeypatch.setattr(storage, "WEIGHTS", tmp_path)
    made = random_policy(0, 0.06)
    made.save(tmp_path / "stimulus-filter_bank-0.safetensors")
    return made


def test_it_acts_as_the_policy_does_in_its_environment(policy, monkeypatch):
    monkeypatch.setattr(budgeted, "BUDGETS", (0.1, 0.1))
    env = BudgetedVecEnv(3, light_bank())
    env.venv._seeds = list(SEEDS)
    env.venv._options = [
        {"schedule": s, "mission": m} for s, m in zip(SCHEDULES, MISSIONS, strict=True)
    ]
    features = env.reset()
    seen = [ENV_FEATURES.index(name) for name in policy.features]
    fleet = Fleet(3)
    bank = light_bank()
    stimulus = LearnedHeld(0.1)
    reading = fleet.reset(SEEDS, schedules=SCHEDULES, missions=MISSIONS)
    bank.reset(3)
    moved = 0.0
    for k in range(DECISIONS):
        features, _, done, _ = env.step(policy.action(features[:, seen]))
        assert not done.any()
        for sample in range(10 * k, 10 * k + 10):
            offset = stimulus.offset(sample, reading, bank.update(reading))
            moved += float(np.abs(offset).mean())
            command = reading[:, INDEX["mission_speed"]] + offset
            reading = fleet.step(np.column_stack([command, np.zeros((3, 2))]))
        # actions are float32 there
        np.testing.assert_allclose(reading, env.env._readings, rtol=1e-5, atol=1e-5)
    assert moved / (10 * DECISIONS) > 0.01


def test_offsets_scale_with_the_budget_and_keep_to_it(tmp_path, monkeypatch):
    monkeypatch.setattr(storage, "WEIGHTS", tmp_path)
    eager = random_policy(0)
    eager.tensors["action_bias"][:] = 100.0
    eager.save(tmp_path / "stimulus-filter_bank-0.safetensors")
    n_classes = len(classes())
    reading = Fleet(1).reset([1], schedules=[()], missions=[0.3])
    nothing = np.zeros((1, n_classes))
    doubt = Belief(np.full((1, n_classes), -np.log(n_classes)), nothing, nothing)
    for budget in (0.02, 0.04):
        stimulus = Learned(budget)
        offsets = np.array([stimulus.offset(k, reading, doubt)[0] for k in range(100)])
        assert offsets[0] == pytest.approx(REACH * budget)
        assert np.square(offsets).sum() <= N_SAMPLES * budget**2 * (1.0 + 1e-9)
        assert offsets[-1] < 0.1 * offsets[0]
    largest = Learned(0.4).offset(0, reading, doubt)
    assert largest[0] == LARGEST_OFFSET


def test_it_is_asked_at_every_sample_and_may_be_held_for_a_second(policy):
    n_classes = len(classes())
    random = np.random.default_rng(2)
    reading = Fleet(1).reset([1], schedules=[()], missions=[0.3])
    nothing = np.zeros((1, n_classes))
    beliefs = [
        Belief(np.log(random.dirichlet(np.ones(n_classes), 1)), nothing, nothing) for _ in range(30)
    ]
    quick, held = (
        [float(stimulus.offset(k, reading, belief)[0]) for k, belief in enumerate(beliefs)]
        for stimulus in (Learned(0.1), LearnedHeld(0.1))
    )
    assert len(set(quick)) == 30 and quick[0] == held[0]
    assert [len(set(held[k : k + 10])) for k in (0, 10, 20)] == [1, 1, 1] and len(set(held)) == 3


def test_results_depend_on_the_file_of_the_policy(policy, tmp_path):
    before = Learned().policy_digest
    random_policy(1).save(tmp_path / "stimulus-filter_bank-0.safetensors")
    assert Learned().policy_digest != before != ""
    assert STIMULI["thesis"]().policy_digest == ""


def test_a_missing_or_damaged_policy_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(storage, "WEIGHTS", tmp_path)
    (tmp_path / "stimulus-filter_bank-0.safetensors").write_bytes(b"\x80\x04nothing")
    reading = Fleet(1).reset([1], schedules=[()], missions=[0.3])
    bank = make("filter_bank")
    bank.reset(1)
    with pytest.raises(InputError, match=r"stimulus-filter_bank-0\.safetensors"):
        Learned().offset(0, reading, bank.update(reading))


@pytest.mark.parametrize("name", LEARNED)
def test_every_policy_of_the_package_was_trained_with_its_own_seed(name):
    stimulus = STIMULI[name]()
    policy = LearnedPolicy.load(
        storage.WEIGHTS / f"stimulus-filter_bank-{stimulus.training_seed}.safetensors"
    )
    assert policy.diagnoser == "filter_bank"
    assert len({STIMULI[other]().policy_digest for other in LEARNED}) == len(LEARNED) == 5
