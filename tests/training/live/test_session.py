import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, NORMAL
from training.live.session import BATTERY, DIAGNOSERS, Session
from training.metrics import sample_at
from training.stimuli import STIMULI, Cruise
from training.stimuli.base import N_SAMPLES


def run(session, seconds):
    for _ in range(sample_at(seconds)):
        session.step()
    return session.history()


def test_an_injected_fault_is_named_within_ten_seconds_and_then_repaired():
    session = Session(seed=1)
    assert run(session, 10.0).verdict == NORMAL
    session.inject("propeller_loss:port")
    history = run(session, 10.0)
    assert history.verdict == "propeller_loss:port"
    assert history.alarms()[0][0] > 10.0
    assert [(mark.time, mark.action) for mark in history.marks] == [(10.0, "fault")]
    assert session.truth().label == "propeller_loss:port"
    assert session.truth().parameters["port_beta"][1] == 0.0
    session.repair()
    session.step()
    assert session.truth() == (NORMAL, {}, {})
    assert session.history().marks[-1].action == "repair"


@pytest.mark.parametrize("fault", CATALOGUE)
def test_every_fault_can_be_injected(fault):
    session = Session()
    session.inject(fault, severity=0.5)
    session.step()
    assert session.truth().severity == {CATALOGUE[fault].diagnosis: 0.5}


def test_faults_add_up_and_the_same_one_replaces_itself():
    session = Session()
    session.inject("increased_drag", severity=0.2)
    session.inject("seal_friction:port", severity=0.5)
    session.inject("increased_drag", severity=0.9)
    session.step()
    assert session.truth().severity == {"increased_drag": 0.9, "seal_friction:port": 0.5}


def test_a_ramp_grows():
    session = Session()
    session.inject("increased_drag", severity=0.8, ramp=10.0)
    run(session, 5.1)  # the severity in force is that of the last step's beginning
    assert session.truth().severity["increased_drag"] == pytest.approx(0.4)


def test_the_vehicle_follows_the_mission_speed():
    session = Session()
    session.set_mission_speed(0.6)
    history = run(session, 20.0)
    assert history.true_speed[0] == pytest.approx(0.3048, abs=1e-6)
    assert history.true_speed[-1] == pytest.approx(0.6, abs=0.05)
    assert session.travelled == pytest.approx(history.true_speed.sum() * 0.1)
    assert session.energy_left < BATTERY


@pytest.mark.parametrize("name", DIAGNOSERS)
def test_every_diagnoser_can_be_chosen_under_way(name):
    session = Session()
    run(session, 2.0)
    session.choose_diagnoser(name)
    history = run(session, 1.0)
    assert session.diagnoser.name == name
    np.testing.assert_allclose(history.probability.sum(axis=1), np.ones(31))


@pytest.mark.parametrize("name", STIMULI)
def test_every_stimulus_can_be_chosen_under_way(name):
    session = Session()
    session.choose_diagnoser("limits")
    run(session, 1.0)
    session.choose_stimulus(name)
    session.inject("propeller_loss:port")
    command = run(session, 20.0).observation[:, 1]
    assert session.stimulus.name == name
    if not name.startswith("learned"):
        assert (np.ptp(command) > 0.02) == (not issubclass(STIMULI[name], Cruise))


def test_a_stimulus_goes_on_after_its_episode():
    session = Session()
    session.choose_diagnoser("limits")
    session.choose_stimulus("triggered_thesis")
    run(session, (N_SAMPLES + 20) / 10)
    assert session.time == (N_SAMPLES + 20) / 10


def test_another_diagnoser_processes_the_recorded_samples():
    session = Session()
    session.inject("motor_overheating:starboard")
    before = run(session, 6.0).belief
    session.choose_diagnoser("limits")
    assert not np.array_equal(session.history().belief.log_probability, before.log_probability)
    session.choose_diagnoser("filter_bank")
    np.testing.assert_array_equal(session.history().belief.log_probability, before.log_probability)


def test_reset_brings_another_vehicle_of_the_same_seed():
    one = Session(seed=3)
    two = Session(seed=3)
    first = run(one, 2.0).observation
    np.testing.assert_array_equal(run(two, 2.0).observation, first)
    one.inject("increased_drag")
    run(one, 1.0)
    for session in (one, two):
        session.reset()
    assert (one.time, one.travelled > 0.1, one.truth().label, one.history().marks) == (
        0.0,
        False,
        NORMAL,
        (),
    )
    np.testing.assert_array_equal(run(one, 2.0).observation, run(two, 2.0).observation)
    assert not np.array_equal(one.history().observation, first)


def test_a_random_fault_is_some_fault_and_the_same_for_the_same_seed():
    found = []
    for seed in (0, 0, 1, 2, 3):
        session = Session(seed)
        session.inject_random_fault()
        assert next(iter(session.faults.values())).onset == session.time == 0.0
        found.append(tuple(session.faults))
    assert found[0] == found[1]
    assert len(set(found)) > 1


def test_a_minute_is_recorded():
    session = Session()
    session.choose_diagnoser("null")
    history = run(session, 70.0)
    assert (history.time[0], history.time[-1], len(history.time)) == (10.0, 70.0, 601)


def test_advice_comes_once_a_second_and_follows_the_belief():
    session = Session(seed=1)
    first = session.advice
    assert first.action[0] == "continue"
    run(session, 0.9)
    assert session.advice is first
    session.inject("propeller_loss:port")
    run(session, 20.0)
    assert "propeller_loss:port is likely" in session.advice.reason[0]
    assert session.advice.reachable_speed.median[0] < 0.8 * first.reachable_speed.median[0]


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (
            lambda session: session.inject("propeller_los:port"),
            "did you mean 'propeller_loss:port'",
        ),
        (lambda session: session.inject("increased_drag", severity=1.5), "number from 0 to 1"),
        (lambda session: session.set_mission_speed(2.0), "number from 0.1 to 1"),
        (lambda session: session.choose_diagnoser("oracle"), "diagnoser: got 'oracle'"),
        (lambda session: session.choose_stimulus("cruse"), "did you mean 'cruise'"),
    ],
    ids=["fault", "severity", "speed", "diagnoser", "stimulus"],
)
def test_what_is_wrong_is_refused_and_changes_nothing(act, words):
    session = Session()
    with pytest.raises(InputError, match=words):
        act(session)
    session.step()
    assert (session.faults, session.mission_speed, session.diagnoser.name) == (
        {},
        0.3048,
        "filter_bank",
    )
