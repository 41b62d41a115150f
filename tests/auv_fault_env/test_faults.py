"""Every fault of the catalogue through the same checks; a new fault is one entry."""

import itertools
import subprocess
import sys
from dataclasses import replace
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

from auv_fault_env import CATALOGUE, CHANNELS, MISSIONS, PARAMETERS, PRESETS, classes, labels
from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.faults import Fault
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import SIDES, nominal
from auv_fault_env.schedules import FaultEvent, ScheduleSampler, from_json, to_json
from auv_fault_env.truth import FleetTruth

ONSET = 5.0
NOISE = np.array([channel.noise for channel in CHANNELS.values()])
READINGS_AT = slice(len(CHANNELS) - len(READINGS), None)
QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
# thesis V.C and V.D
TABLE_5_1 = {"normal", "increased seal friction", "increased drag", "degraded propeller"}
TABLE_5_2 = {
    "normal",
    "increased drag",
    "decreased drag",
    "decreased propulsion",
    "severe propulsion failure",
}
PLACES = {
    "unknown": (None, None),
    "normal": ("normal", "normal"),
    "increased_drag": ("increased drag", "increased drag"),
    "decreased_drag": (None, "decreased drag"),
    **{
        f"propeller_damage:{side}": ("degraded propeller", "decreased propulsion") for side in SIDES
    },
    **{
        f"propeller_loss:{side}": ("degraded propeller", "severe propulsion failure")
        for side in SIDES
    },
    **{f"seal_friction:{side}": ("increased seal friction", None) for side in SIDES},
    **{f"motor_overheating:{side}": (None, None) for side in SIDES},
    **{f"sensor:{channel}": (None, None) for channel in READINGS},
}
every_fault = pytest.mark.parametrize("name", CATALOGUE)


def simulate(*schedules, seed=5, steps=300, **factors):
    """Observations (steps + 1, n_lanes, n_channels) and parameters at the end; all lanes have one
    seed.
    """
    fleet = Fleet(len(schedules), **factors)
    n = len(schedules)
    rows = [fleet.reset([seed] * n, schedules=schedules, missions=[MISSIONS["thesis"]] * n)]
    for _ in range(steps):
        rows.append(fleet.step(np.c_[rows[-1][:, 0], np.full((n, 2), 0.1)]))
    return np.array(rows), FleetTruth(fleet)["parameters"]


def faulty(fault, healthy, severity=1.0):
    """The fault's parameters by the documented formula."""
    values = {
        name: value * (1 + severity * (fault.scale.get(name, 1.0) - 1))
        for name, value in healthy.items()
    }
    return {name: value + severity * fault.offset.get(name, 0.0) for name, value in values.items()}


@every_fault
def test_severity_zero_is_healthy_bit_for_bit(name):
    observations, parameters = simulate((FaultEvent(name, 0.0, 0.0),), ())
    assert observations[:, 0].tobytes() == observations[:, 1].tobytes()
    assert all(value[0] == value[1] for value in parameters.values())


@every_fault
def test_same_seed_is_the_exact_twin_until_the_onset(name):
    observations, _ = simulate((FaultEvent(name, ONSET, 1.0),), (), seed=11)
    before = round(10 * ONSET) + 1
    assert observations[:before, 0].tobytes() == observations[:before, 1].tobytes()
    assert (observations[before:, 0] != observations[before:, 1]).any()


@pytest.mark.parametrize(
    ("name", "preset"),
    [
        (name, preset)
        for name, preset in itertools.product(CATALOGUE, PRESETS)
        if CATALOGUE[name].is_possible(PRESETS[preset])
    ],
)
def test_parameters_stay_physical_at_severity_one(name, preset):
    # nominal, ends of the default band, ends of the widest band
    for spread in (0.0, -1.0, 1.0, -10.0, 10.0):
        healthy = {
            parameter: value * (1 + spread * PARAMETERS[parameter].band)
            for parameter, value in nominal(PRESETS[preset]).items()
        }
        for parameter, value in faulty(CATALOGUE[name], healthy).items():
            assert PARAMETERS[parameter].low <= value <= PARAMETERS[parameter].high, parameter


@every_fault
def test_parameters_in_force_follow_the_formula(name):
    _, parameters = simulate((FaultEvent(name, 0.2, 0.7),), (), steps=4)
    healthy = {parameter: float(value[1]) for parameter, value in parameters.items()}
    expected = faulty(CATALOGUE[name], healthy, 0.7)
    assert {parameter: float(value[0]) for parameter, value in parameters.items()} == pytest.approx(
        expected, rel=1e-14
    )
    assert expected != healthy


@every_fault
def test_a_reading_moves_beyond_its_noise_under_a_speed_change(name):
    observations, _ = simulate((FaultEvent(name, ONSET, 1.0),), (), **QUIET)
    assert (
        (observations[:, 1, READINGS_AT] != observations[0, 1, READINGS_AT]).any(axis=0).all()
    )  # a speed change it is
    moved = np.abs(observations[:, 0] - observations[:, 1])[:, READINGS_AT] / NOISE[READINGS_AT]
    assert moved.max() > 3.0
    if CATALOGUE[name].component.startswith("sensor:"):
        channel = CATALOGUE[name].component.partition(":")[2]
        assert moved[:, READINGS.index(channel)].max() > 3.0


@every_fault
def test_json_round_trip_is_exact(name):
    events = (
        FaultEvent(name, 0.1 + 0.2, 1 / 3),
        FaultEvent(name, 1e-9, 1.0, 2 / 3, 1e3 / 7, np.pi, 0.1),
    )
    assert from_json(to_json(events)) == events


@every_fault
def test_an_entry_is_complete(name):
    fault = CATALOGUE[name]
    assert fault.name == name and fault.about and fault.source
    assert {fault.table_5_1} <= TABLE_5_1 | {None} and {fault.table_5_2} <= TABLE_5_2 | {None}
    assert fault.component.split(":")[0] in {"hull", "propeller", "shaft", "motor", "sensor"}


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name.endswith(":port")])
def test_a_port_fault_mirrors_the_starboard_fault(name):
    twin = name.replace(":port", ":starboard")
    observations, _ = simulate(
        (FaultEvent(name, ONSET, 0.6),), (FaultEvent(twin, ONSET, 0.6),), **QUIET
    )
    port = observations[:, 0]
    starboard = observations[:, 1]
    mirrored = starboard[:, [0, 1, 2, 3, 4, 5, 9, 10, 11, 6, 7, 8]]
    np.testing.assert_allclose(port, mirrored, rtol=1e-5, atol=1e-5)
    assert np.abs(port - starboard).max() > 0.1


@pytest.mark.parametrize("channel", READINGS)
def test_broken_sensors_read_as_documented(channel):
    kinds = ("bias", "scale", "stuck", "dropout")
    schedules = [(FaultEvent(f"sensor_{kind}:{channel}", ONSET, 1.0),) for kind in kinds]
    observations, parameters = simulate(*schedules, seed=2, **QUIET | {"healthy_band": 1.0})
    column = INDEX[channel]
    onset = round(10 * ONSET)
    assert (observations[onset + 1 :, 2, column] == observations[onset, 2, column]).all()
    assert (observations[onset + 1 :, 3, column] == 0.0).all() and (
        observations[1:onset, 3, column] != 0.0
    ).all()
    assert parameters[f"{channel}_bias"][0] != 0.0 and parameters[f"{channel}_gain"][1] != 1.0
    assert np.isfinite(observations).all()


@pytest.mark.parametrize("kind", ["stuck", "dropout"])
def test_severity_is_the_share_of_lost_samples(kind):
    event = FaultEvent(f"sensor_{kind}:port_rpm", 0.0, 0.3)
    observations, _ = simulate((event,), seed=8, steps=4000, disturbance=0.0)
    rpm = observations[:, 0, INDEX["port_rpm"]]
    lost = (np.diff(rpm) == 0.0) if kind == "stuck" else (rpm[1:] == 0.0)
    assert abs(lost.mean() - 0.3) < 3.29 * (0.3 * 0.7 / lost.size) ** 0.5


def test_noise_fault_grows_the_noise_tenfold():
    event = FaultEvent("sensor_noise:port_current", 0.0, 1.0)
    fleet = Fleet(2000, disturbance=0.0, healthy_band=0.0)
    missions = [MISSIONS["cruise"]] * 2000
    observations = fleet.reset(
        range(2000), schedules=[(event,)] * 1000 + [()] * 1000, missions=missions
    )
    current = observations[:, INDEX["port_current"]]
    sigma = CHANNELS["port_current"].noise
    assert np.std(current[:1000]) == pytest.approx(10 * sigma, rel=0.1)
    assert np.std(current[1000:]) == pytest.approx(sigma, rel=0.1)


def test_labels_place_every_class_in_the_tables_of_the_thesis():
    assert labels() == PLACES
    assert tuple(labels()) == classes()


def test_labels_cover_both_tables():
    first, second = zip(*labels().values(), strict=True)
    assert set(first) - {None} == TABLE_5_1
    assert set(second) - {None} == TABLE_5_2


def test_classes_begin_with_normal_end_with_unknown_and_group_sensors_by_channel():
    assert classes()[0] == "normal" and classes()[-1] == "unknown"
    assert len(set(classes())) == len(classes()) >= 2 + 2 + 4 * len(SIDES) + len(READINGS)
    assert [name for name in classes() if name.startswith("sensor")] == [
        f"sensor:{channel}" for channel in READINGS
    ]


def ice():
    return Fault(
        "ice_on_hull", "hull", scale={"alpha": 1.4, "gamma": 1.2}, about="Ice.", source="estimate"
    )


def test_a_new_fault_needs_one_entry(monkeypatch):
    assert "ice_on_hull" not in classes()
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", ice())
    assert classes()[-2:] == ("ice_on_hull", "unknown") and labels()["ice_on_hull"] == (None, None)
    event = FaultEvent("ice_on_hull", 0.1, 0.5)
    assert from_json(to_json((event,))) == (event,)
    sampled = [
        ScheduleSampler(prior={"ice_on_hull": 1.0}, healthy=0.0, compound=0.0).sample(seed)
        for seed in range(9)
    ]
    assert [schedule[0].fault for schedule in sampled] == ["ice_on_hull"] * 9
    observations, parameters = simulate((event,), (), **QUIET)
    assert parameters["alpha"][0] == pytest.approx(1.2 * parameters["alpha"][1], rel=1e-14)
    assert parameters["gamma"][0] == pytest.approx(1.1 * parameters["gamma"][1], rel=1e-14)
    assert np.abs(observations[:, 0] - observations[:, 1]).max() > 1.0


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_a_new_fault_appears_in_the_truth(monkeypatch, vector):
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", ice())
    name = "auv_fault_env/Propulsion-v0"
    options = {"schedule": [FaultEvent("ice_on_hull", 0.1, 0.5)]}
    env = gym.make_vec(name, num_envs=2, truth="full") if vector else gym.make(name, truth="full")
    env.reset(seed=1, options=options)
    action = np.zeros(env.action_space.shape, np.float32)
    truth = [dict(env.step(action)[4]["truth"]) for _ in range(2)]
    assert (
        np.ravel(truth[0]["label"])[0] == "normal"
        and np.ravel(truth[1]["label"])[-1] == "ice_on_hull"
    )
    assert np.ravel(truth[1]["severity"]["ice_on_hull"])[-1] == 0.5


def test_a_new_kind_of_a_sensor_joins_its_class(monkeypatch):
    before = classes()
    drift = Fault("sensor_drift:speed", "sensor:speed", offset={"speed_bias": 0.05})
    monkeypatch.setitem(CATALOGUE, drift.name, drift)
    assert classes() == before and drift.diagnosis == "sensor:speed"
    _, parameters = simulate((FaultEvent(drift.name, 0.0, 1.0),), (), steps=1)
    assert parameters["speed_bias"].tolist() == [0.05, 0.0]


ENVIRONMENT = "auv_fault_env/Propulsion-v0"
MAKERS = {"single": gym.make, "vector": partial(gym.make_vec, num_envs=3)}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_fault_added_beside_an_open_environment_strikes_in_it(monkeypatch, make):
    env = make(ENVIRONMENT, truth="full")
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape))
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", ice())
    options = {"schedule": [{"fault": "ice_on_hull", "onset": 0.0, "severity": 1.0}]}
    healthy = env.reset(seed=0, options={"schedule": []})[1]["truth"]["parameters"]["alpha"]
    env.reset(seed=0, options=options)
    truth = env.step(np.zeros(env.action_space.shape))[-1]["truth"]
    assert np.all(np.array(truth["label"]) == "ice_on_hull")
    np.testing.assert_allclose(truth["parameters"]["alpha"], 1.4 * np.array(healthy))


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_fault_added_beside_an_open_environment_is_sampled_in_it(monkeypatch, make):
    env = make(ENVIRONMENT, truth="full")
    env.reset(seed=0)
    for k in range(500):
        monkeypatch.setitem(CATALOGUE, f"ice_{k}", replace(ice(), name=f"ice_{k}"))
    fleet = env.unwrapped.fleet
    for seed in range(20):
        env.reset(seed=seed)
        if fleet.plan.fault.max() >= len(CATALOGUE) - 500:
            break
    else:
        pytest.fail("no added fault among 20 episodes")
    onset = env.step(np.zeros(env.action_space.shape))[-1]["truth"]["onset"]
    assert np.isfinite(np.min(onset))


def test_lanes_under_way_keep_their_faults_when_one_is_added(monkeypatch):
    fleet = Fleet(2, **QUIET)
    drag = (FaultEvent("increased_drag", 0.0, 1.0),)
    fleet.reset([1, 1], schedules=[drag, drag])
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", ice())
    fleet.reset(lanes=np.array([1]), schedules=[(FaultEvent("ice_on_hull", 0.0, 1.0),)])
    fleet.step(np.zeros((2, 3)))
    truth = FleetTruth(fleet)
    assert truth["label"].tolist() == ["increased_drag", "ice_on_hull"]
    np.testing.assert_allclose(truth["parameters"]["alpha"] / PRESETS["thesis1992"].alpha, [2, 1.4])


@pytest.mark.parametrize("first_import", ["auv_fault_env.faults", "auv_fault_env.env"])
def test_fault_added_at_the_first_import_strikes(first_import):
    program = f"""
import {first_import}
from auv_fault_env.faults import CATALOGUE, Fault
CATALOGUE["ice"] = Fault("ice", "hull", scale={{"alpha": 1.4}})
import gymnasium as gym
import numpy as np
schedule = [{{"fault": "ice", "onset": 0.0, "severity": 1.0}}]
for env in (
    gym.make("{ENVIRONMENT}", truth="full"),
    gym.make_vec("{ENVIRONMENT}", num_envs=2, truth="full"),
):
    env.reset(seed=1, options={{"schedule": schedule}})
    truth = env.step(np.zeros(env.action_space.shape))[-1]["truth"]
    assert np.all(np.array(truth["label"]) == "ice"), truth["label"]
"""
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True, timeout=600)


def test_compound_of_many_stops_at_the_physical_limits():
    fleet = Fleet(1)
    events = [FaultEvent("increased_drag", 0.0, 1.0)] * 30 + [
        FaultEvent("sensor_stuck:speed", 0.0, 1.0)
    ] * 3
    fleet.reset(seeds=[1], schedules=[tuple(events)])
    for _ in range(20):
        observation = fleet.step(np.array([[0.5, 0.0, 0.0]]))
    parameters = FleetTruth(fleet)["parameters"]
    assert parameters["alpha"] == PARAMETERS["alpha"].low
    assert parameters["speed_stuck"] == 1.0
    assert np.isfinite(observation).all()
