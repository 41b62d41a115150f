"""Faults on one environment: what each kind does, when, and that nothing else changes."""

import copy
import math
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence

from auv_fault_env import ScheduleSampler
from auv_fault_env.schedules import Event
from auv_fault_env.wrappers import FaultInjection, SignalFault

from .counting import (
    COUNT,
    FALL,
    FAULTS,
    OF_ACTION,
    OF_OBSERVATION,
    RANDOM,
    Counting,
    actions,
    episode,
    event,
)

ONSET = 5
SAMPLER = ScheduleSampler(onset=(0.0, 8.0), ramp=(1.0, 4.0), healthy=0.1, compound=0.5)


def faulty(*events, steps=20, **settings):
    """Observations with these events, the fault-free twin's, and the information."""
    settings = {"faults": FAULTS, "truth": "full", **settings}
    twin, _ = episode(Counting(), steps)
    observations, infos = episode(FaultInjection(Counting(), schedules=events, **settings), steps)
    return observations, twin, infos


def received(*events, steps=12):
    """The actions that an environment gets."""
    env = FaultInjection(Counting(), FAULTS, events)
    episode(env, steps)
    return np.array(env.unwrapped.received)


@pytest.mark.parametrize("name", OF_OBSERVATION)
def test_the_first_sample_that_differs_is_that_of_the_onset(name):
    observations, twin, infos = faulty(event(name, ONSET))
    channel = FAULTS[name].channel
    differs = observations[:, channel] != twin[:, channel]
    assert np.flatnonzero(differs)[0] == ONSET == infos[0]["truth"]["onset"]
    assert differs[ONSET:].mean() > 0.99
    others = [other for other in range(3) if other != channel]
    assert observations[:, others].tobytes() == twin[:, others].tobytes()
    labels = [info["truth"]["label"] for info in infos]
    assert labels == ["normal"] * ONSET + [name] * (len(infos) - ONSET)


@pytest.mark.parametrize("name", OF_ACTION)
def test_the_first_action_that_differs_is_that_of_the_onset(name):
    got = received(event(name, ONSET))
    channel = FAULTS[name].channel
    differs = got != actions(12)
    assert np.flatnonzero(differs[:, channel])[0] == ONSET
    assert not differs[:, 1 - channel].any()


def test_a_bias_is_added_and_a_scale_multiplies():
    observations, twin, _ = faulty(event("bias", ONSET, 0.5), event("scale", ONSET, 0.5))
    np.testing.assert_array_equal(observations[ONSET:, FALL], twin[ONSET:, FALL] + 1.0)
    np.testing.assert_array_equal(observations[ONSET:, COUNT], twin[ONSET:, COUNT] * 0.75)


def test_a_stuck_sensor_repeats_what_it_read_before_the_onset_and_not_the_truth():
    observations, twin, _ = faulty(event("stuck", ONSET, end=15))
    assert (observations[ONSET:15, COUNT] == twin[ONSET - 1, COUNT]).all()
    np.testing.assert_array_equal(observations[15:], twin[15:])


def test_a_sensor_stuck_from_the_start_repeats_its_first_value():
    observations, twin, _ = faulty(event("stuck", 0))
    assert (observations[:, COUNT] == twin[0, COUNT]).all()


def test_a_stuck_sensor_repeats_its_reading_under_other_faults():
    faults = {**FAULTS, "count_bias": SignalFault("bias", "observation", COUNT, 7.0)}
    events = [event("count_bias", 2, end=9), event("stuck", ONSET)]
    observations, twin, _ = faulty(*events, faults=faults)
    assert (observations[ONSET:, COUNT] == twin[ONSET - 1, COUNT] + 7.0).all()


@pytest.mark.parametrize(("name", "value"), [("stuck", None), ("dropout", 0.0)])
def test_a_severity_is_the_share_of_the_samples_that_fail(name, value):
    observations, twin, _ = faulty(event(name, 0, 0.3), steps=900)
    failed = observations[:, COUNT] != twin[:, COUNT]
    assert 0.25 < failed.mean() < 0.35
    expected = observations[:-1, COUNT][failed[1:]] if value is None else value
    np.testing.assert_array_equal(observations[1:, COUNT][failed[1:]], expected)


@pytest.mark.parametrize(("severity", "late"), [(1.0, 4), (0.5, 2), (0.1, 0)])
def test_a_late_sensor_gives_exactly_the_value_of_that_many_samples_ago(severity, late):
    observations, twin, _ = faulty(event("delay", ONSET, severity))
    expected = twin[ONSET - late : len(twin) - late, COUNT]
    assert observations[ONSET:, COUNT].tobytes() == expected.tobytes()


def test_before_the_first_value_a_late_sensor_gives_the_first():
    observations, twin, _ = faulty(event("delay", 0))
    expected = twin[np.maximum(np.arange(len(twin)) - 4, 0), COUNT]
    np.testing.assert_array_equal(observations[:, COUNT], expected)


def test_noise_has_its_standard_deviation_and_depends_on_the_seed_alone():
    faults = {"noise": SignalFault("noise", "observation", FALL, 0.3)}
    observations, twin, _ = faulty(event("noise", 0, 0.5), faults=faults, steps=2000)
    noise = (observations - twin)[:, FALL]
    assert abs(noise.mean()) < 0.01
    assert noise.std() == pytest.approx(0.15, rel=0.05)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.07
    env = FaultInjection(Counting(), faults, [event("noise", 0)])
    runs = [episode(env, seed=seed)[0].tobytes() for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_noises_of_two_channels_differ():
    faults = {name: SignalFault("noise", "observation", k, 1.0) for k, name in enumerate("ab")}
    observations, twin, _ = faulty(event("a", 0), event("b", 0), faults=faults, steps=500)
    noise = (observations - twin)[:, :2]
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.15


def test_a_gain_weakens_and_an_offset_shifts_the_action():
    given = actions(12)
    got = received(event("gain", ONSET, 0.4), event("offset", ONSET))
    np.testing.assert_allclose(got[ONSET:, 0], given[ONSET:, 0] * 0.7, rtol=1e-6)
    np.testing.assert_allclose(got[ONSET:, 1], given[ONSET:, 1] + 0.5, rtol=1e-6)


def test_a_stuck_actuator_stays_and_a_late_one_follows_later():
    given = actions(12)
    got = received(event("stuck_action", ONSET), event("late_action", ONSET))
    assert (got[ONSET:, 0] == given[ONSET - 1, 0]).all()
    assert got[ONSET:, 1].tobytes() == given[ONSET - 3 : 12 - 3, 1].tobytes()


def test_faulty_channels_saturate_at_the_limits_of_the_spaces():
    observations, _, _ = faulty(
        event("noise", 0), faults={"noise": SignalFault("noise", "observation", RANDOM, 1e6)}
    )
    assert set(observations[:, RANDOM]) == {-5.0, 5.0}
    faults = {"offset": SignalFault("offset", "action", 0, 1e6)}
    env = FaultInjection(Counting(), faults, [event("offset", 0)])
    episode(env)
    got = np.array(env.unwrapped.received)
    assert (got[:, 0] == 2.0).all() and (got[:, 1] == actions(20)[:, 1]).all()


def test_values_stay_finite_where_the_space_has_no_limits():
    faults = {"scale": SignalFault("scale", "observation", 1, 1e12)}
    env = gym.wrappers.TransformObservation(
        gym.make("CartPole-v1"), lambda values: values * np.float32(1e30), None
    )
    env = FaultInjection(env, faults, [event("scale", 0)])
    observation, _ = env.reset(seed=1)
    assert np.isfinite(observation).all() and abs(observation[1]) > 1e38


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize(
    "profile",
    [{"severity": 0.0}, {"onset": 1e6}, {"end": 5.5, "onset": 5.25}],
    ids=["severity 0", "later", "between two samples"],
)
def test_what_is_not_there_leaves_no_trace(name, profile):
    observations, twin, infos = faulty({**event(name), **profile})
    assert observations.tobytes() == twin.tobytes()
    assert {info["truth"]["label"] for info in infos} == {"normal"}
    assert received({**event(name), **profile}).tobytes() == actions(12).tobytes()


def test_without_a_fault_the_very_values_of_the_environment_pass():
    env = FaultInjection(Counting(), FAULTS, [event("gain", 0)])
    observation, _ = env.reset(seed=1)
    assert observation is env.unwrapped.state
    env.reset(seed=1, options={"schedule": [event("bias", 0)]})
    action = np.zeros(2)
    env.step(action)
    assert env.unwrapped.received[-1].dtype == np.float64


def test_faults_write_neither_into_the_state_nor_into_the_callers_action():
    env = FaultInjection(Counting(), FAULTS, [event("bias", 0), event("offset", 0)])
    action = np.zeros(2, np.float32)
    env.reset(seed=1)
    for _ in range(3):
        observation, *_ = env.step(action)
        assert observation[FALL] == env.unwrapped.state[FALL] + 2.0
        assert env.unwrapped.state[FALL] == -0.5 * env.unwrapped.count - 0.25
    assert not action.any()


def test_observations_of_two_steps_share_no_memory():
    env = FaultInjection(Counting(), FAULTS, [event("bias", 0)])
    env.reset(seed=1)
    one, two = (env.step(np.zeros(2))[0] for _ in range(2))
    assert not np.shares_memory(one, two)


def test_severities_follow_the_profile_of_the_package_s_own_environments():
    events = [
        event("bias", 2, 0.8, ramp=4),
        event("scale", 3, 0.5, period=4, duty=0.3),
        event("noise", 1, 1.0, end=6),
    ]
    _, _, infos = faulty(*events)
    severity = {name: [info["truth"]["severity"][name] for info in infos] for name in FAULTS}
    ramp = [0.0, 0.0, 0.0, 0.2, 0.4, 0.6]
    np.testing.assert_allclose(severity["bias"], ramp + [0.8] * 15, rtol=1e-12)
    assert severity["scale"] == [0.5 if k >= 3 and (k - 3) % 4 < 2 else 0.0 for k in range(21)]
    assert severity["noise"] == [1.0 if 1 <= k < 6 else 0.0 for k in range(21)]
    assert {info["truth"]["onset"] for info in infos} == {1.0}


@pytest.mark.parametrize("sample_time", [0.02, 0.05, 0.1, 1e-4, 1 / 3])
def test_times_are_in_seconds_of_the_sample_time(sample_time):
    for step in range(1, 60, 7):
        onset = float(f"{step * sample_time:.12g}")
        env = FaultInjection(Counting(), FAULTS, [event("bias", onset)], sample_time, "full")
        observations, infos = episode(env, steps=60)
        twin, _ = episode(Counting(), steps=60)
        assert np.flatnonzero((observations != twin).any(axis=1))[0] == step
        assert infos[0]["truth"]["onset"] == onset


def test_an_onset_between_two_samples_shows_at_the_second():
    observations, twin, infos = faulty(event("bias", 0.31), sample_time=0.1)
    assert np.flatnonzero((observations != twin).any(axis=1))[0] == 4
    assert infos[0]["truth"]["onset"] == 0.31


def test_levels_of_the_truth():
    levels = {
        level: episode(FaultInjection(Counting(), FAULTS, truth=level))[1][0]
        for level in ("full", "label", False)
    }
    assert set(levels[False]) == {"count"}
    assert set(levels["label"]) == {"count", "true_class"}
    assert set(levels["full"]) == {"count", "true_class", "truth"}
    truth = levels["full"]["truth"]
    assert truth == {"label": "normal", "severity": dict.fromkeys(FAULTS, 0.0), "onset": math.inf}
    assert type(levels["label"]["true_class"]) is np.int64
    numbers = [truth["onset"], *truth["severity"].values()]
    assert {type(number) for number in numbers} == {np.float64}


def test_the_class_is_that_of_the_worst_fault():
    _, _, infos = faulty(event("bias", 2, 0.4), event("scale", 4, 0.7), event("noise", 6, 0.7))
    env = FaultInjection(Counting(), FAULTS)
    classes = [env.classes[info["true_class"]] for info in infos]
    assert env.classes == ("normal", *FAULTS)
    assert classes == ["normal"] * 2 + ["bias"] * 2 + ["scale"] * 17
    assert classes == [info["truth"]["label"] for info in infos]


def test_the_truth_is_a_fresh_dictionary_every_step():
    _, _, infos = faulty(event("bias", 2))
    infos[5]["truth"]["severity"]["bias"] = 7.0
    assert infos[6]["truth"]["severity"]["bias"] == 1.0


def test_the_random_stream_of_the_environment_is_its_own():
    # schedules and noise are drawn, and the environment's own numbers stay
    env = FaultInjection(Counting(), FAULTS, SAMPLER)
    twin = Counting()
    for seed in (5, None, None, 5, None):
        observations, _ = episode(env, seed=seed, options={"schedule": [event("scale", 0, 0.5)]})
        expected, _ = episode(twin, seed=seed)
        assert observations[:, RANDOM].tobytes() == expected[:, RANDOM].tobytes()
        state = env.unwrapped.np_random.bit_generator.state
        assert state == twin.np_random.bit_generator.state


def test_episodes_of_a_seed_repeat_and_differ_from_each_other():
    def run(seeds):
        env = FaultInjection(Counting(), FAULTS, SAMPLER, truth="full")
        return [episode(env, seed=seed) for seed in seeds]

    once = run([5, None, None, None])
    again = run([5, None, None, None])
    for (one, info), (two, same) in zip(once, again, strict=True):
        assert one.tobytes() == two.tobytes()
        assert data_equivalence(info, same, exact=True)
    assert len({infos[0]["truth"]["onset"] for _, infos in once}) == 4
    assert run([6])[0][1][0]["truth"]["onset"] != once[0][1][0]["truth"]["onset"]


def test_an_unseeded_reset_can_be_repeated_from_the_seed_that_it_drew():
    env = FaultInjection(Counting(), FAULTS, SAMPLER)
    observations, _ = episode(env, seed=None)
    again, _ = episode(FaultInjection(Counting(), FAULTS, SAMPLER), seed=env.np_random_seed)
    assert observations.tobytes() == again.tobytes()


def test_sampled_schedules_are_those_of_the_sampler():
    env = FaultInjection(Counting(), FAULTS, SAMPLER, truth="full")
    onsets = []
    labels = set()
    for seed in range(400):
        _, info = env.reset(seed=seed)
        onsets.append(info["truth"]["onset"])
        labels |= {env.step(np.zeros(2))[4]["truth"]["label"] for _ in range(9)}
    faulty_onsets = np.array(onsets)[np.isfinite(onsets)]
    assert 0.05 < np.isinf(onsets).mean() < 0.15
    assert faulty_onsets.min() < 0.5 and 7.0 < faulty_onsets.max() <= 8.0
    assert labels == {"normal", *FAULTS}


def test_the_schedule_of_a_reset_is_for_its_episode():
    env = FaultInjection(Counting(), FAULTS, [event("bias", 0)], truth="full")
    options = {"schedule": [event("scale", 0)], "other": 3}
    labels = [env.reset(options=one)[1]["truth"]["label"] for one in (options, None, {})]
    assert labels == ["scale", "bias", "bias"]
    assert env.reset(options={"schedule": []})[1]["truth"]["label"] == "normal"
    assert set(options) == {"schedule", "other"}


@pytest.mark.parametrize(
    ("options", "inner"),
    [
        (None, None),
        ({}, {}),
        ({"schedule": []}, None),
        ({"schedule": None}, None),
        ({"schedule": [], "other": 3}, {"other": 3}),
    ],
    ids=repr,
)
def test_other_options_are_those_of_the_environment(options, inner):
    env = FaultInjection(Counting(), FAULTS)
    env.reset(options=options)
    assert env.unwrapped.options == inner


@pytest.mark.parametrize("form", ["events", "mappings", "path"])
def test_every_form_of_a_schedule_means_the_same(form, tmp_path):
    path = tmp_path / "schedule.json"
    path.write_text('[{"fault": "bias", "onset": 5, "severity": 1.0}]')
    forms = {"events": [Event("bias", 5, 1.0)], "mappings": [event("bias")], "path": path}
    expected, _, _ = faulty(event("bias"))
    observations, _ = episode(FaultInjection(Counting(), FAULTS, forms[form]))
    assert observations.tobytes() == expected.tobytes()


@pytest.mark.parametrize("schedules", [(), [event("bias", 2, end=9)], SAMPLER], ids=str)
def test_the_spec_makes_an_equal_environment(schedules):
    faults = {"bias": SignalFault("bias", "observation", 2, 0.5)}
    env = FaultInjection(gym.make("Pendulum-v1"), faults, schedules, 0.05, "full")
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert isinstance(again, FaultInjection)
    for seed in (4, None):
        runs = []
        for one in (env, again):
            first, info = one.reset(seed=seed)
            steps = [one.step(np.array([0.5], np.float32)) for _ in range(12)]
            runs.append((first, info, steps))
        assert data_equivalence(*runs, exact=True)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_alike(copied):
    env = FaultInjection(Counting(), FAULTS, [event(name, 2) for name in FAULTS])
    episode(env, steps=7)
    twin = copied(env)
    for action in actions(9):
        assert data_equivalence(env.step(action), twin.step(action), exact=True)


def warnings_of_checker(env):
    """What Gymnasium's checker warns of, without the name of the environment."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env, skip_render_check=True)
    return {str(one.message).replace(str(env), "") for one in caught}


@pytest.mark.parametrize("name", ["Pendulum-v1", "CartPole-v1", "MountainCarContinuous-v0"])
@pytest.mark.parametrize("kind", ["bias", "noise", "delay"])
@pytest.mark.parametrize("onset", [0, 1])
def test_gymnasium_s_checker_warns_of_nothing_new(name, kind, onset):
    faults = {kind: SignalFault(kind, "observation", 1, 2.0)}
    env = FaultInjection(gym.make(name), faults, [event(kind, onset)], truth="full")
    assert warnings_of_checker(env) == warnings_of_checker(gym.make(name))


@pytest.mark.parametrize("shape", [(), (2, 3)])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_boxes_of_other_shapes_and_types(shape, dtype):
    class Shaped(gym.Env):
        observation_space = gym.spaces.Box(-9.0, 9.0, shape, np.dtype(dtype).type)
        action_space = gym.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return np.full(shape, 1.5, dtype, order="F"), {}

    channel = int(np.prod(shape)) - 1
    faults = {"bias": SignalFault("bias", "observation", channel, 2.0)}
    observation, _ = FaultInjection(Shaped(), faults, [event("bias", 0)]).reset(seed=1)
    expected = np.full(shape, 1.5)
    expected[(-1,) * len(shape)] = 3.5
    assert observation.dtype == dtype and observation.shape == shape
    np.testing.assert_array_equal(observation, expected)


def test_plain_lists_of_numbers_are_actions_too():
    env = FaultInjection(Counting(), FAULTS, [event("offset", 0)])
    env.reset(seed=1)
    for given in ([0, 1], [0.0, 1.0], (0, 1)):
        env.step(given)
        assert env.unwrapped.received[-1].tolist() == [0.0, 1.5]


def test_all_kinds_together_stay_inside_the_spaces():
    env = FaultInjection(Counting(), FAULTS, [event(name, 1, 0.9) for name in FAULTS])
    observations, _ = episode(env, steps=100)
    assert all(row in env.observation_space for row in observations)
    assert all(row in env.action_space for row in np.array(env.unwrapped.received))
