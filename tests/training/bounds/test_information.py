import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, known_classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent
from training.bounds import information
from training.bounds.delays import late_rate
from training.bounds.information import (
    KnownOnset,
    Lanes,
    log_likelihoods,
    simulate_lanes,
    simulate_suite_lanes,
)
from training.stimuli import Cruise, Thesis

CLASSES = list(known_classes())


def lanes_of(
    fault: str, severity: float, n_lanes: int = 8, onset: float = 2.0, seed: int = 5
) -> Lanes:
    events = [FaultEvent(fault, onset, severity)] * n_lanes
    return simulate_lanes(
        Cruise(), events, [MISSIONS["cruise"]] * n_lanes, range(seed, seed + n_lanes)
    )


def test_the_fault_shows_first_where_the_lanes_say():
    faulty = lanes_of("sensor_bias:speed", 0.5)
    twin = lanes_of("sensor_bias:speed", 0.0)
    first = faulty.first_faulty_sample[0]
    np.testing.assert_array_equal(faulty.observations[:first], twin.observations[:first])
    speed = INDEX["speed"]
    shift = faulty.observations[first, :, speed] - twin.observations[first, :, speed]
    np.testing.assert_allclose(
        shift, 0.5 * CATALOGUE["sensor_bias:speed"].offset["speed_bias"], atol=1e-6
    )


def test_evidence_for_a_current_sensors_bias_gathers_as_its_noise_allows():
    """At most shift^2 / 2 noise^2 a sample; half of that if the voltage's noise, alike in amperes,
    came on top.
    """
    lanes = lanes_of("sensor_bias:port_current", 0.1, n_lanes=40)
    shift = 0.1 * CATALOGUE["sensor_bias:port_current"].offset["port_current_bias"]
    noise = CHANNELS["port_current"].noise
    most = 10.0 * shift**2 / (2.0 * noise**2)
    rate = late_rate(information.log_likelihoods_known_severity(lanes))[
        :, CLASSES.index("sensor:port_current")
    ].mean()
    assert 0.45 * most < rate < 1.05 * most


def test_without_a_fault_evidence_speaks_against_every_class():
    lanes = lanes_of("increased_drag", 0.0)._replace(severity=np.full(8, 0.6))
    final = information.log_likelihoods_known_severity(lanes)[-1]
    assert (final[:, 0] == 0.0).all()
    assert (final[:, 1:].mean(axis=0) < 0.0).all()


def test_beginning_on_some_lanes_leaves_the_others():
    bank = KnownOnset()
    lanes = lanes_of("increased_drag", 0.5, n_lanes=4)
    bank.reset(4)
    bank.start_fault(np.arange(4))
    for observation in lanes.observations[:30]:
        before = bank.update(observation)
    bank.start_fault(np.array([1]))
    after = bank.update(lanes.observations[30])
    from_even = [
        np.abs(log_probability[:-1] - np.log(1.0 / len(CLASSES))).max()
        for log_probability in (after.log_probability[1], before.log_probability[0])
    ]
    assert from_even[0] < from_even[1]
    same = KnownOnset()
    same.reset(4)
    same.start_fault(np.arange(4))
    for observation in lanes.observations[:31]:
        other = same.update(observation)
    np.testing.assert_array_equal(
        other.log_probability[[0, 2, 3]], after.log_probability[[0, 2, 3]]
    )


def test_nothing_switches_so_only_the_samples_after_the_beginning_count():
    lanes = lanes_of("seal_friction:port", 0.6, n_lanes=2)
    n_samples = 50
    late = lanes._replace(first_faulty_sample=lanes.first_faulty_sample + 1)
    banks = [KnownOnset() for _ in range(2)]
    for bank in banks:
        bank.reset(2)
        bank.set_truth(lanes.healthy, lanes.severity)
    whole, short = (
        log_likelihoods(bank, bank_lanes, n_samples)
        for bank, bank_lanes in zip(banks, (lanes, late), strict=True)
    )
    k = CLASSES.index("seal_friction:port")
    assert whole[-1, :, k].mean() > short[-2, :, k].mean()


def test_start_fault_needs_a_reset():
    with pytest.raises(InputError, match="reset"):
        KnownOnset().start_fault(np.arange(1))


def test_suite_lanes_hold_every_class_as_often_under_both_kinds_of_mission():
    lanes = simulate_suite_lanes(Thesis(), seed=3, n_lanes=72)
    np.testing.assert_array_equal(np.bincount(lanes.diagnosis), [0, *[4] * (len(CLASSES) - 1)])
    assert len(set(lanes.fault)) > len(CLASSES)
    healthy = simulate_suite_lanes(Thesis(), seed=3, n_lanes=72, healthy=True)
    np.testing.assert_array_equal(lanes.severity, healthy.severity)
    before = np.arange(len(lanes.observations))[:, None] < lanes.first_faulty_sample
    np.testing.assert_array_equal(lanes.observations[before], healthy.observations[before])
    mission = lanes.observations[:, :, 0]
    changes = (np.diff(mission, axis=0) != 0).any(axis=0)
    assert not changes[1::2].any() and changes[::2].all()


def test_the_stimulus_is_added_to_the_mission():
    lanes = simulate_lanes(
        Thesis(),
        [FaultEvent("increased_drag", 1.0, 0.5)],
        [MISSIONS["cruise"]],
        [0],
        fleet=Fleet(1),
    )
    command = lanes.observations[1:, 0, 1] - lanes.observations[1:, 0, 0]
    np.testing.assert_allclose(command[:100], -Thesis().budget, atol=1e-6)
    np.testing.assert_allclose(command[100:200], Thesis().budget, atol=1e-6)
