"""Arguments of the active environment: diagnosers of any kind, rewards, plant, truth; and JSON."""

import threading

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import diagnosers
from auv_fault_env import PRESETS, ScheduleSampler, Vehicle, classes
from auv_fault_env.env import PropulsionVectorEnv
from auv_fault_env.errors import InputError
from diagnosers import Belief, Recursive
from diagnosers.filter_bank import FilterBank
from training.active_env import (
    FEATURES,
    NAME,
    ActiveDiagnosisEnv,
    ActiveDiagnosisVectorEnv,
    log_probability_gain,
)

N = 3
LIMIT = 4
GONE = [{"fault": "propeller_loss:port", "onset": 1.0, "severity": 1.0}]
PLACE = f"{__name__}:"


class Foreign:
    """Keeps the protocol and nothing else: not `Recursive`, classes in an order of its own."""

    def __init__(self):
        self._inner = diagnosers.make("limits")
        self.classes = (classes()[0], *classes()[-2:0:-1], classes()[-1])
        self.n_updates = 0

    def reset(self, n_lanes):
        self._inner.reset(n_lanes)

    def update(self, observation):
        self.n_updates += 1
        belief = self._inner.update(observation)
        observation[:] = 0.0  # what a careless one may do
        columns = [classes().index(name) for name in self.classes]
        return Belief(*(values[:, columns] for values in belief))


class Locked(Foreign):
    """Cannot be copied."""

    def __init__(self):
        super().__init__()
        self._lock = threading.Lock()


def made():
    return Foreign()


def thrift(decision):
    return -decision.cost - 2.0 * decision.energy


SAME_AS_LIMITS = {
    "mapping": {"name": "limits", "vehicle": "thesis1992"},
    "recursion": diagnosers.make("limits"),
    "object": Foreign(),
    "class": Foreign,
    "function": made,
    "lambda": lambda: Foreign(),
    "uncopied": Locked,
    "place of a class": f"{PLACE}Foreign",
    "place of a function": f"{PLACE}made",
}


def run(env, n_steps=2 * LIMIT + 1, seed=5):
    """Observations, rewards and ends of random actions."""
    random = np.random.default_rng(0)
    rows = [env.reset(seed=seed)[0]]
    for _ in range(n_steps):
        rows += env.step(random.uniform(-1.0, 1.0, env.action_space.shape))[:4]
    return b"".join(np.asarray(row).tobytes() for row in rows)


def many(**settings):
    return gym.make_vec(NAME, N, "vector_entry_point", max_episode_steps=LIMIT, **settings)


@pytest.mark.parametrize("diagnoser", SAME_AS_LIMITS.values(), ids=SAME_AS_LIMITS)
def test_every_way_to_give_a_diagnoser_is_the_same_also_after_json(diagnoser, request):
    env = many(diagnoser=diagnoser)
    expected = run(many(diagnoser="limits"))
    assert run(env) == expected
    if "lambda" in request.node.name or diagnoser is SAME_AS_LIMITS["object"]:
        with pytest.raises(TypeError):
            env.spec.to_json()
    else:
        assert run(gym.make_vec(EnvSpec.from_json(env.spec.to_json()))) == expected


def test_a_given_object_is_not_touched_and_lanes_do_not_share_it():
    mine = Foreign()
    run(many(diagnoser=mine))
    assert mine.n_updates == 0
    one = Foreign()
    with pytest.raises(InputError, match="the same object for two lanes"):
        many(diagnoser=lambda: one)


class Wrong(Recursive):
    """Gives the belief that it is made with."""

    def __init__(self, belief):
        self.belief = belief

    def initial(self, n_lanes):
        return (np.zeros(n_lanes),)

    def step(self, state, observation):
        return state, self.belief


def flat(**parts):
    zeros = np.zeros((N, len(classes())))
    usual = Belief(zeros - np.log(len(classes())), zeros, zeros)
    return usual._replace(**{name: part(getattr(usual, name)) for name, part in parts.items()})


WRONG_BELIEFS = {
    "type": ([1.0, 2.0], "belief is list"),
    "lanes": (flat(severity_std=lambda values: values[:1]), "severity_std has shape"),
    "sum": (flat(log_probability=lambda values: values + 1.0), "probabilities sum to 2.7"),
    "nan": (flat(severity_mean=lambda values: values * np.nan), "belief is NaN"),
}


@pytest.mark.parametrize(("belief", "message"), WRONG_BELIEFS.values(), ids=WRONG_BELIEFS)
def test_wrong_beliefs_are_refused_in_one_line(belief, message):
    env = many(diagnoser=Wrong(belief))
    with pytest.raises(
        InputError, match=f"belief of Wrong: got .*{message}.*check_diagnoser"
    ) as no:
        env.reset(seed=1)
    assert "\n" not in str(no.value)


WRONG = {
    "number": ({"diagnoser": 3}, r"diagnoser: got 3; allowed is a name of diagnosers\.NAMES"),
    "name": ({"diagnoser": "limit"}, "diagnoser: got 'limit'.*did you mean 'limits'"),
    "mapping": ({"diagnoser": {"vehicle": "remus100"}}, "diagnoser: got None; allowed is one of"),
    "settings": ({"diagnoser": {"name": "limits", "sed": 1}}, "settings of limits: got .*'sed'"),
    "module": ({"diagnoser": "no.such:Thing"}, "diagnoser: got 'no.such:Thing'; allowed is 'mod"),
    "place": ({"diagnoser": f"{PLACE}N"}, "diagnoser: got 3; allowed is"),
    "maker": ({"diagnoser": dict}, "diagnoser: got {}; allowed is an object with classes, reset"),
    "uncopied": ({"diagnoser": Locked()}, "one that can be copied.*function that makes one"),
    "vehicle": (
        {"diagnoser": "raw_network", "preset": "remus100"},
        "diagnoser: got 'raw_network'; allowed is one that takes a vehicle, for remus100",
    ),
    "shafts": ({"diagnoser": "cusum", "preset": "remus100"}, "shafts: got 1"),
    "reward": ({"reward": 1.0}, "reward: got 1.0; allowed is a function"),
    "reward place": ({"reward": "nowhere"}, "reward: got 'nowhere'; allowed is 'module:name'"),
    "two costs": (
        {"reward": thrift, "cost_weight": 1.0},
        "cost_weight: got 1.0; allowed is None beside a reward of your own",
    ),
    "amplitude": ({"amplitude": 1.1}, "amplitude: got 1.1; allowed is a number from 0.001 to 1"),
    "preset": ({"preset": "tethis"}, "preset: got 'tethis'"),
    "noise": ({"sensor_noise": -1.0}, "sensor_noise: got -1.0"),
    "realism": ({"realism": "high"}, "realism: got 'high'"),
    "imperfections": ({"imperfections": ["rust"]}, "got 'rust'"),
    "schedules": ({"schedules": 3}, "distribution: got 3"),
    "missions": ({"missions": {"sped": 1}}, "got 'sped'"),
    "truth": ({"truth": "all"}, "truth: got 'all'"),
    "declare": ({"declare": None}, "declare: got None"),
}


@pytest.mark.parametrize("kind", [ActiveDiagnosisEnv, lambda **given: many(**given)])
@pytest.mark.parametrize(("settings", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_refused_in_one_line(kind, settings, message):
    with pytest.raises(InputError, match=message) as refused:
        kind(**settings)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("reward", [thrift, f"{PLACE}thrift"], ids=["function", "place"])
def test_the_reward_is_a_function_of_the_decision_also_after_json(reward):
    env = many(reward=reward, diagnoser="null", autoreset_mode="NextStep")
    again = gym.make_vec(EnvSpec.from_json(env.spec.to_json()))
    for one in (env, again):
        one.reset(seed=2)
        _, rewards, _, _, info = one.step(np.full((N, 1), 0.4))
        np.testing.assert_array_equal(rewards, -info["cost"] - 2.0 * info["energy"])


def test_the_usual_reward_is_the_gain_minus_the_cost():
    seen = []

    def as_usual(decision):
        seen.append(decision)
        return log_probability_gain(decision) - 10.0 * decision.deviation

    given = {
        "diagnoser": "filter_bank",
        "schedules": ScheduleSampler(healthy=0.0, onset=(0.0, 0.5)),
    }
    assert run(many(**given)) == run(many(**given, reward=as_usual))
    last = seen[LIMIT - 1]
    assert last.time.tolist() == [LIMIT] * N and last.action.shape == (N,)
    assert (last.true_class > 0).all() and (np.abs(last.action) <= 1.0).all()
    earlier = seen[LIMIT - 2]
    np.testing.assert_array_equal(last.belief_before[0], earlier.belief[0])
    np.testing.assert_array_equal(last.true_class_before, earlier.true_class)


WRONG_REWARDS = {
    "shape": (lambda decision: 1.0, r"shape of the reward: got \(\); allowed is finite numbers of"),
    "nan": (lambda decision: decision.cost * np.nan, "result of the reward: got .nan"),
    "words": (lambda decision: ["high"] * N, "result of the reward: got .'high'"),
}


@pytest.mark.parametrize(("reward", "message"), WRONG_REWARDS.values(), ids=WRONG_REWARDS)
def test_wrong_rewards_are_refused_in_one_line(reward, message):
    env = many(reward=reward, diagnoser="null")
    env.reset(seed=1)
    with pytest.raises(InputError, match=message):
        env.step(np.zeros((N, 1)))


PLANTS = {
    "noise": {"sensor_noise": 3.0},
    "disturbance": {"disturbance": 0.0},
    "band": {"healthy_band": 0.0},
    "realism": {"realism": 1.0},
    "one imperfection": {"realism": 2.0, "imperfections": ["battery"]},
    "vehicle": {"preset": "remus100"},
    "fields": {"preset": {"alpha": -0.2}},
    "distributions": {"schedules": {"healthy": 0.0}, "missions": {"speed": [0.4, 0.5]}},
}


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_the_plant_is_that_of_propulsion_also_after_json(plant):
    env = many(diagnoser="null", truth="full", **plant)
    twin = PropulsionVectorEnv(N, truth="full", **plant)
    options = {} if "schedules" in plant else {"schedule": GONE, "mission": 0.4}
    for one in (env, gym.make_vec(EnvSpec.from_json(env.spec.to_json()))):
        one.reset(seed=4, options=options)
        readings, info = twin.reset(seed=4, options=options)
        energy = np.zeros(N)
        for _ in range(10):
            readings, _, _, _, info = twin.step(readings[:, :1] * [1.0, 0.0, 0.0])
            energy += info["energy"]
        *_, ours = one.step(np.zeros((N, 1)))
        np.testing.assert_array_equal(ours["energy"], energy)
        np.testing.assert_array_equal(ours["true_class"], info["true_class"])
        for name, values in info["truth"]["state"].items():
            np.testing.assert_array_equal(ours["truth"]["state"][name], values)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_vehicle_has_speeds_relative_to_its_largest(preset):
    largest = PRESETS[preset].maximum_speed
    env = ActiveDiagnosisVectorEnv(N, preset=preset, realism=1.0)
    observation, _ = env.reset(seed=1, options={"schedule": [], "mission": 0.4 * largest})
    for _ in range(20):
        observation, _, _, _, info = env.step(np.zeros((N, 1)))
        assert env.observation_space.contains(observation)
    named = dict(zip(FEATURES, observation[0], strict=True))
    assert named["mission_speed"] == pytest.approx(0.4) and abs(named["speed_error"]) < 0.05
    assert 0.7 < named["beta"] < 1.3
    *_, info = env.step(np.ones((N, 1)))
    assert info["cost"] == pytest.approx(np.full(N, (0.25 * largest) ** 2), rel=1e-5)


def test_a_diagnoser_of_the_package_is_made_for_the_vehicle():
    env = ActiveDiagnosisVectorEnv(1, preset=Vehicle(alpha=-0.2), diagnoser="filter_bank")
    mine = FilterBank(vehicle=Vehicle(alpha=-0.2))
    given = ActiveDiagnosisVectorEnv(1, preset=Vehicle(alpha=-0.2), diagnoser=mine)
    usual = ActiveDiagnosisVectorEnv(1, preset=Vehicle(alpha=-0.2), diagnoser=FilterBank())
    assert run(env) == run(given) != run(usual)


def test_settings_of_a_diagnoser_survive_json():
    env = many(diagnoser=FilterBank(temperature=1.0), preset="npsnet1995")
    again = gym.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert run(env) == run(again) != run(many(diagnoser="filter_bank", preset="npsnet1995"))


@pytest.mark.parametrize("mode", [mode.value for mode in AutoresetMode])
@pytest.mark.parametrize("truth", ["label", "full"])
def test_ends_resets_and_information_are_those_of_gymnasium_s_vector_environment(mode, truth):
    given = {"diagnoser": "filter_bank", "truth": truth}
    ours = many(autoreset_mode=mode, **given)
    make = lambda: gym.make(NAME, max_episode_steps=LIMIT, **given)  # noqa: E731
    theirs = SyncVectorEnv([make] * N, autoreset_mode=mode)
    random = np.random.default_rng(0)
    rows = [env.reset(seed=8, options={"schedule": GONE}) for env in (ours, theirs)]
    ends = np.zeros(2, int)
    for _ in range(2 * LIMIT + 2):
        assert_same(*rows)
        actions = random.uniform(-1.0, 1.0, (N, 1)).astype(np.float32)
        rows = [env.step(actions) for env in (ours, theirs)]
        _, _, terminated, truncated, _ = rows[0]
        ends += terminated.sum(), truncated.sum()
        done = terminated | truncated
        if mode == "Disabled" and done.any():
            assert_same(*rows)
            rows = [env.reset(options={"reset_mask": done.copy()}) for env in (ours, theirs)]
    assert (ends > 0).all()


def assert_same(ours, theirs):
    """The same values, those of information on the lanes of their masks."""
    for mine, other in zip(ours[:-1], theirs[:-1], strict=True):
        np.testing.assert_array_equal(mine, other)
    assert_same_info(ours[-1], theirs[-1])


def assert_same_info(ours, theirs):
    assert set(ours) == set(theirs)
    for name in theirs:
        if name.startswith("_"):
            np.testing.assert_array_equal(ours[name], theirs[name])
        elif isinstance(theirs[name], dict):
            assert_same_info(ours[name], theirs[name])
        else:
            for lane in np.flatnonzero(theirs[f"_{name}"]):
                np.testing.assert_array_equal(ours[name][lane], theirs[name][lane])


def test_the_belief_is_in_the_information_with_masks_and_final_values():
    env = many(diagnoser="filter_bank")
    _, info = env.reset(seed=1, options={"schedule": GONE})
    shape = (N, len(classes()))
    for _ in range(LIMIT):
        assert [info[name].shape for name in ("belief", "severity_mean", "severity_std")] == [
            shape
        ] * 3
        assert info["_belief"].tolist() == [True] * N
        np.testing.assert_allclose(info["belief"].sum(axis=1), 1.0)
        before = info
        _, _, terminated, truncated, info = env.step(np.zeros((N, 1)))
        if terminated.any():
            break
    final = info["final_info"]
    assert (final["_belief"] == info["_final_info"]).all()
    assert (info["_final_info"] == terminated | truncated).all()
    ended = terminated
    assert ended.any()
    declared = final["declared_class"][ended]
    assert (declared > 0).all() and (final["belief"][ended, declared] > 0.9).all()
    assert (info["belief"][ended, declared] < 0.1).all()
    assert (info["declared_class"] == 0).all()
    assert before["belief"] is not info["belief"]


def episodes(env, n_episodes, **reset):
    """What the first n_episodes begin with; none is followed to its end."""
    rows = [env.reset(**reset)[0]]
    rows += [env.reset()[0] for _ in range(n_episodes - 1)]
    return [row.tobytes() for row in rows]


@pytest.mark.parametrize("maker", [ActiveDiagnosisEnv, ActiveDiagnosisVectorEnv])
def test_resets_without_a_seed_go_on_and_can_be_repeated(maker):
    envs = [maker(diagnoser="null") for _ in range(4)]
    first, second = (episodes(env, 4, seed=9) for env in envs[:2])
    assert first == second and len(set(first)) == 4
    third = episodes(envs[2], 3)
    assert episodes(envs[3], 3, seed=envs[2].np_random_seed) == third
    assert third[0] not in first


def test_a_step_after_the_end_is_refused_in_one_line():
    env = gym.make(NAME, diagnoser="filter_bank")
    env.reset(seed=1, options={"schedule": GONE, "mission": "cruise"})
    terminated = False
    while not terminated:
        _, _, terminated, _, _ = env.step([1.0])
    message = r"step: got an ended episode; .*call reset\(\)"
    with pytest.raises(gym.error.ResetNeeded, match=message) as refused:
        env.step([1.0])
    assert "\n" not in str(refused.value)
    env.reset()
    env.step([1.0])
    with pytest.raises(gym.error.ResetNeeded, match="step: got no reset before"):
        ActiveDiagnosisEnv(diagnoser="null").step([0.0])


def test_an_episode_of_one_vehicle_is_as_long_as_its_user_wants():
    env = ActiveDiagnosisEnv(diagnoser="null", cost_weight=0.0)
    fault = GONE[0] | {"onset": 149.5}
    env.reset(seed=1, options={"schedule": [fault], "mission": "cruise"})
    rewards = [env.step([0.0])[1] for _ in range(151)]
    assert np.flatnonzero(rewards).tolist() == [149]


@pytest.mark.parametrize("truth", ["label", False])
def test_information_becomes_tensors(truth):
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")
    from gymnasium.wrappers.vector import NumpyToTorch

    env = NumpyToTorch(many(diagnoser="null", truth=truth, autoreset_mode="NextStep"))
    env.reset(seed=1)
    for _ in range(LIMIT + 2):
        *_, info = env.step(torch.zeros((N, 1)))
    assert {type(value) for value in info.values()} == {torch.Tensor}
