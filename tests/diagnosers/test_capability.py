"""The steady state of the capability against the plant; the vehicles possible under a belief."""

from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PARAMETERS, PRESETS, SAMPLE_TIME, nominal
from auv_fault_env.schedules import FaultEvent
from auv_fault_env.truth import FleetTruth
from diagnosers import Belief
from diagnosers.capability import N_PLANT, N_VEHICLES, capability, sample_parameters

NAMES = list(PARAMETERS)[:N_PLANT]
PLANT_FAULTS = [
    name for name, fault in CATALOGUE.items() if not fault.component.startswith("sensor")
]
VEHICLE = PRESETS["thesis1992"]


def belief_of(shares, severity=0.0, std=0.0):
    """One lane: probability by class, the same severity for all."""
    probability = np.full(len(classes()), 1e-40)
    for name, share in shares.items():
        probability[classes().index(name)] = share
    means = np.full((1, probability.size), severity)
    stds = np.full((1, probability.size), std)
    means[:, 0] = 0.0
    stds[:, 0] = 0.0
    return Belief(np.log(probability)[None], means, stds)


@pytest.mark.parametrize("preset", PRESETS)
def test_power_at_a_speed_is_that_of_the_plant_in_steady_motion(preset):
    vehicle = PRESETS[preset]
    names = [name for name in PLANT_FAULTS if CATALOGUE[name].is_possible(vehicle)]
    fleet = Fleet(1 + len(names), preset, sensor_noise=0.0, disturbance=0.0)
    schedules = [()] + [(FaultEvent(name, 0.0, 0.7),) for name in names]
    fleet.reset(range(fleet.n_lanes), schedules=schedules, missions=[0.5] * fleet.n_lanes)
    for _ in range(1500):
        fleet.step(np.tile([0.5, 0.0, 0.0], (fleet.n_lanes, 1)))
    truth = FleetTruth(fleet)
    parameters = np.column_stack([truth["parameters"][name] for name in NAMES])[:, None]
    possible = capability(parameters, truth["state"]["speed"][:, None], fleet.vehicle)
    np.testing.assert_allclose(possible.power[:, 0, 0], fleet.outcomes[1] / SAMPLE_TIME, rtol=1e-4)
    currents = truth["state"]["port_current"], truth["state"]["starboard_current"]
    np.testing.assert_allclose(possible.current[:, 0, 0], np.maximum(*currents), rtol=1e-4)


def nominal_with(**factors):
    values = nominal(VEHICLE)
    return np.array([values[name] * factors.get(name, 1.0) for name in NAMES])[None, None]


@pytest.mark.parametrize(
    ("factors", "share"),
    [
        ({}, 1.0),
        ({"alpha": 2.0}, 0.5**0.5),
        ({"port_beta": 0.0}, 0.5**0.5),
        ({"port_beta": 0.0, "starboard_beta": 0.0}, 0),
    ],
)
def test_reachable_speed_where_the_shafts_are_limited(factors, share):
    """In closed form: u = n sqrt(-beta / alpha) at the largest shaft speed."""
    possible = capability(nominal_with(**factors), np.array([[0.3]]), VEHICLE)
    fastest = share * VEHICLE.maximum_rpm * (VEHICLE.beta / -VEHICLE.alpha) ** 0.5
    assert possible.reachable_speed[0, 0] == pytest.approx(fastest, abs=2e-4)
    assert np.isfinite(possible.power[0, 0, 0]) == (share > 0)


def test_the_supply_limits_the_speed_too():
    weak = replace(VEHICLE, maximum_voltage=4.0)
    slow = capability(nominal_with(), np.array([[0.3]]), weak).reachable_speed[0, 0]
    possible = capability(nominal_with(), np.array([[0.99 * slow, 1.01 * slow]]), weak)
    assert 0.3 < slow < 0.8
    # W by A of both motors: the voltage
    assert 3.8 < possible.power[0, 0, 0] / (2 * possible.current[0, 0, 0]) < 4.0
    assert np.isinf(possible.power[0, 0, 1])


@pytest.mark.parametrize("share", [0.25, 0.5, 1.0])
def test_a_class_has_its_share_of_the_possible_vehicles(share):
    belief = belief_of(
        {"normal": 1.0 - share + 1e-40, "propeller_loss:starboard": share}, severity=1.0
    )
    thrust = sample_parameters(belief, VEHICLE)[0, :, NAMES.index("starboard_beta")]
    assert (thrust == 0.0).sum() == share * N_VEHICLES


def test_severity_and_healthy_band_scatter():
    parameters = sample_parameters(
        belief_of({"increased_drag": 1.0}, severity=0.5, std=0.1), VEHICLE
    )[0]
    drag, thrust = (parameters[:, NAMES.index(name)] for name in ("alpha", "port_beta"))
    relative = drag / VEHICLE.alpha
    assert relative.mean() == pytest.approx(1.5, abs=0.01)
    assert relative.std() == pytest.approx(np.hypot(0.1, 1.5 * 0.05 / 3**0.5), rel=0.1)
    band = thrust / (VEHICLE.beta / 2) - 1.0
    assert 0.029 < band.max() < 0.03 and -0.03 < band.min() < -0.029


def test_severities_beyond_the_end_are_cut():
    lost = sample_parameters(
        belief_of({"propeller_loss:port": 1.0}, severity=0.9, std=0.5), VEHICLE
    )[0]
    assert (lost[:, NAMES.index("port_beta")] >= 0.0).all()
    # of a normal above 1
    assert (lost[:, NAMES.index("port_beta")] == 0.0).mean() == pytest.approx(0.42, abs=0.05)


@pytest.mark.parametrize("channel", list(CHANNELS)[4:])
def test_sensor_faults_leave_the_plant_as_it_is(channel):
    failing, healthy = (
        sample_parameters(belief_of({name: 1.0}, severity=1.0), VEHICLE)
        for name in (f"sensor:{channel}", "normal")
    )
    np.testing.assert_array_equal(failing, healthy)


def test_with_one_shaft_a_fault_of_port_is_one_of_all_propulsion():
    one = replace(VEHICLE, shafts=1)
    lost = sample_parameters(belief_of({"propeller_loss:port": 1.0}, severity=1.0), one)
    assert (lost[0][:, [NAMES.index("port_beta"), NAMES.index("starboard_beta")]] == 0.0).all()
    assert capability(lost, np.array([[0.3]]), one).reachable_speed.max() < 1e-3


def test_the_power_of_a_vehicle_with_one_shaft_is_that_of_one_motor():
    speeds = np.array([[0.3, 0.6]])
    power = []
    for vehicle in (VEHICLE, replace(VEHICLE, shafts=1)):
        parameters = sample_parameters(belief_of({"normal": 1.0}, severity=0.0), vehicle)
        power.append(capability(parameters, speeds, vehicle).power.mean(axis=1))
    np.testing.assert_allclose(power[1], power[0] / 2, rtol=0.01)


def test_an_unknown_fault_is_any_of_the_known_ones_evenly():
    unknown = belief_of({"unknown": 1.0})
    evenly = belief_of(dict.fromkeys(classes()[1:-1], 1.0 / 18.0))
    severity = np.full((1, len(classes())), 0.7)
    parameters = [
        sample_parameters(belief._replace(severity_mean=severity), VEHICLE)
        for belief in (unknown, evenly)
    ]
    np.testing.assert_allclose(*parameters)
    alpha = parameters[0][0, :, NAMES.index("alpha")] / VEHICLE.alpha
    # of 128 vehicles one in 18 drags more, one in 18 less
    assert 6 <= (alpha > 1.5).sum() <= 8 and 6 <= (alpha < 0.75).sum() <= 8


def test_a_belief_over_other_classes_is_refused():
    with pytest.raises(InputError, match="classes of the belief: got 3; allowed is 20"):
        sample_parameters(Belief(*np.zeros((3, 1, 3))), VEHICLE)
