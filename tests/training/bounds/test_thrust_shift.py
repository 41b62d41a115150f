import numpy as np
import pytest

from auv_fault_env.faults import known_classes
from training.bounds import thrust_shift
from training.bounds.information import log_likelihoods_unknown_severity
from training.bounds.thrust_shift import (
    N_PERIOD,
    Excitation,
    cost,
    evidence_rates,
    faulty_vehicles,
    offset_of_energy,
    period_rate,
)

SIDES = ("propeller_damage:port", "propeller_damage:starboard")


def rates(excitation, faults=SIDES, vehicles=6, severity=0.6):
    cases = [(fault, severity) for fault in faults]
    lanes = faulty_vehicles(excitation, cases, vehicles, 0)
    found = evidence_rates(lanes, cases, knows_vehicle=True)
    return {fault: rate for (fault, _), rate in found.items()}


def test_a_wave_has_its_sign_for_half_a_period():
    wave = Excitation(shift=0.4, alternates=True)
    signs = [wave.sign(step) for step in range(2 * N_PERIOD)]
    assert signs == 2 * (100 * [1.0] + 100 * [-1.0])
    assert {Excitation(shift=0.4).sign(step) for step in range(N_PERIOD)} == {1.0}


def test_a_shift_costs_energy_and_rudder_but_no_speed():
    passive = cost(Excitation())
    shifted = cost(Excitation(shift=0.4))
    assert passive.speed_rms == 0.0 == passive.rudder
    assert shifted.speed_rms < 1e-6
    assert shifted.rudder == pytest.approx(0.4 * 0.06693, rel=1e-3)
    # torque of the propellers grows by s^2 3/8, of whole power a third at 1 ft/s
    assert 1.01 < shifted.energy / passive.energy < 1.04
    assert cost(Excitation(shift=-0.4)).energy == pytest.approx(shifted.energy, rel=1e-12)


@pytest.mark.parametrize("alternates", [False, True])
def test_the_offset_of_an_energy_needs_it(alternates):
    energy = 1.02 * cost(Excitation()).energy
    offset = offset_of_energy(energy, alternates)
    assert 0.0 < offset < 0.1
    assert cost(Excitation(offset, alternates=alternates)).energy == pytest.approx(energy, rel=1e-4)


def test_a_shift_of_zero_says_what_cruise_says():
    assert rates(Excitation(shift=0.0, alternates=True), vehicles=2) == rates(
        Excitation(), vehicles=2
    )


def test_thrust_on_the_side_of_the_fault_shows_it_and_the_sides_mirror_each_other():
    """Torque grows by 1 + s, evidence by its square, and by more as friction stays as it is."""
    cruise = rates(Excitation())
    to_port = rates(Excitation(shift=0.4))
    to_starboard = rates(Excitation(shift=-0.4))
    toward, away = (to_port[side].against_normal for side in SIDES)
    plain, other = (cruise[side].against_normal for side in SIDES)
    assert toward == pytest.approx(1.4**2 * plain, rel=0.4) and toward > 1.5 * plain
    assert away == pytest.approx(0.6**2 * other, rel=0.5) and away < 0.6 * other
    mirrored = to_starboard[SIDES[1]].against_normal
    assert mirrored == pytest.approx(toward, rel=0.2)


def test_the_rate_is_the_mean_log_likelihood_ratio_of_the_last_period():
    """By hand from the log-likelihoods of single vehicles."""
    cases = [(SIDES[0], 0.6)]
    lanes = faulty_vehicles(Excitation(shift=0.4), cases, 3, 0)
    (rate,) = evidence_rates(lanes, cases, True).values()
    ratios = log_likelihoods_unknown_severity(lanes)
    k = known_classes().index(SIDES[0])
    gains = [(ratios[-1, lane, k] - ratios[-201, lane, k]) / 20.0 for lane in range(3)]
    assert rate.against_normal == pytest.approx(np.mean(gains), rel=1e-5)
    assert not rate.rival.startswith("propeller") or rate.rival.endswith("starboard")


def test_a_constant_gain_is_its_rate():
    time = 0.1 * np.arange(1, 301)
    np.testing.assert_allclose(period_rate(3.0 * time[:, None]), [3.0])


def test_hull_and_paddle_wheel_gain_nothing():
    faults = ("increased_drag", "sensor_scale:speed")
    cruise = rates(Excitation(), faults, vehicles=3)
    shifted = rates(Excitation(shift=0.4, alternates=True), faults, vehicles=3)
    for fault in faults:
        expected = cruise[fault].against_normal
        assert shifted[fault].against_normal == pytest.approx(expected, rel=0.03)


def test_seeds_are_those_of_tests_and_the_same_for_all():
    cases = [("propeller_loss:port", 0.3)]
    first = faulty_vehicles(Excitation(), cases, 1, 0)
    second = faulty_vehicles(Excitation(shift=0.2), cases, 1, 0)
    assert first.severity.tolist() == [1.0]
    np.testing.assert_array_equal(first.healthy, second.healthy)
    assert thrust_shift.FIRST_SEED < 10**9
