"""The active environment: contract, rewards that sum up, truth, ends, seeds, and lanes that start
anew.
"""

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from stable_baselines3.common import env_checker

import diagnosers
from auv_fault_env import FaultEvent, Fleet, classes
from auv_fault_env.errors import InputError
from diagnosers.kalman import ParameterFilter
from training.active_env import FEATURES, NAME, ActiveDiagnosisEnv, ActiveDiagnosisVectorEnv
from training.active_env.vector import CONSTANT_SPEEDS, ActiveMissions
from training.stimuli.declaration import Declaration
from training.stimuli.policy_inputs import BOUNDS, FLOOR, compressed_log_odds

LANES = 4
SEED = 11
GONE = [{"fault": "propeller_loss:port", "onset": 3.0, "severity": 1.0}]
BURSTS = [
    {
        "fault": "seal_friction:port",
        "onset": 2.0,
        "severity": 0.9,
        "period": 2.0,
        "duty": 0.5,
        "end": 9.0,
    }
]


def ride(env, actions, **reset):
    """Everything that a run gives, the reset first, as (observation, reward, terminated, truncated,
    info).
    """
    observation, info = env.reset(**reset)
    return [(observation, 0.0, False, False, info), *(env.step(action) for action in actions)]


def until_its_end(env, actions, **reset):
    """The same for a single environment's first episode."""
    rows = [(*env.reset(**reset)[:1], 0.0, False, False, {})]
    for action in actions:
        rows.append(env.step(action))
        if rows[-1][2] or rows[-1][3]:
            break
    return rows


def random_actions(n, lanes=None, seed=0):
    """Random actions (n, lanes, 1), or (n, 1) for a single environment."""
    return np.random.default_rng(seed).uniform(
        -1.0, 1.0, (n, 1) if lanes is None else (n, lanes, 1)
    )


def test_both_checkers_pass_without_a_warning():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gym.make(NAME).unwrapped, skip_render_check=True)
        env_checker.check_env(gym.make(NAME))
    assert not caught, [str(warning.message) for warning in caught]


def test_gymnasium_finds_it_by_the_name_of_its_module():
    code = (
        f"import gymnasium as gym, auv_fault_env; assert '{NAME}' not in gym.registry; "
        f"print(gym.make('training.active_env:{NAME}').spec.max_episode_steps, "
        f"gym.make_vec('training.active_env:{NAME}', num_envs=3).num_envs)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["120", "3"]


def test_spaces_and_features_are_the_documented_ones():
    env = gym.make(NAME)
    assert (
        env.observation_space.shape == (len(FEATURES),) == (31,)
        and env.observation_space.dtype == np.float32
    )
    assert np.isfinite([env.observation_space.low, env.observation_space.high]).all()
    assert (
        FEATURES[:2] == ("log_odds:normal", "log_odds:increased_drag") and FEATURES[-1] == "budget"
    )
    assert tuple(BOUNDS) == FEATURES and all(low < high for low, high in BOUNDS.values())
    for name in FEATURES[len(classes()) :]:
        assert f"`{name}`" in ActiveDiagnosisEnv.__doc__


def by_hand(seed, offsets, schedule):
    """The same seconds with fleet, diagnoser and filter driven by hand: beliefs, estimates and
    readings of each end.
    """
    fleet = Fleet(1)
    bank = diagnosers.make("filter_bank")
    kalman = ParameterFilter()
    reading = fleet.reset([seed], schedules=[schedule], missions=[0.3048])
    bank.reset(1)
    belief = bank.update(reading)
    estimate = kalman.update(kalman.initial(1), reading)
    rows = [(belief, estimate, reading, 0.0)]
    for offset in offsets:
        deviation = 0.0
        for _ in range(10):
            reading = fleet.step([[np.float64(reading[0, 0]) + offset, 0.0, 0.0]])
            belief = bank.update(reading)
            estimate = kalman.update(estimate, reading)
            deviation += fleet.outcomes[2, 0] / 10
        rows.append((belief, estimate, reading, deviation))
    return rows


def test_a_decision_is_ten_samples_of_plant_diagnoser_and_filter():
    actions = random_actions(8)
    event = FaultEvent(**GONE[0])
    env = ActiveDiagnosisEnv(cost_weight=7.0, budget=0.1)
    run = until_its_end(env, actions, seed=5, options={"schedule": GONE, "mission": 0.3048})
    hand = by_hand(5, 0.25 * actions[: len(run) - 1, 0], (event,))
    names = classes()
    cost = 0.0
    assert len(hand) == len(run) > 4
    for k, (belief, estimate, reading, deviation) in enumerate(hand):
        observation, reward, *_, info = run[k]
        if k:
            cost += (0.25 * actions[k - 1, 0]) ** 2
            assert info["cost"] == pytest.approx((0.25 * actions[k - 1, 0]) ** 2)
            then, now = (
                names.index("propeller_loss:port" if s > 3 else "normal") for s in (k - 1, k)
            )
            gain = max(belief[0][0, now], FLOOR) - max(hand[k - 1][0][0][0, then], FLOOR)
            assert reward == pytest.approx(gain - 7.0 * deviation)
        top = 1 + belief[0][0, 1:].argmax()
        named = dict(zip(FEATURES, observation, strict=True))
        np.testing.assert_allclose(
            observation[: len(names)], compressed_log_odds(belief[0])[0], rtol=1e-6
        )
        expected = {
            "severity": belief[1][0, top],
            "alpha": estimate.mean[0, 1],
            "beta_std": estimate.covariance[0, 2, 2] ** 0.5,
            "mission_speed": 0.3048,
            "speed_error": reading[0, 4] - 0.3048,
            "last_offset": actions[k - 1, 0] if k else 0.0,
            "time": np.log1p(k),
            "left": np.log1p(max(0.1**2 * 65.0 - cost, 0.0) / 0.25**2),
        }
        assert {name: named[name] for name in expected} == pytest.approx(
            expected, rel=1e-5, abs=1e-6
        )


def log_probabilities(observation):
    """Of every class, from the bent log odds of an observation."""
    return -np.logaddexp(0.0, -np.sinh(observation[: len(classes())].astype(float)))


@pytest.mark.parametrize(
    "schedule", [[], GONE, BURSTS], ids=["healthy", "abrupt", "bursts_and_repair"]
)
def test_rewards_sum_to_the_difference_of_log_probability_minus_the_cost(schedule):
    options = {"schedule": schedule, "mission": "cruise"}
    dear, free = (
        until_its_end(
            ActiveDiagnosisEnv(cost_weight=weight), random_actions(12), seed=3, options=options
        )
        for weight in (1000.0, 0.0)
    )
    total, cost = (sum(row[1] for row in run) for run in (dear, free))
    cost -= total
    assert len(dear) == len(free) > 4 and cost > 0.05
    # a decision a second; between its bursts too the fault is the truth, after the repair it is not
    is_faulty = schedule and len(dear) - 1 < schedule[0].get("end", np.inf)
    true = classes().index(schedule[0]["fault"]) if is_faulty else 0
    start, end = (
        max(log_probabilities(dear[k][0])[index], FLOOR) for k, index in ((0, 0), (-1, true))
    )
    assert total == pytest.approx(end - start - cost, abs=2e-4)
    assert schedule or abs(end - start) < 1.0


def test_between_its_bursts_an_intermittent_fault_is_true():
    env = ActiveDiagnosisVectorEnv(1)
    env.reset(seed=3, options={"schedule": BURSTS, "mission": "cruise"})
    # sample 20 shows the step before the onset at 2.0 s, sample 90 the last one before the repair
    # at 9.0 s
    np.testing.assert_array_equal(
        env._true_classes._table[:12, 0] > 0, [False] * 3 + [True] * 7 + [False] * 2
    )


def test_a_right_and_a_wrong_declaration_end_the_episode():
    right = ActiveDiagnosisVectorEnv(1)
    run = ride(right, np.ones((12, 1, 1)), seed=1, options={"schedule": GONE, "mission": "cruise"})
    end = next(k for k, row in enumerate(run) if k and row[2][0])
    final = run[end][-1]["final_info"]
    assert 4 <= end <= 8 and final["declared_class"] == [classes().index("propeller_loss:port")]
    assert not run[end][3][0]

    class Wrong(diagnosers.Recursive):
        def initial(self, n_lanes):
            return (np.zeros(n_lanes),)

        def step(self, state, observation):
            sure = np.full((len(observation), len(classes())), -40.0)
            sure[:, 3] = 0.0
            return (state[0] + 1.0,), diagnosers.Belief(
                sure, np.zeros_like(sure), np.zeros_like(sure)
            )

    run = ride(
        ActiveDiagnosisVectorEnv(1, diagnoser=Wrong()), np.ones((1, 1, 1)), options={"schedule": []}
    )
    assert run[1][2].tolist() == [True] and run[1][-1]["final_info"]["declared_class"] == [3]


def test_a_declaration_wants_one_class_for_ten_samples_in_a_row():
    declaration = Declaration(2, 0.9)
    likely = np.full((2, 3), np.log(1e-3))

    def believe(column, n):
        belief = likely.copy()
        belief[:, column] = np.log(0.95)
        for _ in range(n):
            declaration.update(belief)

    believe(1, 9)
    believe(2, 9)
    believe(0, 5)
    believe(2, 9)
    assert declaration.declared.tolist() == [0, 0]
    believe(2, 1)
    believe(1, 20)
    assert declaration.declared.tolist() == [2, 2]
    declaration.reset(np.array([1]))
    assert declaration.declared.tolist() == [2, 0]


def test_lanes_equal_single_environments_through_their_resets():
    actions = random_actions(26, LANES)
    vector = ride(ActiveDiagnosisVectorEnv(LANES, 12), actions, seed=SEED)
    for lane in range(LANES):
        env = gym.make(NAME, max_episode_steps=12)
        observation, info = env.reset(seed=SEED + lane)
        for k, row in enumerate(vector):
            ended = False
            if k:
                observation, reward, terminated, truncated, info = env.step(actions[k - 1, lane])
                assert (reward, terminated, truncated) == tuple(values[lane] for values in row[1:4])
                ended = terminated or truncated
            if ended:
                assert row[-1]["_final_info"][lane]
                assert observation.tobytes() == row[-1]["final_obs"][lane].tobytes()
                assert info["cost"] == row[-1]["final_info"]["cost"][lane]
                assert info["true_class"] == row[-1]["final_info"]["true_class"][lane]
                observation, info = env.reset()
            assert observation.tobytes() == row[0][lane].tobytes()
            assert (
                info["cost"] == row[-1]["cost"][lane]
                and info["mission_speed"] == row[-1]["mission_speed"][lane]
            )


def test_reset_on_the_next_step_is_the_same_with_a_step_between():
    actions = random_actions(20, LANES)
    same, later = (
        ActiveDiagnosisVectorEnv(LANES, 6, autoreset_mode=mode) for mode in ("SameStep", "NextStep")
    )
    assert same.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert later.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    still = {"schedule": [], "mission": "cruise"}
    same_step = ride(same, np.delete(actions, [6, 13], axis=0), seed=SEED, options=still)
    next_step = ride(later, actions, seed=SEED, options=still)
    for k, row in enumerate(same_step[1:], start=1):
        shifted = k + (k - 1) // 6
        assert row[1].tobytes() == next_step[shifted][1].tobytes()
        assert row[3].tobytes() == next_step[shifted][3].tobytes()
    assert same_step[6][-1]["final_obs"][1].tobytes() == next_step[6][0][1].tobytes()
    assert same_step[6][0].tobytes() == next_step[7][0].tobytes()
    assert not next_step[7][1].any() and not next_step[7][2].any() and not next_step[7][3].any()


def test_vector_wrappers_of_gymnasium_drive_it():
    wrap = gym.wrappers
    wrapped_singles = gym.make_vec(
        NAME, 3, "sync", wrappers=[wrap.ClipAction, wrap.NormalizeObservation], max_episode_steps=7
    )
    fleet = gym.make_vec(NAME, 3, max_episode_steps=7)
    for env in (wrapped_singles, fleet):
        env = wrap.vector.RecordEpisodeStatistics(env)
        env.reset(seed=1)
        lengths = []
        for _ in range(60):
            observation, reward, _, _, info = env.step(env.action_space.sample())
            assert env.observation_space.contains(observation) and np.isfinite(reward).all()
            lengths += info["episode"]["l"][info["_episode"]].tolist() if "episode" in info else []
        assert len(lengths) > 10 and max(lengths) == 7


def test_the_same_seed_gives_the_same_run_and_another_one_another():
    first, again, other = (ride(gym.make(NAME), random_actions(5), seed=seed) for seed in (1, 1, 2))
    for step, repeated in zip(first, again, strict=True):
        assert step[0].tobytes() == repeated[0].tobytes() and step[1:4] == repeated[1:4]
    assert first[-1][0].tobytes() != other[-1][0].tobytes()


def test_episodes_are_drawn_as_documented():
    env = ActiveDiagnosisVectorEnv(400, diagnoser="null", truth="full")
    _, info = env.reset(seed=1)
    onset = info["truth"]["onset"]
    assert 0.24 < np.isinf(onset).mean() < 0.36
    assert 5.0 <= onset.min() and 35.0 < onset[np.isfinite(onset)].max() <= 40.0
    legs = env.fleet.plan.legs[:, :, 1]
    constant = (legs == legs[:, :1]).all(axis=1)
    assert 0.42 < constant.mean() < 0.58
    assert CONSTANT_SPEEDS[0] <= legs[constant].min() and legs[constant].max() <= CONSTANT_SPEEDS[1]
    assert isinstance(env.fleet.missions, ActiveMissions)


@pytest.mark.parametrize("name", ["filter_bank", "integrated", "null"])
def test_diagnosers_by_name(name):
    env = ActiveDiagnosisVectorEnv(2, 3, diagnoser=name)
    for observation, *_ in ride(env, random_actions(4, 2), seed=1):
        assert env.observation_space.contains(observation)


def test_commands_and_features_keep_their_limits():
    env = ActiveDiagnosisVectorEnv(2, amplitude=1.0, declare=1.0)
    run = ride(
        env, [np.array([[-1.0], [9.0]])] * 70, seed=2, options={"schedule": GONE, "mission": 0.4}
    )
    assert all(env.observation_space.contains(row[0]) for row in run)
    # clipped to 0 and 1 m/s, as is the action 9
    assert run[5][-1]["cost"] == pytest.approx([0.4**2, 0.6**2])
    assert run[-1][0][1, -1] == BOUNDS["left"][0]


WRONG = {
    "diagnoser": (
        dict(diagnoser="filter_bnak"),
        "diagnoser: got 'filter_bnak'.*did you mean 'filter_bank'",
    ),
    "budget": (dict(budget=0.0), "budget: got 0.0"),
    "amplitude": (dict(amplitude=-0.1), "amplitude: got -0.1"),
    "cost_weight": (dict(cost_weight=float("nan")), "cost_weight: got nan"),
    "declare": (dict(declare=0.3), "declare: got 0.3"),
    "mode": (
        dict(autoreset_mode="Sometimes"),
        "autoreset_mode: got 'Sometimes'; allowed is one of NextStep, SameStep, Disabled",
    ),
    "lanes": (dict(num_envs=0), "number of lanes: got 0"),
    "limit": (dict(max_episode_steps=0), "max_episode_steps: got 0"),
}


@pytest.mark.parametrize("settings, message", WRONG.values(), ids=WRONG)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        ActiveDiagnosisVectorEnv(**settings)


@pytest.mark.parametrize(
    "action",
    [
        *([0.0], [[0.0], [0.0], [0.0]], [[float("nan")], [0.0]], "fast"),
        *([[10**400], [0.0]], np.ones((2, 1), complex), np.zeros((2, 1), "M8[s]")),
    ],
)
def test_bad_actions_are_refused(action):
    env = ActiveDiagnosisVectorEnv(2, diagnoser="null")
    env.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step(action)


def test_bad_resets_are_refused():
    env = ActiveDiagnosisVectorEnv(2, 20, diagnoser="null")
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros((2, 1)))
    with pytest.raises(InputError, match=r"onset of propeller_loss:port: got 30\.0"):
        env.reset(options={"schedule": [GONE[0] | {"onset": 30.0}]})
    with pytest.raises(InputError, match="reset option: got 'misson'"):
        env.reset(options={"misson": "cruise"})
