"""The vectorised environment against the single one, bit for bit, and its own manners: auto-reset,
truth, seeds.
"""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from auv_fault_env import CATALOGUE, CHANNELS, PARAMETERS, FaultEvent, Fleet, classes, layout
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.truth import LEVELS, FleetTruth

NAME = "auv_fault_env/Propulsion-v0"
LANES = 7
SEED = 31
STEPS = 700
LIMIT = 600
FAULT = {"fault": "sensor_bias:speed", "onset": 0.5, "severity": 0.5}


def commands(lanes=LANES, steps=STEPS, seed=0):
    """Actions (steps, lanes, 3), held for a while, a little beyond the limits."""
    random = np.random.default_rng(seed)
    held = random.uniform([-0.1, -0.5, -0.5], [1.1, 0.5, 0.5], (steps // 10 + 1, lanes, 3))
    return np.repeat(held, 10, axis=0)[:steps]


def lane_of(values, lane):
    """One lane of a mapping of arrays, nested or not, as plain numbers."""
    if hasattr(values, "keys"):
        return {key: lane_of(values[key], lane) for key in values if not key.startswith("_")}
    return values[lane].item()


def single_ride(lane, actions, **options):
    """(observation, reward, terminated, truncated, info) of a single environment that resets when
    it is truncated.
    """
    env = gym.make(NAME, truth="full", max_episode_steps=LIMIT)
    rows = []
    truncated = False
    observation, info = env.reset(seed=SEED + lane, options=options)
    rows.append((observation.tobytes(), 0.0, False, False, info))
    for action in actions:
        if truncated:
            (observation, info) = env.reset()
            reward = 0.0
            terminated = False
            truncated = False
        else:
            observation, reward, terminated, truncated, info = env.step(action)
        rows.append((observation.tobytes(), reward, terminated, truncated, info))
    return rows


def vector_ride(env, actions, **options):
    """The same rows by lane."""
    observations, info = env.reset(seed=SEED, options=options)
    n = len(observations)
    outcome = (observations, np.zeros(n), np.zeros(n, bool), np.zeros(n, bool), info)
    lanes = [[] for _ in range(n)]
    for action in [*actions, None]:
        for lane, rows in enumerate(lanes):
            observation, reward, terminated, truncated, info = outcome
            results = reward[lane], terminated[lane], truncated[lane], lane_of(info, lane)
            rows.append((observation[lane].tobytes(), *results))
        outcome = env.step(action) if action is not None else None
    return lanes


@pytest.mark.parametrize("given", [False, True], ids=["sampled", "given_schedule_and_mission"])
def test_lane_equals_the_single_environment_through_a_reset(given):
    options = {"schedule": [FAULT], "mission": "thesis"} if given else {}
    actions = commands()
    lanes = vector_ride(gym.make_vec(NAME, num_envs=LANES, truth="full"), actions, **options)
    for lane, rows in enumerate(lanes):
        assert rows == single_ride(lane, actions[:, lane], **options), f"lane {lane}"
        assert [row[3] for row in rows].index(True) == LIMIT
    assert len({rows[0][0] for rows in lanes}) == LANES


def fleet_ride(parallel, lanes):
    fleet = Fleet(lanes, parallel=parallel)
    actions = commands(lanes, 350)
    rows = [fleet.reset(range(lanes))]
    outcomes = []
    for action in actions:
        rows.append(fleet.step(action))
        outcomes.append(fleet.outcomes)
    return np.array(rows).tobytes(), np.array(outcomes).tobytes(), fleet.table[:, :, 0].tobytes()


@pytest.mark.parametrize("lanes", [1, layout.LANES, layout.LANES + 1, 3 * layout.LANES + 2])
def test_serial_equals_parallel_bit_for_bit(lanes):
    assert fleet_ride(False, lanes) == fleet_ride(True, lanes)


def test_a_lane_does_not_depend_on_its_company():
    n_lanes = 2 * layout.LANES + 9
    small = Fleet(3)
    large = Fleet(n_lanes)
    places = [5, layout.LANES - 1, layout.LANES + 130]
    seeds = np.arange(n_lanes) + 900
    seeds[places] = [40, 41, 42]
    one = small.reset([40, 41, 42])
    two = large.reset(seeds)
    for action in commands(n_lanes, 300):
        assert one.tobytes() == two[places].tobytes()
        one = small.step(action[places])
        two = large.step(action)


def test_resetting_some_lanes_leaves_the_others_alone():
    touched = Fleet(70)
    untouched = Fleet(70)
    for fleet in (touched, untouched):
        fleet.reset(range(70))
    others = np.setdiff1d(np.arange(70), [0, 13, 69])
    for step, action in enumerate(commands(70, 60)):
        if step == 20:
            touched.reset(lanes=np.array([0, 13, 69]))
        one = touched.step(action)
        two = untouched.step(action)
        assert one[others].tobytes() == two[others].tobytes()
    assert (one[[0, 13, 69]] != two[[0, 13, 69]]).any(axis=1).all()


def test_without_any_variation_all_lanes_are_identical():
    env = PropulsionVectorEnv(66, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0, truth="full")
    observations, _ = env.reset(seed=3, options={"schedule": [FAULT], "mission": "thesis"})
    for action in commands(1, 150):
        assert len({row.tobytes() for row in observations}) == 1
        observations, *_ = env.step(np.repeat(action, 66, axis=0))


@pytest.mark.parametrize("factor", ["sensor_noise", "disturbance", "healthy_band"])
def test_each_variation_makes_lanes_differ(factor):
    off = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    env = PropulsionVectorEnv(66, **off | {factor: 1.0}, truth="full")
    env.reset(seed=3, options={"schedule": [], "mission": "cruise"})
    for _ in range(5):
        observations, *_ = env.step(np.tile([0.3, 0.0, 0.0], (66, 1)))
    assert len({row.tobytes() for row in observations}) == 66


def test_the_same_seed_without_the_fault_is_the_exact_twin_before_onset():
    names = list(CATALOGUE)
    n = len(CATALOGUE)
    faulty = Fleet(n)
    healthy = Fleet(n)
    seeds = range(500, 500 + n)
    one = faulty.reset(seeds, schedules=[(FaultEvent(name, 5.0, 1.0),) for name in names])
    two = healthy.reset(seeds, schedules=[()] * n)
    differs = np.zeros(n, bool)
    for step in range(200):
        assert step > 50 or one.tobytes() == two.tobytes()
        differs |= (one != two).any(axis=1)
        action = np.c_[two[:, 0], np.full((n, 2), 0.1)]
        one = faulty.step(action)
        two = healthy.step(action)
    assert differs.all(), [name for name, seen in zip(names, differs, strict=True) if not seen]


def test_auto_reset_comes_on_the_step_after_the_end():
    env = PropulsionVectorEnv(2, max_episode_steps=5, truth="full")
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    env.reset(seed=1, options={"schedule": [FAULT | {"onset": 0.0}]})
    actions = np.tile([0.5, 0.1, 0.1], (2, 1))
    truncated = []
    labels = []
    for _ in range(12):
        observations, rewards, terminated, ends, info = env.step(actions)
        truncated.append(ends.tolist())
        labels.append(info["truth"]["label"].tolist())
        assert not terminated.any()
        if len(truncated) in (6, 12):
            assert (
                (rewards == 0.0).all()
                and (info["energy"] == 0.0).all()
                and (info["cost"] == 0.0).all()
            )
            # the action was ignored
            np.testing.assert_array_equal(observations[:, 1], observations[:, 0])
            assert (observations[:, 2:4] == 0.0).all()
    assert truncated == ([[False] * 2] * 4 + [[True] * 2] + [[False] * 2]) * 2
    assert labels[:5] == [["sensor:speed"] * 2] * 5 and labels[5:] == [["normal"] * 2] * 7


@pytest.mark.parametrize("limit", [20, 600])
def test_make_vec_hands_the_time_limit_on(limit):
    env = gym.make_vec(NAME, num_envs=3, truth="full", max_episode_steps=limit)
    assert (
        isinstance(env.unwrapped, PropulsionVectorEnv) and env.unwrapped.max_episode_steps == limit
    )
    env.reset(seed=1)
    ends = [env.step(np.zeros((3, 3), np.float32))[3].any() for _ in range(limit)]
    assert ends == [False] * (limit - 1) + [True]


def test_make_vec_takes_the_factors():
    off = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    env = gym.make_vec(NAME, num_envs=2, preset="npsnet1995", truth="full", **off)
    _, info = env.reset(seed=1, options={"schedule": [], "mission": "cruise"})
    assert info["truth"]["parameters"]["alpha"][0] == -0.0276 / 0.3048
    assert info["truth"]["parameters"]["speed_noise"].tolist() == [0.0, 0.0]


def is_masked(info, n_lanes):
    """Whether every entry, at any depth, is an array of the lanes or a plain dictionary with a
    mask.
    """
    names = [name for name in info if not name.startswith("_")]
    return all(
        info[f"_{name}"].tolist() == [True] * n_lanes
        and (
            is_masked(info[name], n_lanes)
            if type(info[name]) is dict
            else type(info[name]) is np.ndarray and info[name].shape == (n_lanes,)
        )
        for name in names
    )


@pytest.mark.parametrize("level", LEVELS)
def test_info_has_arrays_of_the_lanes_and_masks(level):
    env = PropulsionVectorEnv(70, truth=level)
    _, info = env.reset(seed=1)
    for _ in range(3):
        names = [name for name in info if not name.startswith("_")]
        of_level = {"full": ["true_class", "truth"], "label": ["true_class"], False: []}
        assert names == ["mission_speed", "energy", "cost", *of_level[level]]
        assert is_masked(info, 70) and type(info) is dict
        if level == "full":
            truth = info["truth"]
            assert set(truth) > {"label", "severity", "onset", "parameters", "state"}
            assert set(classes()[1:]) < set(truth["severity"])
            assert set(PARAMETERS) < set(truth["parameters"])
            assert set(list(CHANNELS)[4:]) < set(truth["state"])
            assert truth["label"].tolist() == np.array(classes())[info["true_class"]].tolist()
        *_, info = env.step(np.zeros((70, 3)))


def test_truth_that_is_kept_stays_as_it_was():
    env = PropulsionVectorEnv(2, truth="full")
    _, info = env.reset(seed=1, options={"schedule": [FAULT | {"onset": 0.1}]})
    before = lane_of(info, 0)
    for _ in range(3):
        *_, later = env.step(np.zeros((2, 3)))
    env.reset(seed=2)
    assert lane_of(info, 0) == before and before["truth"]["label"] == "normal"
    assert later["truth"]["label"].tolist() == ["sensor:speed"] * 2


def test_truth_of_a_fleet_is_not_served_stale():
    fleet = Fleet(2)
    fleet.reset([1, 2])
    truth = FleetTruth(fleet)
    kept = dict(truth)
    fleet.step(np.zeros((2, 3)))
    for key in kept:
        with pytest.raises(RuntimeError, match="got a later step; allowed is its own step"):
            truth[key]


def test_what_a_step_returns_is_the_caller_s_own():
    env = PropulsionVectorEnv(3, truth="full")
    twin = PropulsionVectorEnv(3, truth="full")
    rows = [one.reset(seed=1, options={"schedule": [FAULT]}) for one in (env, twin)]
    for _ in range(20):
        observations, *arrays, info = rows[0]
        for values in (
            observations,
            *arrays,
            *info["truth"]["parameters"].values(),
            *info["truth"]["state"].values(),
        ):
            values[:] = 1
        rows = [one.step(np.tile([0.4, 0.1, 0.1], (3, 1))) for one in (env, twin)]
        for one, two in zip(rows[0][:-1], rows[1][:-1], strict=True):
            assert one.tobytes() == two.tobytes()
        assert lane_of(rows[0][-1]["truth"], 1) == lane_of(rows[1][-1]["truth"], 1)


SEEDS = {
    "int": 5,
    "numpy_int": np.int64(5),
    "list": [5, 6, 7],
    "tuple": (5, 6, 7),
    "array": np.array([5, 6, 7]),
}


@pytest.mark.parametrize("seed", SEEDS.values(), ids=SEEDS)
def test_seeds_of_the_lanes(seed):
    observations, _ = PropulsionVectorEnv(3, truth="full").reset(seed=seed)
    singles = [PropulsionEnv(truth="full").reset(seed=5 + lane)[0] for lane in range(3)]
    assert observations.tobytes() == np.array(singles).tobytes()


def test_reset_without_a_seed_goes_on_to_the_next_episode():
    env = PropulsionVectorEnv(2, truth="full")
    single = PropulsionEnv(truth="full")
    env.reset(seed=5)
    single.reset(seed=6)
    for _ in range(3):
        assert env.reset()[0][1].tobytes() == single.reset()[0].tobytes()


def test_schedules_by_lane(tmp_path):
    path = tmp_path / "schedule.json"
    path.write_text('[{"fault": "increased_drag", "onset": 0.1, "severity": 0.25}]')
    env = PropulsionVectorEnv(4, truth="full")
    env.reset(seed=1, options={"schedules": [[FAULT], str(path), [], [FAULT | {"onset": 0.0}]]})
    *_, info = env.step(np.zeros((4, 3)))
    assert info["truth"]["label"].tolist() == ["normal", "normal", "normal", "sensor:speed"]
    *_, info = env.step(np.zeros((4, 3)))
    assert info["truth"]["label"].tolist() == ["normal", "increased_drag", "normal", "sensor:speed"]
    assert info["truth"]["severity"]["increased_drag"].tolist() == [0.0, 0.25, 0.0, 0.0]
    assert info["truth"]["onset"].tolist() == [0.5, 0.1, np.inf, 0.0]


def test_of_equally_severe_faults_both_environments_name_the_first():
    schedule = [
        FAULT | {"onset": 0.0},
        {"fault": "increased_drag", "onset": 0.0, "severity": FAULT["severity"]},
    ]
    single, vector = (
        kind(truth="full").reset(seed=1, options={"schedule": schedule})[1]
        for kind in (PropulsionEnv, PropulsionVectorEnv)
    )
    assert single["truth"]["label"] == vector["truth"]["label"][0] == "sensor:speed"
    assert single["true_class"] == vector["true_class"][0] == classes().index("sensor:speed")
