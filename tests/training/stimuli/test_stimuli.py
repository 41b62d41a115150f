import pickle

import numpy as np
import pytest

from auv_fault_env import MISSIONS, FaultEvent, Fleet, classes
from auv_fault_env.channels import CHANNELS, INDEX, MAXIMUM_COMMAND
from auv_fault_env.errors import InputError
from diagnosers import Belief, make
from training.stimuli import BUDGET, EPISODE_TIME, STIMULI, Cruise, Thesis
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop
from training.stimuli.d_optimal import candidates, d_optimal, log_information
from training.stimuli.standing import Standing
from training.stimuli.triggered import EXCITATION_TIME, Triggered
from training.stimuli.waveforms import multisine, prbs, square

MISSION_SPEED = INDEX["mission_speed"]
OBSERVATION = np.zeros((3, len(CHANNELS)))
OBSERVATION[:, [INDEX[name] for name in ("mission_speed", "speed_command", "speed")]] = 0.3
CLOSED = [name for name, stimulus in STIMULI.items() if issubclass(stimulus, ClosedLoop)]
# those that spend nothing without a suspicion
WAITING = [name for name in CLOSED if not issubclass(STIMULI[name], Standing)]
AT_MISSION_SPEED = [name for name, stimulus in STIMULI.items() if issubclass(stimulus, Cruise)]
TRIGGERED = [name for name, stimulus in STIMULI.items() if issubclass(stimulus, Triggered)]
N_SAMPLES = round(EPISODE_TIME * 10)
N_CLASSES = len(classes())

# The mission speeds of the last two lanes leave no room below and above.
FAULTS = {
    "increased_drag": 0.3,
    "seal_friction:port": 0.2,
    "propeller_damage:starboard": 0.5,
    "sensor_scale:speed": 0.3,
    "propeller_loss:port": 0.02,
}
SCHEDULES = [(), (), *((FaultEvent(name, 8.0, 0.8),) for name in FAULTS)]
SPEEDS = [0.3, 0.97, *FAULTS.values()]


def belief(normal, n_lanes=3):
    """A belief with this probability of `normal`, the rest shared."""
    log_probability = np.log(
        np.full(
            (n_lanes, N_CLASSES), (1.0 - np.asarray(normal, float).reshape(-1, 1)) / (N_CLASSES - 1)
        )
    )
    log_probability[:, 0] = np.log(normal)
    return Belief(
        log_probability, np.full((n_lanes, N_CLASSES), 0.5), np.full((n_lanes, N_CLASSES), 0.3)
    )


def offsets(stimulus, n_samples=N_SAMPLES, normal=0.2):
    return np.array([stimulus.offset(k, OBSERVATION, belief(normal)) for k in range(n_samples)])


def in_the_loop(stimulus, schedules=SCHEDULES, speeds=SPEEDS):
    """Offsets (n_samples, n_lanes) of an episode with the Gaussian bank, and the commands [m/s]."""
    fleet = Fleet(len(schedules))
    bank = make("gaussian_bank")
    observation = fleet.reset(range(len(schedules)), schedules=schedules, missions=speeds)
    bank.reset(len(schedules))
    found = np.empty((N_SAMPLES, len(schedules)))
    for k in range(N_SAMPLES):
        found[k] = stimulus.offset(k, observation, bank.update(observation))
        command = observation[:, MISSION_SPEED] + found[k]
        assert (command >= 0.0).all() and (command <= MAXIMUM_COMMAND).all()
        observation = fleet.step(np.column_stack([command, np.zeros((len(schedules), 2))]))
    return found


@pytest.mark.parametrize("budget", [0.05, 0.1])
@pytest.mark.parametrize("name", STIMULI)
def test_no_stimulus_spends_more_than_its_budget_with_a_diagnoser_in_the_loop(name, budget):
    found = in_the_loop(STIMULI[name](budget))
    assert (np.sqrt(np.mean(found**2, axis=0)) <= budget * (1 + 1e-9)).all()
    assert name in AT_MISSION_SPEED or np.abs(found[:, 2:5]).max() > 0.25 * budget
    if name in CLOSED:
        assert np.abs(found).max() <= LARGEST_OFFSET
    if name in WAITING:
        healthy, faulty = (found[:, lanes] for lanes in (slice(0, 2), slice(2, 5)))
        assert np.sqrt(np.mean(healthy**2)) < 0.5 * budget and np.mean(healthy**2) < np.mean(
            faulty**2
        )


@pytest.mark.parametrize("name", STIMULI)
def test_a_budget_of_zero_is_cruise(name):
    for normal in (0.9, 1e-3):
        assert not offsets(STIMULI[name](0.0), normal=normal).any()


@pytest.mark.parametrize("name", CLOSED)
def test_whatever_is_believed_the_allowance_is_not_overdrawn(name):
    stimulus = STIMULI[name](0.1)
    random = np.random.default_rng(0)
    found = []
    for k in range(2 * N_SAMPLES):
        changing_belief = belief(random.uniform(0.001, 0.999, 3) ** 4)
        changing_belief.log_probability[:, 1:] += np.log(
            (N_CLASSES - 1) * random.dirichlet([0.1] * (N_CLASSES - 1), 3).clip(1e-9)
        )
        found.append(stimulus.offset(k, OBSERVATION, changing_belief))
    spent = np.sum(np.square(found), axis=0)
    assert (spent <= N_SAMPLES * 0.1**2 * (1 + 1e-9)).all() and (
        spent > 0.2 * N_SAMPLES * 0.1**2
    ).all()


@pytest.mark.parametrize("name", STIMULI)
def test_an_episode_repeats_and_lanes_do_not_depend_on_each_other(name):
    stimulus = STIMULI[name]()
    first = in_the_loop(stimulus)
    again = in_the_loop(stimulus)
    np.testing.assert_array_equal(first, again)
    few = in_the_loop(pickle.loads(pickle.dumps(stimulus)), SCHEDULES[:3], SPEEDS[:3])
    np.testing.assert_array_equal(few, first[:, :3])


@pytest.mark.parametrize("name", STIMULI)
def test_a_stimulus_is_known_by_its_name_and_budget(name):
    stimulus = STIMULI[name](0.03)
    text = repr(STIMULI[name](0.03))
    assert stimulus.name == name
    assert "0.03" in text and type(stimulus).__name__ in text
    offsets(stimulus, 3)
    assert stimulus == STIMULI[name](0.03) != STIMULI[name](0.04)
    assert repr(stimulus) == text  # a benchmark knows its trials by it


@pytest.mark.parametrize("budget", [-0.01, MAXIMUM_COMMAND + 0.1, float("nan")])
@pytest.mark.parametrize("name", STIMULI)
def test_a_budget_that_is_none_is_refused(name, budget):
    with pytest.raises(InputError, match=f"budget of {name}"):
        STIMULI[name](budget)


@pytest.mark.parametrize("name", CLOSED)
def test_mixed_batches_are_refused(name):
    stimulus = STIMULI[name]()
    with pytest.raises(InputError, match="sample and number of lanes"):
        stimulus.offset(1, OBSERVATION, belief(0.5))
    offsets(stimulus, 3)
    for sample, lanes in ((2, 3), (4, 3), (3, 2)):
        with pytest.raises(InputError, match="use one instance of the stimulus for each batch"):
            stimulus.offset(sample, OBSERVATION[:lanes], belief(0.5, lanes))
    stimulus.offset(3, OBSERVATION, belief(0.5))


def test_the_thesis_goes_slow_first_then_fast_for_ten_seconds_each():
    found = offsets(Thesis())[:, 0]
    assert BUDGET == pytest.approx(0.0762)  # 0.25 ft/s
    np.testing.assert_array_equal(found[:300], np.repeat([-BUDGET, BUDGET, -BUDGET], 100))


def test_about_three_quarters_of_a_foot_per_second_it_is_the_thesis_mission():
    legs = MISSIONS["thesis"].legs
    found = 0.75 * 0.3048 + offsets(Thesis(), 300)[:, 0]
    np.testing.assert_allclose(found[::100], [speed for _, speed in legs[:3]])


def test_waves_have_a_root_mean_square_of_one_and_open_loops_repeat_them():
    for wave in (
        square(),
        prbs(),
        multisine(),
        d_optimal(EPISODE_TIME),
        d_optimal(EXCITATION_TIME),
    ):
        assert np.sqrt(np.mean(wave**2)) == pytest.approx(1.0, rel=1e-12)
    for name in ("prbs", "multisine", "d_optimal"):
        wave = STIMULI[name].wave()
        np.testing.assert_allclose(
            offsets(STIMULI[name](0.04), 700)[:, 1], 0.04 * np.resize(wave, 700)
        )
    assert N_SAMPLES % multisine().size == N_SAMPLES % d_optimal(EPISODE_TIME).size == 0


def test_the_pseudo_random_sequence_is_of_maximum_length():
    bits = prbs()[::20]
    assert len(bits) == 31 and abs(bits.sum()) == 1.0
    shifted = np.array([bits @ np.roll(bits, lag) for lag in range(1, 31)])
    assert (shifted == -1.0).all()  # its autocorrelation has two values: 31 and -1


def test_harmonics_of_the_multisine_are_equal_and_its_peak_is_low():
    size = np.abs(np.fft.rfft(multisine()))
    np.testing.assert_allclose(size[1:9], size[1], rtol=1e-9)
    assert size[0] < 1e-9 * size[1] and size[9:].max() < 1e-9 * size[1]
    assert np.abs(multisine()).max() < 2.0  # eight cosines in phase have 4


def test_the_d_optimal_profile_has_more_information_than_the_thesis_and_any_candidate():
    best = d_optimal(EPISODE_TIME)
    thesis = np.resize(square(), N_SAMPLES)
    others = np.stack(
        [best, thesis, np.resize(prbs(), N_SAMPLES), multisine()[np.arange(N_SAMPLES) % 325]]
    )
    information = log_information(BUDGET * others)
    assert information[0] > information[1:].max() + 0.1
    few = candidates(EPISODE_TIME)[::13]
    assert log_information(BUDGET * few).max() <= information[0] + 1e-9
    assert abs(best.mean()) < 0.01 and np.abs(best).max() * BUDGET < LARGEST_OFFSET


def test_constant_speed_has_less_information_on_drag_and_thrust_than_any_profile():
    information = log_information(np.array([np.zeros(200), 0.02 * np.resize(square(), 200)]))
    assert information[0] < information[1] - 0.2


@pytest.mark.parametrize("name", TRIGGERED)
def test_a_trigger_cruises_until_a_fault_is_suspected_and_then_spends_the_allowance(name):
    stimulus = STIMULI[name](0.05)
    found = []
    for k in range(N_SAMPLES):
        normal = 0.6, 0.4 if k == 300 else 0.7, 0.4 if k >= 300 else 0.99
        found.append(stimulus.offset(k, OBSERVATION, belief(normal)))
    quiet, lasting, suspected = np.transpose(found)
    assert not quiet.any() and not lasting[:300].any() and not suspected[:300].any()
    amplitude = 0.05 * np.sqrt(EPISODE_TIME / EXCITATION_TIME)  # 0.09 m/s
    np.testing.assert_allclose(lasting, suspected, atol=1e-6)  # 0.7 does not stop it
    assert np.mean(suspected[300:500] ** 2) == pytest.approx(amplitude**2, rel=0.02)
    assert np.abs(suspected[510:]).max() < 0.01  # spent


@pytest.mark.parametrize("name", TRIGGERED)
def test_a_trigger_stops_and_saves_the_rest_for_later(name):
    stimulus = STIMULI[name](0.1)
    normal = np.where(np.arange(N_SAMPLES) % 100 < 10, 0.01, 0.99)
    found = np.array([stimulus.offset(k, OBSERVATION, belief(p)) for k, p in enumerate(normal)])
    active = np.abs(found[:, 0]) > 0
    np.testing.assert_array_equal(active, normal < 0.5)
    assert np.abs(found[:10]).max() > np.abs(found[600:]).max() > 0


def wavering(*names, severity=0.6):
    """Three lanes with these classes equally likely."""
    log_probability = np.full((3, N_CLASSES), -20.0)
    for name in names:
        log_probability[:, classes().index(name)] = -np.log(len(names))
    return Belief(log_probability, np.full((3, N_CLASSES), severity), np.full((3, N_CLASSES), 0.1))


def first_greedy_offset(belief_at_start, budget=0.0762):
    return STIMULI["greedy"](budget).offset(0, OBSERVATION, belief_at_start)


def test_greedy_changes_speed_to_separate_drag_from_thrust():
    confounded = first_greedy_offset(wavering("increased_drag", "propeller_damage:port"))
    assert (np.abs(confounded) > 0.02).all() and len(set(confounded)) == 1


def test_greedy_is_silent_where_nothing_is_to_be_gained():
    assert not first_greedy_offset(wavering("normal")).any()
    # the same vehicle twice
    assert not first_greedy_offset(wavering("increased_drag", "normal", severity=0.0)).any()
    dear = wavering("increased_drag", "propeller_damage:port")
    assert (
        first_greedy_offset(dear, budget=0.1).all()
        and not first_greedy_offset(dear, budget=0.005).any()
    )


def test_greedy_holds_an_offset_for_a_second():
    stimulus = STIMULI["greedy"]()
    doubt = wavering("increased_drag", "propeller_damage:port")
    sure = wavering("normal")
    found = np.array(
        [stimulus.offset(k, OBSERVATION, sure if k % 20 else doubt) for k in range(40)]
    )[:, 0]
    first = found[0]
    assert first != 0.0
    np.testing.assert_array_equal(found[:20], np.repeat([first, 0.0], 10))
    assert found[20] != 0.0


def test_every_stimulus_has_a_block_of_seeds_of_its_own():
    blocks = [stimulus.seed_block for stimulus in STIMULI.values()]
    assert len(set(blocks)) == len(blocks) and min(blocks) >= 0
    # published results rest on these vehicles
    assert blocks[:16] == list(range(16))
