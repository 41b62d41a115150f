"""Training on a vehicle with one shaft whose logs are slow and lack channels."""

import numpy as np
import pytest

import diagnosers
from auv_fault_env import classes
from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.noise import episode_keys
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import ScheduleSampler
from diagnosers.shafts import with_equal_readings, with_equal_shafts
from training.field.logged import logged_vehicle
from training.field.vehicle_file import Column, VehicleFile
from training.learning import episode_sets, integrated, kalman_network, learner, raw_network
from training.learning.episode_sets import simulate_set
from training.learning.episodes import training_episodes, without_gaps
from training.learning.integrated import IntegratedTrainer
from training.learning.kalman_network import KalmanNetworkTrainer
from training.learning.raw_network import RawNetworkTrainer
from training.learning.trainer import make_trainer
from training.logged_vehicle import THESIS
from training.rollouts import roll_out
from training.seeds import seeds

FILE = VehicleFile(
    PRESETS["remus100"],
    {name: Column(name) for name in ("mission_speed", "speed", "port_current", "port_rpm")},
    sample_rate=5.0,
    noise={"speed": 0.03},
)
VEHICLE = logged_vehicle(FILE)
CLASSES = classes()
N_SAMPLES = 80


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for name, value in dict(LANES=8, SETS=1, VALIDATION_SETS=1, NETWORKS=1).items():
        monkeypatch.setattr(integrated, name, value)
    monkeypatch.setattr(integrated, "ENCODER_EPOCHS", 0)
    monkeypatch.setattr(learner, "ENCODER_STEPS", 2)
    monkeypatch.setattr(learner, "SAMPLES_PER_SET", 16)
    monkeypatch.setattr(episode_sets, "LANES", 8)
    monkeypatch.setattr(episode_sets, "BATCH", 4)
    monkeypatch.setattr(raw_network, "LANES", 32)
    monkeypatch.setattr(raw_network, "BATCH", 64)
    monkeypatch.setattr(kalman_network, "LANES", 64)
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", N_SAMPLES)


def test_without_a_vehicle_the_rollouts_are_those_of_the_plain_fleet():
    first, *_ = training_episodes("training", 16)
    lanes = seeds("training", 16)[:4]
    keys = episode_keys(np.array(lanes, np.uint64), np.zeros(4, np.uint64))
    events = ScheduleSampler().sample_events(keys)
    fleet = Fleet(4, realism=1.0)
    plain = roll_out(fleet, lanes, N_SAMPLES, None, events, [MISSIONS["thesis"]] * 4)
    for part, expected in zip(first, plain, strict=True):
        np.testing.assert_array_equal(part, expected, strict=True)


def test_episodes_have_the_readings_the_rate_and_the_faults_of_the_vehicle(monkeypatch):
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", 350)  # all faults have begun
    rollouts = list(training_episodes("training", 64, unknown=0.2, vehicle=VEHICLE))
    observations = np.concatenate([rollout.observations for rollout in rollouts], axis=1)
    for name in ("acceleration", "port_voltage", "starboard_rpm"):
        assert np.isnan(observations[:, :, INDEX[name]]).all()
    is_read = ~np.isnan(observations[:, :, INDEX["port_rpm"]])
    assert is_read[::2].all() and not is_read[1::2].any()
    label = np.concatenate([rollout.label for rollout in rollouts], axis=1)
    names = {CLASSES[k] for k in np.unique(label)}
    assert len(names) > 5
    assert not [name for name in names if "starboard" in name]
    assert not names & {"sensor:acceleration", "sensor:port_voltage"}


def test_missions_reach_the_largest_speed_of_the_vehicle():
    rollouts = training_episodes("training", 64, vehicle=VEHICLE)
    speeds = [rollout.observations[0, :, INDEX["mission_speed"]] for rollout in rollouts]
    fastest = np.nanmax(np.concatenate(speeds)) / PRESETS["remus100"].maximum_speed
    assert 0.85 < fastest <= 1.0


def test_gaps_are_filled_as_a_diagnoser_fills_them():
    first, *_ = training_episodes("training", 16, vehicle=VEHICLE)
    filled = without_gaps(first.observations)
    diagnoser = diagnosers.make("raw_network")
    diagnoser.reset(filled.shape[1])
    for observation, expected in zip(first.observations, filled, strict=True):
        diagnoser.update(observation)
        np.testing.assert_array_equal(diagnoser.running.observation, expected)


def test_features_are_those_that_the_trained_network_sees(monkeypatch, tmp_path):
    trainer = IntegratedTrainer(0, VEHICLE)
    trainer.epoch(0)
    diagnoser, _ = trainer.finish()
    diagnoser.save(tmp_path / "weights.safetensors")
    loaded = diagnosers.load(tmp_path / "weights.safetensors")
    seen = []
    step = loaded._features.step
    monkeypatch.setattr(
        loaded._features, "step", lambda *given: seen.append(step(*given)) or seen[-1]
    )
    rollouts = training_episodes(
        "validation", 8, 0, episode_sets.SCHEDULES, episode_sets.UNKNOWN_SHARE, VEHICLE
    )
    observations = np.concatenate([rollout.observations for rollout in rollouts], axis=1)
    loaded.reset(8)
    for observation in observations:
        belief = loaded.update(observation)
    features = np.stack([features for _, features, _ in seen])
    expected = simulate_set("validation", 0, VEHICLE).features.numpy()
    np.testing.assert_array_equal(features, expected)
    assert np.isfinite(features).all() and np.isfinite(belief.log_probability).all()
    assert loaded.settings() == diagnoser.settings()
    assert loaded.vehicle.shafts == 1


def test_a_vehicle_with_one_shaft_is_not_mirrored(monkeypatch):
    monkeypatch.setattr(learner, "mirrored", lambda samples: pytest.fail("mirrored"))
    IntegratedTrainer(0, VEHICLE).epoch(0)
    with pytest.raises(pytest.fail.Exception):
        IntegratedTrainer(0, THESIS).epoch(0)


def test_the_raw_network_takes_over_the_scale_of_its_inputs():
    trainer = RawNetworkTrainer(0, VEHICLE)
    trainer.epoch(0)
    random = np.random.default_rng(0)
    observations, label = raw_network.samples("training", 16, 0, random, VEHICLE)
    diagnoser, _ = trainer.finish()
    log_probability = diagnoser.step((), observations.astype(float))[1].log_probability
    expected = -log_probability[np.arange(len(label)), label].mean()
    assert trainer.loss(observations, label).item() == pytest.approx(expected, rel=1e-5)
    assert not np.allclose(trainer.scale, 1.0)


def test_the_kalman_network_sees_two_equal_shafts_and_names_the_one_there_is(monkeypatch):
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", 350)  # all faults have begun
    trainer = KalmanNetworkTrainer(0, VEHICLE)
    trainer.epoch(0)
    diagnoser, _ = trainer.finish()
    assert diagnoser.vehicle == VEHICLE.vehicle
    diagnoser.reset(1)
    belief = diagnoser.update(np.full((1, len(CHANNELS)), 0.5))
    of_starboard = [k for k, name in enumerate(CLASSES) if name.endswith(":starboard")]
    assert of_starboard
    assert (np.exp(belief.log_probability[0, of_starboard]) < 1e-9).all()


def test_a_single_shaft_becomes_two_that_share_thrust_and_readings():
    single = PRESETS["remus100"]
    assert with_equal_shafts(single).shafts == 2
    observation = np.arange(len(CHANNELS), dtype=float)[None]
    both = with_equal_readings(observation, single)
    assert both[0, INDEX["starboard_rpm"]] == both[0, INDEX["port_rpm"]] == INDEX["port_rpm"]
    assert with_equal_readings(observation, PRESETS["thesis1992"]) is observation


def test_relations_are_not_trained_on_a_vehicle_file():
    with pytest.raises(InputError, match=r"a network with --vehicle: .*auv-fault calibrate"):
        make_trainer("residuals", 0, VEHICLE)
