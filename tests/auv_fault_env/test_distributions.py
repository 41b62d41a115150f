"""Distributions of schedules and missions as arguments: JSON, checks, a curriculum."""

import dataclasses
import json
import re

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from auv_fault_env import (
    PRESETS,
    FaultEvent,
    Mission,
    MissionDistribution,
    MissionSampler,
    ScheduleDistribution,
    ScheduleSampler,
)
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.errors import InputError

NAME = "auv_fault_env/Propulsion-v0"


@dataclasses.dataclass(frozen=True)
class OneFault(ScheduleDistribution):
    """One fault of random severity at the start."""

    fault: str = "increased_drag"

    def schedule(self, random, vehicle):
        return [FaultEvent(self.fault, 0.0, random.uniform(0.2, 1.0))]


@dataclasses.dataclass(frozen=True)
class OneSpeed(MissionDistribution):
    """A random share of the vehicle's largest speed."""

    least: float = 0.5

    def mission(self, random, maximum_speed):
        return Mission(((0.0, maximum_speed * random.uniform(self.least, 1.0)),))


MAKERS = {
    "single": lambda **settings: gym.make(NAME, **settings),
    "vector": lambda **settings: gym.make_vec(NAME, 3, "vector_entry_point", **settings),
}
GIVEN = {
    "samplers": (ScheduleSampler(healthy=0.0, onset=(0.0, 0.1)), MissionSampler(speed=(0.8, 0.9))),
    "fields": ({"healthy": 0.0, "onset": [0.0, 0.1]}, {"speed": [0.8, 0.9]}),
    "own": (OneFault(), OneSpeed(0.8)),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
@pytest.mark.parametrize(("schedules", "missions"), GIVEN.values(), ids=GIVEN)
def test_episodes_are_drawn_from_the_arguments_also_after_json(make, schedules, missions):
    vehicle = dataclasses.replace(PRESETS["thesis1992"], alpha=-0.1)
    env = make(schedules=schedules, missions=missions, preset=vehicle, truth="full")
    text = env.spec.to_json()
    json.loads(text)
    copy = EnvSpec.from_json(text)
    again = gym.make(copy) if env.unwrapped is not env else gym.make_vec(copy)
    assert again.unwrapped.fleet.schedules == env.unwrapped.fleet.schedules
    assert again.unwrapped.fleet.missions == env.unwrapped.fleet.missions
    assert again.unwrapped.fleet.vehicle == vehicle
    for seed in range(3):
        (observation, info), (same, _) = (one.reset(seed=seed) for one in (env, again))
        assert np.max(info["truth"]["onset"]) <= 0.1
        assert np.min(info["mission_speed"]) >= 0.8
        assert observation.tobytes() == same.tobytes()


@pytest.mark.parametrize("maker", [PropulsionEnv, PropulsionVectorEnv])
def test_a_curriculum_changes_the_next_episode(maker):
    env = maker(schedules=ScheduleSampler(healthy=1.0), truth="full")
    _, info = env.reset(seed=1)
    assert np.isinf(info["truth"]["onset"])
    env.set_distributions(OneFault("propeller_loss:port"), OneSpeed())
    *_, info = env.step(np.zeros(env.action_space.shape))
    assert np.isinf(info["truth"]["onset"])
    env.reset()
    *_, info = env.step(np.zeros(env.action_space.shape))
    assert np.ravel(info["truth"]["label"]) == ["propeller_loss:port"]
    env.set_distributions(missions={"speed": (0.1, 0.1)})
    _, info = env.reset()
    assert info["mission_speed"] <= 0.1
    assert env.fleet.schedules == OneFault("propeller_loss:port")


def test_a_curriculum_reaches_environments_behind_wrappers():
    env = gym.make_vec(NAME, 2, "sync")
    env.call("set_distributions", missions={"speed": [0.3, 0.3], "from_rest": 0.0})
    assert env.reset(seed=1)[1]["mission_speed"] == pytest.approx([0.3, 0.3])


class Storms:
    """Distributions may stand in a class."""

    @dataclasses.dataclass(frozen=True)
    class Weighted(ScheduleDistribution):
        """One fault whose severity is drawn from weights that NumPy holds."""

        weights: np.ndarray | list = dataclasses.field(default_factory=lambda: np.ones(2))

        def schedule(self, random, vehicle):
            severity = random.choice([0.5, 1.0], p=np.divide(self.weights, np.sum(self.weights)))
            return [FaultEvent("increased_drag", 1.0, severity)]


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_numbers_of_numpy_survive_json(make):
    given = {
        "sensor_noise": np.float32(0.5),
        "realism": np.int64(1),
        "reward_weights": {"deflection": np.float32(0.5)},
        "schedules": Storms.Weighted(np.array([1.0, 3.0])),
        "missions": MissionSampler(n_legs=np.int64(2)),
    }
    text = make(**given).spec.to_json()
    copy = EnvSpec.from_json(text)
    again = gym.make(copy) if copy.kwargs.get("num_envs") is None else gym.make_vec(copy)
    assert again.spec.to_json() == text
    assert again.unwrapped.fleet.schedules.weights == [1.0, 3.0]
    assert again.unwrapped.fleet.missions.n_legs == 2


@pytest.mark.parametrize("code", ["def (", "import no_such_module", "raise SystemExit(3)"])
def test_a_module_that_cannot_be_imported_is_refused_with_its_reason(tmp_path, monkeypatch, code):
    (tmp_path / "foreign_storm.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"type of the distribution: .*it: .*(syntax|module|3)"):
        PropulsionEnv(schedules={"type": "foreign_storm:Storm"})


def test_lanes_of_an_own_distribution_are_the_single_environments():
    given = {"schedules": OneFault(), "missions": OneSpeed()}
    many, _ = PropulsionVectorEnv(3, **given).reset(seed=5)
    for lane in range(3):
        assert PropulsionEnv(**given).reset(seed=5 + lane)[0].tobytes() == many[lane].tobytes()


@dataclasses.dataclass(frozen=True)
class Unsteady(ScheduleDistribution):
    def schedule(self, random, vehicle):
        return [FaultEvent("increased_drag", np.random.default_rng().uniform(1.0, 9.0), 1.0)]


@dataclasses.dataclass(frozen=True)
class TooFast(MissionDistribution):
    def mission(self, random, maximum_speed):
        return 2.0 * maximum_speed


class NoDataclass(OneFault):
    def __init__(self):
        pass


@dataclasses.dataclass
class Changeable(ScheduleDistribution):
    severity: float = 1.0


WRONG = {
    "random": ({"schedules": Unsteady()}, "distribution: got 'Unsteady'.*same schedule for a key"),
    "speed": ({"missions": TooFast()}, "mission speed: got 2.0; allowed is a number from 0 to 1"),
    "side": (
        {"schedules": OneFault("propeller_loss:starboard"), "preset": "remus100"},
        "distribution: got 'propeller_loss:starboard'; allowed is faults that remus100 can have",
    ),
    "fault": ({"schedules": OneFault("dragg")}, "fault: got 'dragg'"),
    "field": ({"schedules": {"helthy": 0.1}}, "field of ScheduleSampler: got 'helthy'.*'healthy'"),
    "value": ({"missions": {"n_legs": 0}}, "number of legs: got 0"),
    "word": ({"missions": "cruise"}, "distribution: got 'cruise'; allowed is a MissionDistrib"),
    "prior": ({"schedules": {"prior": ["sensor:speed"]}}, "prior: got .*allowed is a mapping"),
    "type": (
        {"schedules": {"type": "nowhere:Sampler"}},
        "type of the distribution: got 'nowhere.*No module named 'nowhere'",
    ),
    "number": ({"schedules": {"type": 5}}, "type of the distribution: got 5"),
    "other": (
        {"schedules": {"type": "auv_fault_env.missions:MissionSampler"}},
        "type of the distribution: got .*allowed is a subclass of ScheduleDistribution",
    ),
    "changeable": ({"schedules": Changeable()}, "got 'Changeable'; allowed is a frozen dataclass"),
}


@pytest.mark.parametrize("maker", [PropulsionEnv, PropulsionVectorEnv])
@pytest.mark.parametrize(("settings", "message"), WRONG.values(), ids=WRONG)
def test_wrong_distributions_are_refused(maker, settings, message):
    with pytest.raises(InputError, match=message):
        maker(**settings)


def test_a_refused_change_leaves_both_as_they_were():
    env = PropulsionEnv()
    before = env.fleet.schedules, env.fleet.missions
    with pytest.raises(InputError, match="mission speed"):
        env.set_distributions(OneFault(), TooFast())
    assert (env.fleet.schedules, env.fleet.missions) == before


def test_unknown_field_of_the_vehicle_is_refused():
    with pytest.raises(InputError, match=re.escape("field of the vehicle: got 'alfa'")):
        PropulsionEnv(preset={"alfa": -0.1})


def test_the_plain_form_has_what_differs_from_the_default():
    sampler = ScheduleSampler(prior={"increased_drag": 1.0}, onset=[1.0, 2.0])
    plain = sampler.plain()
    assert plain == {
        "type": "auv_fault_env.schedules:ScheduleSampler",
        "prior": {"increased_drag": 1.0},
        "onset": (1.0, 2.0),
    }
    assert ScheduleDistribution.of(json.loads(json.dumps(plain)), ScheduleSampler) == sampler
