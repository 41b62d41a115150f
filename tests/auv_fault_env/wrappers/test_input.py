"""Bad input to signal faults and their wrappers: one line, thing, value, allowed, remedy."""

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from auv_fault_env import FaultEvent, ScheduleSampler
from auv_fault_env.env import PropulsionEnv
from auv_fault_env.wrappers import FaultInjection, FaultInjectionVector, SignalFault
from tests.auv_fault_env.test_reset_and_samplers_input import assert_refused

from .counting import FAULTS, Counting, event

BIAS = {"kind": "bias", "target": "observation", "channel": 0, "size": 1.0}


def both(*arguments, **settings):
    """Calls that wrap a single environment and a vector of two."""
    yield lambda: FaultInjection(Counting(), *arguments, **settings)
    yield lambda: FaultInjectionVector(SyncVectorEnv([Counting] * 2), *arguments, **settings)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("kind", "biass", "bias, scale, noise, stuck, dropout, delay"),
        ("kind", "gain", "bias, scale"),
        ("kind", None, "bias, scale"),
        ("target", "reward", "observation, action"),
        ("channel", -1, "a whole number from 0"),
        ("channel", 0.5, "a whole number from 0"),
        ("channel", True, "a whole number from 0"),
        ("size", math.nan, "a number from"),
        ("size", math.inf, "a number from"),
        ("size", "1", "a number from"),
        ("size", 0.0, "other than 0"),
    ],
    ids=str,
)
def test_fields_of_a_fault(field, value, allowed):
    assert_refused(lambda: SignalFault(**{**BIAS, field: value}), field, ".+", allowed)


@pytest.mark.parametrize(
    ("kind", "size", "allowed"),
    [
        ("scale", 1.0, "other than 1"),
        ("noise", -1.0, "0 to"),
        ("stuck", 1.5, "0 to 1"),
        ("dropout", -0.1, "0 to 1"),
        ("delay", 2.5, "a whole number of samples"),
        ("delay", 1001, "1 to 1000"),
        ("delay", 0, "1 to 1000"),
    ],
)
def test_size_of_each_kind(kind, size, allowed):
    fault = {**BIAS, "kind": kind, "size": size}
    assert_refused(lambda: SignalFault(**fault), f"size of {kind}", str(size), allowed)


def test_kinds_of_actions_are_others():
    fault = {**BIAS, "target": "action"}
    assert_refused(lambda: SignalFault(**fault), "action", "bias", "gain, offset, stuck, delay")


@pytest.mark.parametrize("faults", [{}, [], None, [SignalFault(**BIAS)]], ids=str)
def test_faults_are_a_mapping(faults):
    for call in both(faults):
        assert_refused(call, "faults", ".+", "a mapping of names", "name one")


@pytest.mark.parametrize("name", ["normal", 3, None])
def test_names_of_faults(name):
    for call in both({name: SignalFault(**BIAS)}):
        assert_refused(call, "name of a fault", str(name), "other than normal")


def test_faults_as_mappings():
    one = {name: value for name, value in BIAS.items() if name != "size"}
    for fault, thing, remedy in [
        (one, "fault drift", "add 'size'"),
        ({**BIAS, "sise": 1}, "field of fault drift", "did you mean 'size'"),
        (3, "fault drift", "write one"),
    ]:
        for call in both({"drift": fault}):
            assert_refused(call, thing, ".+", ".+", remedy)


@pytest.mark.parametrize(
    ("changes", "thing", "got"),
    [
        ({"fault": "biass"}, "fault", "biass"),
        ({"fault": "increased_drag"}, "fault", "increased_drag"),
        ({"fault": 3}, "fault", "3"),
        ({"severity": math.nan}, "severity of bias", "nan"),
        ({"severity": 1.5}, "severity of bias", "1.5"),
        ({"onset": -1}, "onset of bias", "-1"),
        ({"onset": math.inf}, "onset of bias", "inf"),
        ({"ramp": -1}, "ramp of bias", "-1"),
        ({"duty": 2}, "duty of bias", "2"),
        ({"end": 3}, "onset of bias", "5"),
        ({"sevrity": 1}, "field of a fault event", "sevrity"),
    ],
    ids=str,
)
def test_events(changes, thing, got):
    schedule = [{**event("bias"), **changes}]
    for call in both(FAULTS, schedule):
        assert_refused(call, thing, got, ".+")
    env = FaultInjection(Counting(), FAULTS)
    assert_refused(lambda: env.reset(options={"schedule": schedule}), thing, got, ".+")
    assert env.unwrapped.received == [] and not hasattr(env.unwrapped, "options")
    vector = FaultInjectionVector(SyncVectorEnv([Counting] * 2), FAULTS)
    options = {"schedules": [[], schedule]}
    assert_refused(lambda: vector.reset(options=options), thing, got, ".+")


def test_an_event_of_the_vehicles_catalogue_is_no_signal_fault():
    schedule = [FaultEvent("increased_drag", 1.0, 0.5)]
    for call in both(FAULTS, schedule):
        assert_refused(call, "fault", "increased_drag", "one of bias")


@pytest.mark.parametrize("schedule", [5, event("bias"), [3], b"", {"fault"}], ids=str)
def test_schedules_of_a_reset(schedule):
    env = FaultInjection(Counting(), FAULTS)
    assert_refused(lambda: env.reset(options={"schedule": schedule}), ".*schedule", ".+", ".+")


def test_options_of_a_reset(tmp_path):
    env = FaultInjection(Counting(), FAULTS)
    for options in (5, [1], "schedule"):
        assert_refused(lambda options=options: env.reset(options=options), "options", ".", "mapp")
    missing = str(tmp_path / "missing.json")
    assert_refused(lambda: env.reset(options={"schedule": missing}), "file", "missing", "JSON file")
    vector = FaultInjectionVector(SyncVectorEnv([Counting] * 2), FAULTS)
    for options, thing in [
        ({"schedules": [[]]}, "number of schedules"),
        ({"schedules": 3}, "schedules"),
        ({"schedules": [[], []], "schedule": []}, "reset option"),
    ]:
        assert_refused(lambda options=options: vector.reset(options=options), thing, ".", ".")


@pytest.mark.parametrize(
    ("schedules", "thing", "allowed"),
    [
        (ScheduleSampler(prior={"increased_drag": 1.0}), "prior", "equally likely"),
        ({"onsett": [0, 1]}, "field of ScheduleSampler", "onset"),
        ({"type": "auv_fault_env.missions:MissionSampler"}, "type", "ScheduleDistribution"),
        (5, "schedule", "a sequence of events"),
        (None, "schedule", "a sequence of events"),
    ],
    ids=str,
)
def test_schedules_of_every_episode(schedules, thing, allowed):
    for call in both(FAULTS, schedules):
        assert_refused(call, thing, ".+", allowed)


@pytest.mark.parametrize("sample_time", [0.0, -1.0, math.nan, math.inf, "1", None], ids=str)
def test_sample_time(sample_time):
    for call in both(FAULTS, sample_time=sample_time):
        assert_refused(call, "sample_time", ".+", "a number from")


def test_level_of_the_truth():
    for call in both(FAULTS, truth="labels"):
        assert_refused(call, "truth", "labels", "'full', 'label' or False")


def test_a_channel_that_is_not_there():
    for target, count in (("observation", 3), ("action", 2)):
        for call in both({"stuck": SignalFault("stuck", target, count, 1.0)}):
            allowed = f"0 to {count - 1} of Box"
            assert_refused(call, "channel of stuck", str(count), allowed)


@pytest.mark.parametrize(
    ("name", "target", "space", "remedy"),
    [
        ("CartPole-v1", "action", r"Discrete\(2\)", "leave faults of the action out"),
        ("FrozenLake-v1", "observation", r"Discrete\(16\)", "FlattenObservation"),
        ("Blackjack-v1", "observation", "Tuple", "FlattenObservation"),
    ],
)
def test_spaces_without_channels(name, target, space, remedy):
    faults = {"stuck": SignalFault("stuck", target, 0, 1.0)}
    allowed = f"a Box of float32 or float64 for faults of the {target}"
    for call in (
        lambda: FaultInjection(gym.make(name), faults),
        lambda: FaultInjectionVector(gym.make_vec(name, 2, "sync"), faults),
    ):
        assert_refused(call, f"{target} space", space, allowed, remedy)


def test_images_have_no_channels():
    env = Counting()
    env.observation_space = gym.spaces.Box(0, 255, (4, 4), np.uint8)
    assert_refused(lambda: FaultInjection(env, FAULTS), "observation", "uint8", "a Box of", "Dtype")


@pytest.mark.parametrize("action", [np.zeros(3), [0.0], np.zeros((2, 2))], ids=str)
def test_actions_of_another_shape(action):
    env = FaultInjection(Counting(), FAULTS, [event("gain")])
    env.reset(seed=1)
    assert_refused(lambda: env.step(action), "action", ".+", r"of shape \(2,\)")


def test_one_truth_is_enough():
    faults = {"bias": SignalFault(**BIAS)}
    env = FaultInjection(PropulsionEnv(), faults)
    assert_refused(lambda: env.reset(seed=1), "true_class", ".", "without a truth", "truth=False")
    twice = FaultInjection(FaultInjection(Counting(), faults, truth=False), faults)
    twice.reset(seed=1)


def test_a_vector_that_does_not_tell_how_it_resets():
    vector = SyncVectorEnv([Counting] * 2)
    vector.metadata = {}
    assert_refused(
        lambda: FaultInjectionVector(vector, FAULTS), "autoreset_mode", "None", "AutoresetMode"
    )
