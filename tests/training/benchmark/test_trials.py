import contextlib
import functools
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, Recursive, make
from diagnosers.third_party import ThirdParty
from training import metrics
from training.benchmark import trial_store, trials
from training.benchmark.suites import Episode, load
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    THRESHOLD,
    Entrant,
    Trial,
    lane_truth,
    run_trial,
    simulate_trial,
)
from training.metrics import Edges, records
from training.metrics.records import PERSISTENCE, Record, concatenate_lanes, healthy_outcome
from training.stimuli import BUDGET, STIMULI

IDEAL = load("ideal")
RANDOM = Entrant("random", functools.partial(make, "random"))
N_CLASSES = len(classes())


def trial(entrant=RANDOM, stimulus="thesis", part=FAULTY, n=4, **changes):
    episodes = IDEAL.episodes[:n]
    if part != FAULTY:
        episodes = tuple(episode._replace(schedule=()) for episode in episodes)
    return Trial(entrant, STIMULI[stimulus](), part, IDEAL.conditions, episodes)._replace(**changes)


def record(seed, n_lanes):
    random = np.random.default_rng(seed)
    steps = random.standard_normal((650, n_lanes)).astype(np.float32)
    log_normal = -np.abs(steps.cumsum(axis=0) + random.choice([0, 20], n_lanes)).astype(np.float32)
    whole = [np.zeros((5, n_lanes, N_CLASSES), np.float32)] * 3
    fault = random.integers(1, N_CLASSES, log_normal.shape).astype(np.int8)
    return Record(log_normal, fault, log_normal, *whole)


@pytest.mark.parametrize("allowed", [0, 3, 40])
def test_threshold_of_the_chunks_is_exactly_that_of_all_lanes(allowed):
    seen = [record(seed, n_lanes) for seed, n_lanes in ((0, 50), (1, 50), (2, 7))]
    kept = concatenate_lanes(
        [healthy_outcome(one, np.full(one.fault.shape[1], 10.0), most_alarms=40) for one in seen]
    )
    full = np.concatenate([one.log_normal for one in seen], axis=1)
    mean_time = full.size * 0.1 / (allowed + 0.5)
    found = metrics.threshold_within(Edges(kept.low, kept.high), allowed)
    assert found == metrics.threshold_for(full, mean_time, PERSISTENCE)
    # and little is kept for it
    assert kept.low.size < 0.2 * metrics.edges(full, PERSISTENCE).low.size


def test_what_is_left_of_healthy_lanes_counts_as_the_lanes_themselves():
    seen = record(3, 30)
    onset = np.linspace(5.0, 30.0, 30)
    left = healthy_outcome(seen, onset)
    for threshold in (-60.0, -20.0, -5.0, -0.2):
        alarm = metrics.alarms(seen.log_normal, threshold, PERSISTENCE)
        assert (
            metrics.count_alarms(Edges(left.low, left.high), threshold)
            == metrics.rising(alarm).sum()
        )
        assert (left.least < threshold).sum() == alarm.any(axis=0).sum()
        for k, time in enumerate(records.DECISION_TIMES):
            at = metrics.sample_at(onset + time), np.arange(30)
            np.testing.assert_array_equal(left.depth[k] < threshold, alarm[at])
            np.testing.assert_array_equal(left.fault[k], seen.fault[at])
    assert left.hours.sum() == pytest.approx(30 * 65 / 3600)


def belief(probability):
    return Belief(np.log(probability), *(np.zeros_like(probability) for _ in range(2)))


EVEN = np.full((2, N_CLASSES), 1 / N_CLASSES)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (belief(EVEN * 1.01), "probabilities sum to 1.01"),
        (belief(EVEN * 0.5), "probabilities sum to 0.5"),
        (belief(EVEN)._replace(log_probability=np.full_like(EVEN, np.nan)), "belief is NaN"),
        (belief(EVEN)._replace(severity_std=np.full_like(EVEN, np.nan)), "belief is NaN"),
        (belief(EVEN[:1]), "log_probability has shape (1, 20) instead of (2, 20)"),
        (belief(EVEN)._replace(severity_mean=EVEN[:, 1:]), "severity_mean has shape (2, 19)"),
        (None, "belief is NoneType"),
    ],
)
def test_what_is_no_belief_is_refused_with_what_and_when(given, words):
    records.ordered_belief(belief(EVEN * (1 + 5e-4)), classes(), 2, 11)
    with pytest.raises(ValueError) as refused:
        records.ordered_belief(given, classes(), 2, 12)
    assert words in str(refused.value) and str(refused.value).endswith("at 1.2 s")


def test_beliefs_are_kept_by_the_names_of_their_classes():
    turned = classes()[::-1]
    probability = np.full((1, N_CLASSES), 0.3 / (N_CLASSES - 2))
    probability[0, turned.index("normal")] = 0.5
    probability[0, turned.index("increased_drag")] = 0.2
    recorder = records.Recorder(1, np.zeros((1, 1), np.int64))
    ordered = records.ordered_belief(belief(probability), turned, 1, 0)
    recorder.add(0, ordered)
    assert np.exp(recorder.record.log_normal[0, 0]) == pytest.approx(0.5)
    assert recorder.record.fault[0, 0] == classes().index("increased_drag")
    np.testing.assert_allclose(
        recorder.record.log_probability[0, 0], ordered.log_probability[0], rtol=1e-6
    )


def test_truth_of_faulty_lanes():
    truth = lane_truth(IDEAL.conditions, IDEAL.episodes[:50])
    first = [episode.schedule[0] for episode in IDEAL.episodes[:50]]
    names = [classes()[k] for k in truth.at_instants.fault]
    assert names == [CATALOGUE[event.fault].diagnosis for event in first]
    np.testing.assert_array_equal(truth.at_instants.onset, [event.onset for event in first])
    np.testing.assert_allclose(truth.full_severity, [event.severity for event in first], rtol=1e-6)
    assert (truth.at_instants.label[0] == truth.at_instants.fault).all() and (
        (truth.instants >= 0) & (truth.instants < 650)
    ).all()


def test_of_two_faults_the_worse_is_to_be_found_from_the_first_onset_on():
    suite = load("ood_compound")
    truth = lane_truth(suite.conditions, suite.episodes)
    first = [CATALOGUE[episode.schedule[0].fault].diagnosis for episode in suite.episodes]
    assert [classes()[k] for k in truth.at_instants.fault] == first
    assert (
        truth.at_instants.onset == [episode.schedule[0].onset for episode in suite.episodes]
    ).all()


def test_truth_of_faults_that_no_class_describes():
    suite = load("unknown_faults")
    truth = lane_truth(suite.conditions, suite.episodes)
    names = np.array(classes())
    assert not truth.explained.any()
    for k, episode in enumerate(suite.episodes):
        right = set(names[truth.right_classes[k]])
        assert "unknown" in right and "normal" not in right
        if len(episode.schedule) == 1:
            assert names[truth.at_instants.fault[k]] == "unknown"
        if episode.schedule[0].fault == "worn_brushes:port":
            assert right == {"motor_overheating:port", "unknown"}
        if episode.schedule[0].fault == "seal_friction:port":
            assert right == {"seal_friction:port", "seal_friction:starboard", "unknown"}


def test_truth_of_healthy_lanes():
    truth = lane_truth(IDEAL.conditions, trial(part=COUNTING, n=40).episodes)
    assert (
        not truth.at_instants.fault.any()
        and not truth.at_instants.label.any()
        and (truth.full_severity == 0.6).all()
    )
    assert 5.0 <= truth.at_instants.onset.min() < truth.at_instants.onset.max() <= 30.0


@pytest.mark.parametrize("part", trials.PARTS)
def test_a_trial_repeats_bit_for_bit(part):
    first, again = (run_trial(trial(part=part)) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert isinstance(first, trials.FaultyOutcome if part == FAULTY else records.HealthyOutcome)


def test_stimuli_are_tried_on_the_same_vehicles_with_the_same_rudder():
    seen = {name: simulate_trial(trial(stimulus=name, n=12))[0] for name in STIMULI}
    channel = {name: k for k, name in enumerate(CHANNELS)}
    for name in ("mission_speed", "rudder", "stern_plane"):
        np.testing.assert_array_equal(
            seen["cruise"][:, :, channel[name]], seen["thesis"][:, :, channel[name]]
        )
    assert seen["thesis"][:, :, channel["rudder"]].any()
    steady = [len(episode.mission.legs) == 1 for episode in IDEAL.episodes[:12]]
    for name, offset in (("cruise", 0.0), ("thesis", BUDGET)):
        command, mission = (
            seen[name][1:, steady, channel[kind]] for kind in ("speed_command", "mission_speed")
        )
        np.testing.assert_allclose(np.abs(command - mission), offset, atol=1e-6)


@pytest.mark.parametrize("speed", [0.0, 0.03, 1.0])
def test_commanded_speed_stays_within_the_channel(speed):
    episodes = (Episode(4_999_000_000, (), Mission(((0.0, speed),))),)
    observations, *_ = simulate_trial(trial(part=COUNTING, episodes=episodes))
    command = observations[:, :, INDEX["speed_command"]]
    assert command.min() >= 0.0 and command.max() <= 1.0


def test_energy_and_speed_deviation_are_those_of_the_mission():
    held = Episode(4_999_000_001, (), Mission(((0.0, 0.4),)))
    quiet = replace(
        IDEAL.conditions,
        plant=IDEAL.conditions.plant | {"disturbance": 0.0, "sensor_noise": 0.0},
    )
    cruise, thesis = (
        simulate_trial(trial(stimulus=name, episodes=(held,), conditions=quiet))[2:]
        for name in ("cruise", "thesis")
    )
    assert cruise[1][0] < 0.02 < 0.04 < thesis[1][0] < BUDGET  # the speed lags its command
    assert 10.0 < cruise[0][0] < thesis[0][0]


class Told(Recursive):
    name = "told"
    heard = []

    def initial(self, n_lanes):
        return ()

    def set_truth(self, healthy, severity):
        self.heard.append((healthy, severity))

    def step(self, state, observation):
        return state, belief(np.full((len(observation), N_CLASSES), 1 / N_CLASSES))


def test_a_reference_is_told_the_vehicle_and_the_severity():
    entrant = Entrant("told", Told)
    for part in (FAULTY, THRESHOLD):
        run_trial(trial(entrant, part=part))
    (healthy, severity), (_, calm_severity) = Told.heard
    assert healthy.shape == (4, len(PARAMETERS))
    assert severity.shape == calm_severity.shape == (650, 4)
    # before the onset and at the end that of the fully grown fault
    full = [episode.schedule[0].severity for episode in IDEAL.episodes[:4]]
    np.testing.assert_allclose(severity[[0, -1]], [full, full], rtol=1e-6)
    assert (calm_severity == 0.6).all()


def test_the_severity_told_is_that_of_the_moment():
    ramped = FaultEvent("increased_drag", onset=10.0, severity=0.8, ramp=5.0)
    episode = IDEAL.episodes[0]._replace(schedule=(ramped,))
    truth = lane_truth(IDEAL.conditions, [episode])
    # at half of its ramp half of its severity, in the sample after
    assert truth.severity[126, 0] == pytest.approx(0.4)
    assert truth.severity[[0, 151, 600], 0] == pytest.approx([0.8, 0.8, 0.8])
    assert not truth.abrupt.any()


@pytest.mark.parametrize("part", trials.PARTS)
def test_an_outcome_is_read_as_it_was_written(tmp_path, part):
    outcome = run_trial(trial(part=part))
    for name in "ab":
        trial_store.write(tmp_path / name, outcome)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    found = trial_store.read([tmp_path / "a", tmp_path / "b"], part)
    for kept, value in zip(found, outcome, strict=True):
        half = np.split(kept, 2, axis=min(value.ndim - 1, 1))[1]
        np.testing.assert_array_equal(half, value)
        assert kept.dtype == value.dtype


@pytest.mark.parametrize("kept", [0, 1, 0.1, 0.5, 0.99])
def test_a_damaged_outcome_is_refused(tmp_path, kept):
    path = tmp_path / "a.npz"
    trial_store.write(path, run_trial(trial(part=COUNTING)))
    content = path.read_bytes()
    path.write_bytes(content[: round(kept * len(content))] if kept < 1 else content[:1])
    with pytest.raises(InputError, match=r"a\.npz.*delete it"):
        trial_store.read([path], COUNTING)


def test_an_outcome_with_any_spoilt_byte_is_refused_or_read(tmp_path):
    path = tmp_path / "a.npz"
    trial_store.write(path, run_trial(trial(part=FAULTY, n=1)))
    content = path.read_bytes()
    for k in range(0, len(content), 97):
        path.write_bytes(content[:k] + bytes([content[k] ^ 0x5A]) + content[k + 1 :])
        with contextlib.suppress(InputError):
            trial_store.read([path], FAULTY)


def test_two_classes_of_one_file_are_told_apart(tmp_path):
    path = tmp_path / "two_of_a_test.py"
    path.write_text(
        "from diagnosers.references import Null\nclass A(Null): ...\nclass B(Null): ...\n"
    )
    parties = [ThirdParty(f"{path}:{name}") for name in "AB"]
    first, second = (trial_store.fingerprint(Entrant("x", party), party()) for party in parties)
    assert first != second


class Steering(Told):
    def update(self, observation):
        observation[:] = 0.9
        return super().update(np.zeros_like(observation))


def test_a_diagnoser_cannot_steer_the_vehicle_by_what_it_is_given():
    still, steered = (simulate_trial(trial(Entrant(kind.name, kind))) for kind in (Told, Steering))
    for a, b in zip((still[0], *still[2:]), (steered[0], *steered[2:]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_place_of_an_outcome_hangs_on_all_that_it_is_made_from(tmp_path):
    made_by = trial_store.fingerprint(RANDOM, RANDOM.make())
    one = trial()
    others = [
        (one, made_by + "x"),
        (one._replace(stimulus=STIMULI["thesis"](0.05)), made_by),
        (one._replace(stimulus=STIMULI["cruise"]()), made_by),
        (one._replace(part=COUNTING), made_by),
        (one._replace(episodes=one.episodes[1:]), made_by),
        (one._replace(conditions=replace(one.conditions, duration=66.0)), made_by),
    ]
    places = [trial_store.path_of(tmp_path, *item) for item in [(one, made_by), *others]]
    assert len(set(places)) == len(places)
    assert trial_store.path_of(tmp_path, trial(), made_by) == places[0]


def test_the_fingerprint_tells_settings_weights_and_code_apart():
    networks = [make("raw_network"), make("raw_network")]
    made = [*networks, make("random"), make("random", seed=1), make("null")]
    prints = [trial_store.fingerprint(Entrant("x", lambda: None), one) for one in made]
    assert prints[0] == prints[1]
    assert len(set(prints)) == len(prints) - 1
    tensors = networks[0].tensors()
    name = next(iter(tensors))
    changed = {**tensors, name: tensors[name] + 1}
    assert trial_store.weights_digest(
        make("raw_network", weights=changed)
    ) != trial_store.weights_digest(networks[0])
    assert trial_store.weights_digest(make("null")) is None
