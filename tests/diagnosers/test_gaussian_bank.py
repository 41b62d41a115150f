import dataclasses
import os
import signal
import warnings

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from auv_fault_env.channels import COMMANDS
from auv_fault_env.compiling import SharedCache
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, Fault, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parts import PartLibrary
from auv_fault_env.schedules import FaultEvent, ScheduleSampler
from diagnosers import make
from diagnosers.bank import algebra, kernel, motor, pack, sensors, surge
from diagnosers.bank.hypotheses import PORT, STARBOARD, SURGE, hypothesis_table
from diagnosers.gaussian_bank import GaussianBank
from diagnosers.oracle import Oracle
from training.rollouts import Rollout, manoeuvres, roll_out
from training.seeds import seeds
from training.stimuli.light_bank import light_bank

CLASSES = list(classes())


def episodes(n_lanes: int, n_samples: int, *events: FaultEvent) -> Rollout:
    lanes = seeds("calibration", n_lanes, 50_000)
    return roll_out(
        Fleet(n_lanes), lanes, n_samples, None, [events] * n_lanes, [MISSIONS["thesis"]] * n_lanes
    )


def beliefs(bank: GaussianBank, observations: np.ndarray) -> np.ndarray:
    """Log probabilities, (n_samples, n_lanes, n_classes)."""
    bank.reset(observations.shape[1])
    return np.stack([bank.update(observation).log_probability for observation in observations])


@pytest.mark.parametrize("name", ["gaussian_bank", "oracle"])
def test_the_registry_makes_it(name):
    bank = make(name)
    assert bank.name == name
    assert bank.classes == classes()


def test_probabilities_sum_to_one_and_severities_are_fractions():
    bank = GaussianBank()
    bank.reset(8)
    sampler = ScheduleSampler(healthy=0.2, onset=(1.0, 5.0))
    rolled = roll_out(Fleet(8, schedules=sampler), range(8), 120, manoeuvres(1, 120, 8))
    for observation in rolled.observations:
        log_probability, mean, std = bank.update(observation)
        np.testing.assert_allclose(np.exp(log_probability).sum(axis=1), 1.0, rtol=1e-12)
        assert (mean >= 0.0).all() and (mean <= 1.0).all() and (std >= 0.0).all()
        assert not mean[:, 0].any() and not std[:, 0].any()


@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("bank", [GaussianBank(), light_bank()], ids=["full", "light"])
def test_a_batch_is_its_lanes_whatever_the_threads_and_the_neighbours_silence(
    bank, threads, monkeypatch
):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    observations = episodes(70, 12, FaultEvent("sensor_bias:port_current", 0.5, 0.6)).observations
    observations[3:, 1::2, len(COMMANDS) :] = np.nan
    batch = beliefs(bank, observations)
    assert np.isfinite(batch).all()
    for lane in range(70):
        alone = beliefs(bank, observations[:, lane : lane + 1])
        np.testing.assert_array_equal(batch[:, lane], alone[:, 0])


def test_nothing_is_read_of_what_an_earlier_step_left_in_the_memory(monkeypatch):
    observations = episodes(5, 12, FaultEvent("propeller_loss:port", 0.5, 1.0)).observations
    expected = beliefs(light_bank(), observations)

    def poisoned(table, n_lanes):
        work = pack.workspace(table, n_lanes)
        for name, values in (work.tables | work.parts._asdict()).items():
            if name not in (*pack.EFFECTS, "states"):
                values.fill(np.nan)
        return work

    poisoned_machinery = GaussianBank.machinery._replace(workspace=poisoned)
    monkeypatch.setattr(GaussianBank, "machinery", poisoned_machinery)
    np.testing.assert_array_equal(beliefs(light_bank(), observations), expected)


def test_the_memory_is_that_of_the_catalogue_as_it_is(monkeypatch):
    observations = episodes(3, 40, FaultEvent("propeller_loss:port", 0.5, 1.0)).observations
    before = beliefs(GaussianBank(), observations)
    fault = CATALOGUE["propeller_loss:port"]
    monkeypatch.setitem(CATALOGUE, fault.name, dataclasses.replace(fault, scale={"port_beta": 0.5}))
    after = beliefs(GaussianBank(), observations)
    monkeypatch.undo()
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_array_equal(beliefs(GaussianBank(), observations), before)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_child_continues(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    bank = light_bank()
    observations = episodes(70, 4, FaultEvent("increased_drag", 0.1, 1.0)).observations
    expected = beliefs(bank, observations)
    with warnings.catch_warnings():
        # of forking beside threads, which is what is tested
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if not child:
        signal.alarm(60)
        os._exit(0 if np.array_equal(beliefs(bank, observations), expected) else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_a_step_changes_neither_state_nor_observation():
    bank = GaussianBank()
    observation = episodes(2, 2).observations[1].astype(np.float64)
    state = bank.step(bank.initial(2), observation)[0]
    before = [values.copy() for values in state]
    observation_before = observation.copy()
    bank.step(state, observation)
    for after_step, before_step in zip(state, before, strict=True):
        np.testing.assert_array_equal(after_step, before_step)
    np.testing.assert_array_equal(observation, observation_before)


def test_a_fault_is_found_named_and_measured():
    rolled = episodes(8, 250, FaultEvent("seal_friction:port", 5.0, 0.6))
    bank = GaussianBank()
    bank.reset(8)
    for k, observation in enumerate(rolled.observations):
        belief = bank.update(observation)
        if k == 49:
            assert (belief.log_probability[:, 0] > np.log(0.9)).all()
    column = CLASSES.index("seal_friction:port")
    assert (belief.log_probability.argmax(axis=1) == column).all()
    np.testing.assert_allclose(belief.severity_mean[:, column], 0.6, atol=0.1)
    assert (belief.log_probability[:, 0] < -20.0).all()


def test_a_repair_shows_in_the_severity_alone():
    rolled = episodes(8, 300, FaultEvent("seal_friction:starboard", 5.0, 0.8, end=10.0))
    bank = GaussianBank()
    column = CLASSES.index("seal_friction:starboard")
    bank.reset(8)
    for k, observation in enumerate(rolled.observations):
        log_probability, severity, _ = bank.update(observation)
        if k == 100:
            np.testing.assert_allclose(severity[:, column], 0.8, atol=0.1)
        if k >= 100:
            assert (log_probability[:, 0] < -300.0).all()  # -650 at most, over 48 vehicles
    assert (log_probability.argmax(axis=1) == column).all()
    assert (severity[:, column] < 0.2).all()


def test_no_way_leads_back_to_normal():
    bank = GaussianBank()
    observation = episodes(1, 1).observations[0].astype(np.float64)
    n_hypotheses = bank.hypotheses().log_hazard.size
    faulty = np.where(np.arange(n_hypotheses) == 7, 0.0, -1e6)[None]
    after, belief = bank.step(bank.initial(1)._replace(log_posterior=faulty), observation)
    assert after.log_posterior[0].argmax() == 7
    # eight readings of six deviations: 144
    np.testing.assert_allclose(belief.log_probability[0, 0], -1e6, atol=150.0)


@pytest.mark.slow
def test_half_an_hour_leaves_healthy_vehicles_normal_and_every_number_finite():
    bank = GaussianBank()
    fleet = Fleet(3)
    bank.reset(3)
    observation = fleet.reset(
        [4, 6, 5], schedules=[(), (), [FaultEvent("propeller_loss:port", 60.0, 1.0)]]
    )
    for k in range(18_000):
        command = 0.3 + 0.15 * (-1) ** (k // 100)
        observation = fleet.step(np.tile([command, 0.0, 0.0], (3, 1)))
        belief = bank.update(observation)
    # with a constant hazard: -6 and -8
    assert (belief.log_probability[:2, 0] > np.log(0.5)).all()
    assert belief.log_probability[2, 0] < -1e3
    assert all(np.isfinite(part).all() for part in bank.running.state.filters)
    assert not any(np.isnan(part).any() for part in belief)


def test_the_hazard_holds_for_a_minute_and_falls_with_age_thereafter():
    bank = GaussianBank()
    observation = episodes(1, 1).observations[0].astype(np.float64)
    state = bank.initial(1)
    of_faults = [
        bank.step(state._replace(age=np.array([age])), observation)[1].log_probability[0, 1:]
        for age in (0.0, 600.0, 6000.0)
    ]
    np.testing.assert_allclose(of_faults[1], of_faults[0], rtol=1e-12)
    np.testing.assert_allclose(of_faults[2], of_faults[0] - np.log(10.0), atol=1e-3)


def test_a_new_catalogue_entry_gets_its_hypotheses(monkeypatch):
    bank = GaussianBank()
    before = GaussianBank().hypotheses()
    ice = Fault(
        "ice_on_hull", component="hull", scale={"alpha": 1.4, "gamma": 1.2}, source="estimate"
    )
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", ice)
    after = bank.hypotheses()
    assert after.log_hazard.size == before.log_hazard.size + 3
    np.testing.assert_allclose(np.exp(after.log_hazard).sum(), 1.0)
    assert after.class_index[-1] == list(classes()).index("ice_on_hull")
    assert after.filter[SURGE, -1] != after.filter[SURGE, 0]
    assert (
        after.filter[PORT, -1] == after.filter[PORT, 0]
        and after.filter[STARBOARD, -1] == after.filter[STARBOARD, 0]
    )
    assert beliefs(bank, episodes(1, 2).observations).shape[2] == len(CLASSES) + 1


def test_classes_share_the_hazard_evenly():
    hypotheses = hypothesis_table(3, 1e-3, list(CATALOGUE))
    share = np.bincount(hypotheses.class_index, weights=np.exp(hypotheses.log_hazard))
    np.testing.assert_allclose(share[1:], 1e-3 / (len(CLASSES) - 2))


@pytest.mark.parametrize(
    "settings", [{"vehicle": "titanic"}, {"hazard": 0.0}, {"grades": ()}, {"grades": ((0.5, 0.1),)}]
)
def test_bad_settings_are_refused(settings):
    with pytest.raises(InputError):
        GaussianBank(**settings)


def test_the_oracle_without_the_truth_is_the_bank():
    rolled = episodes(2, 20)
    np.testing.assert_array_equal(
        beliefs(Oracle(), rolled.observations), beliefs(GaussianBank(), rolled.observations)
    )


@pytest.mark.parametrize(
    ("fault", "severity", "with_severity", "sample", "gain"),
    [
        # hides in the healthy band; measured 0.22 to 0.38
        ("motor_overheating:port", 0.3, False, 100, 0.15),
        # looks like half a lost propeller; measured 0.17 to 0.19
        ("propeller_damage:port", 0.6, True, 199, 0.12),
    ],
    ids=["the vehicle", "the severity"],
)
def test_the_truth_helps(fault, severity, with_severity, sample, gain):
    n_lanes = 32
    rolled = episodes(n_lanes, sample + 1, FaultEvent(fault, 5.0, severity))
    oracle = Oracle()
    oracle.reset(n_lanes)
    severities = np.full(n_lanes, severity) if with_severity else None
    oracle.set_truth(rolled.healthy, severities)
    oracle_probability = np.exp(
        [oracle.update(observation).log_probability for observation in rolled.observations][-1]
    )
    probability = np.exp(beliefs(Oracle(), rolled.observations)[-1])
    column = CLASSES.index(fault)
    assert oracle_probability[:, column].mean() > probability[:, column].mean() + gain


def test_the_truth_helps_while_a_fault_grows():
    n_lanes = 32
    rolled = episodes(n_lanes, 201, FaultEvent("seal_friction:port", 5.0, 0.5, ramp=15.0))
    column = CLASSES.index("seal_friction:port")
    told = Oracle()
    told.reset(n_lanes)
    told.set_truth(rolled.healthy, rolled.severity)
    probability = np.exp(beliefs(GaussianBank(), rolled.observations))[:, :, column]
    of_oracle = [np.exp(told.update(one).log_probability[:, column]) for one in rolled.observations]
    # from the onset to the full severity
    growing = slice(51, 201)
    assert np.mean(of_oracle[growing]) > probability[growing].mean() + 0.03


def test_the_oracle_has_exactly_the_severity_of_the_moment():
    rolled = episodes(2, 40, FaultEvent("seal_friction:port", 1.0, 0.9, ramp=2.0))
    severity = np.linspace(0.2, 0.6, 40)[:, None] + np.array([0.0, 0.1])
    told = Oracle(walk_std=0.0)
    told.reset(2)
    told.set_truth(rolled.healthy, severity)
    for observation, now in zip(rolled.observations, severity, strict=True):
        belief = told.update(observation)
        of_known = belief.severity_mean[:, 1:-1]
        np.testing.assert_allclose(of_known, np.tile(now[:, None], 18), 1e-6)
    told.reset(2)
    assert told.running.severity is None


def test_the_oracle_refuses_what_is_no_truth():
    oracle = Oracle()
    healthy = episodes(2, 1).healthy
    with pytest.raises(InputError, match="reset"):
        oracle.set_truth(healthy)
    oracle.reset(2)
    with pytest.raises(InputError, match="shape"):
        oracle.set_truth(healthy[:1])
    with pytest.raises(InputError, match="0 to 1"):
        oracle.set_truth(healthy, np.array([0.5, 1.5]))


def test_settings_survive_storage(tmp_path):
    from diagnosers import load

    bank = dataclasses.replace(GaussianBank(), hazard=1e-3)
    bank.save(tmp_path / "bank.safetensors")
    assert load(tmp_path / "bank.safetensors") == bank


def test_hypotheses_that_explain_nothing_do_not_diverge():
    bank = GaussianBank(grades=((0.1, 1.0),))
    lanes = 64
    lost = [(FaultEvent("sensor_dropout:port_rpm", 5.0, 1.0),)] * lanes
    bank.reset(lanes)
    for observation in roll_out(
        Fleet(lanes), range(7000, 7000 + lanes), 500, schedules=lost
    ).observations:
        belief = bank.update(observation)
        assert np.isfinite(belief.log_probability).all()
    deviations = bank.running.state.filters[:, 2:4]
    assert np.abs(deviations).max() <= 0.9 + 1e-12


def test_the_bank_is_one_kernel_so_that_compiling_it_anew_changes_no_bit():
    modules = algebra, kernel, motor, pack, sensors, surge
    names = [name for module in modules for name in vars(module).values()]
    compiled = {function for function in names if isinstance(function, Dispatcher)}
    assert len(compiled) > 30
    cached = {function for function in compiled if isinstance(function._cache, SharedCache)}
    assert cached == {kernel.step_lanes}
    # of all others it makes a part of itself
    parts = [one.library for function in compiled for one in function.part.overloads.values()]
    assert all(isinstance(library, PartLibrary) for library in parts)
