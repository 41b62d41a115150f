"""Each imperfection alone does what its datum says; none is the ideal plant, bit for bit."""

import math
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from auv_fault_env import CHANNELS, PARAMETERS, FaultEvent, Fleet, layout, realism
from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.realism import EFFECTS, IMPERFECTIONS, SURROUNDINGS
from auv_fault_env.truth import FleetTruth

ENV = "auv_fault_env/Propulsion-v0"
N = 200
DOCUMENT = Path(__file__).parents[2] / "docs/realism.md"
QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)


def run(
    effects=None, factor=1.0, steps=100, speed=0.4, schedules=None, command=None, n=N, **arguments
):
    """Observations (n_steps + 1, n, n_channels), the true state alike by name, and the fleet."""
    fleet = Fleet(n, realism=factor, imperfections=effects, **arguments)
    schedules = [()] * n if schedules is None else schedules
    observations = [fleet.reset(range(n), schedules=schedules, missions=[speed] * n)]
    states = [FleetTruth(fleet)["state"]]
    for k in range(steps):
        actions = np.zeros((n, 3))
        actions[:, 0] = speed if command is None else command(k)
        observations.append(fleet.step(actions))
        states.append(FleetTruth(fleet)["state"])
    true = {name: np.array([state[name] for state in states]) for name in states[0]}
    return np.array(observations, np.float64), true, fleet


def wave(k):
    """A speed command that moves everything."""
    return 0.4 + 0.3 * math.sin(k / 8.0)


def reading(observations, name):
    return observations[..., INDEX[name]]


def row(fleet, index):
    return fleet.table[:, index].reshape(-1)[: fleet.n_lanes].copy()


def healthy(fleet, name):
    return FleetTruth(fleet)["parameters"][name]


@pytest.fixture(scope="module")
def ideal():
    return run(factor=0.0, command=wave)[0]


def test_without_any_effect_the_plant_is_the_ideal_one_bit_for_bit(ideal):
    assert np.array_equal(run([], command=wave)[0], ideal)
    late = [(FaultEvent("late_counter:port", 0.0, 1.0),)] + [()] * (N - 1)
    beside_a_late_counter, _, fleet = run(factor=0.0, command=wave, schedules=late)
    assert fleet.effects is not None
    assert np.array_equal(beside_a_late_counter[:, 1:], ideal[:, 1:])
    assert not np.array_equal(beside_a_late_counter[:, 0], ideal[:, 0])


@pytest.mark.parametrize("effect", sorted(set(EFFECTS) - {"counters", "clipping", "water_current"}))
def test_every_effect_acts_alone(ideal, effect):
    assert not np.array_equal(run([effect], command=wave)[0], ideal)


def test_a_lane_of_a_batch_is_the_single_environment():
    settings = {"realism": 1.0, "truth": "full"}
    many = gym.make_vec(ENV, num_envs=9, vectorization_mode="vector_entry_point", **settings)
    expected = [many.reset(seed=5)[0]]
    actions = np.full((9, 3), 0.3)
    for _ in range(100):
        observations, *_, info = many.step(actions)
        expected.append(observations)
    truth = dict(info["truth"])
    cold = many.unwrapped.fleet.plan.healthy[:, list(PARAMETERS).index("port_resistance")]
    warmed = truth["parameters"]["port_resistance"] > cold
    assert warmed[truth["label"] != "motor_overheating:port"].all()
    for lane in (0, 4, 8):
        env = gym.make(ENV, **settings)
        observed = [env.reset(seed=5 + lane)[0]]
        for _ in range(100):
            observation, *_, info = env.step(actions[lane])
            observed.append(observation)
        assert np.array_equal(observed, np.array(expected)[:, lane]), lane
        for part in ("parameters", "state"):
            of_lane = {name: truth[part][name][lane] for name in info["truth"][part]}
            assert info["truth"][part] == of_lane


def test_the_same_seed_without_the_fault_is_the_twin():
    fault = (FaultEvent("sensor_bias:port_current", 5.0, 1.0),)
    faulty, _, faulty_fleet = run(schedules=[fault] * N)
    twin, _, fleet = run()
    onset = np.flatnonzero((faulty != twin).any(axis=(1, 2)))[0]
    assert onset == 51  # the step that begins at 5.0 s ends in sample 51
    shift = reading(faulty - twin, "port_current")[51:]
    assert shift.min() > 0.36 and shift.max() < 0.44  # 0.4 A, quantised
    for index in (layout.PITCH, layout.WATER_CURRENT, layout.WHEEL_NOISE):
        assert np.array_equal(row(faulty_fleet, index), row(fleet, index))


def test_readings_are_multiples_of_the_step():
    observations, *_ = run(["resolution"], command=wave)
    exact, true, _ = run(["resolution"], command=wave, sensor_noise=0.0)
    for name in READINGS:
        error = np.abs(reading(exact, name) - true[name])
        assert 0.45 * IMPERFECTIONS[name].step < error.max() < 0.501 * IMPERFECTIONS[name].step
        step = IMPERFECTIONS[name].step
        counts = np.rint(reading(observations, name) / step)
        assert np.array_equal(np.float32(counts * step), np.float32(reading(observations, name)))
        assert np.unique(counts).size > 3
    assert IMPERFECTIONS["port_voltage"].step == pytest.approx(0.02346, abs=1e-5)
    assert IMPERFECTIONS["port_current"].step == pytest.approx(0.02444, abs=1e-5)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_offsets_are_constant_within_the_band_of_their_sensor(factor):
    observations, true, _ = run(["offsets"], factor, sensor_noise=0.0)
    for name in READINGS:
        offset = reading(observations, name) - true[name]
        largest = factor * IMPERFECTIONS[name].zero
        assert np.ptp(offset, axis=0).max() < 2e-4
        assert np.abs(offset).max() <= largest + 2e-4
        assert np.abs(offset).max() >= 0.9 * largest
        assert offset.min() <= -0.9 * largest
    current = reading(observations, "port_current") - true["port_current"]
    assert np.abs(current[0]).max() == pytest.approx(0.020 * factor, rel=0.1)


def test_gains_are_constant_within_the_band_of_their_sensor():
    observations, true, _ = run(["gains"], sensor_noise=0.0)
    error = reading(observations, "speed") / true["speed"] - 1.0
    assert np.ptp(error, axis=0).max() < 1e-6
    assert 0.018 < np.abs(error).max() <= 0.02 + 1e-6
    voltage = reading(observations, "port_voltage")[1:] / true["port_voltage"][1:] - 1.0
    assert 0.0045 < np.abs(voltage).max() <= 0.005 + 1e-6
    rpm = reading(observations, "port_rpm")
    assert np.array_equal(np.float32(rpm), np.float32(true["port_rpm"]))


def test_a_late_reading_is_the_one_of_some_samples_before():
    observations, true, fleet = run(["latency"], sensor_noise=0.0, command=wave)
    late = {name: healthy(fleet, f"{name}_latency").astype(int) for name in READINGS}
    assert set(late["speed"]) == {0, 1, 2} and set(late["port_rpm"]) == {0, 1}
    assert set(late["acceleration"]) == set(late["port_current"]) == {0}
    assert not np.array_equal(late["port_rpm"], late["starboard_rpm"])
    for name in READINGS:
        for lane in range(N):
            k = late[name][lane]
            expected = np.concatenate([np.repeat(true[name][:1, lane], k), true[name][:, lane]])
            read = reading(observations, name)[:, lane]
            assert np.array_equal(np.float32(read), np.float32(expected[: len(read)]))


def test_latencies_grow_with_realism_up_to_the_longest():
    largest = {
        factor: realism.healthy_spread(factor, EFFECTS)[1].max() for factor in (0.2, 1.0, 2.0, 10.0)
    }
    assert largest == {0.2: 0, 1.0: 2, 2.0: 4, 10.0: 7}


def test_outliers_are_rare_and_of_eight_sigma():
    observations, true, _ = run(["outliers"], sensor_noise=0.0, steps=600)
    n = observations[..., 0].size
    for name in READINGS:
        error = reading(observations, name) - true[name]
        size = 8.0 * CHANNELS[name].noise
        hit = np.abs(error) > 0.5 * size
        assert np.abs(np.abs(error[hit]) - size).max() < 1e-3 * size + 2e-4
        assert hit.sum() == pytest.approx(0.003 * n, abs=4 * math.sqrt(0.003 * n))
        positive = (error[hit] > 0).sum()
        assert positive == pytest.approx(hit.sum() / 2, abs=2 * math.sqrt(hit.sum()))


def test_counters_read_exactly_zero_at_rest_and_only_there():
    counters = ("speed", "port_rpm", "starboard_rpm")
    at_rest, true, _ = run(["counters", "offsets", "outliers", "coloured_noise"], speed=0.0)
    under_way, *_ = run(["counters"], speed=0.4)
    assert np.abs(true["speed"]).max() > 0.01  # drifting
    for name in counters:
        is_slow = np.abs(true[name]) < IMPERFECTIONS[name].least
        if name != "speed":
            assert is_slow.all() and not reading(at_rest, name).any()
        assert (reading(under_way, name) != 0.0).all()
    slow = np.abs(true["speed"]) < 0.01  # 4 sigma of the wheel's own noise below its least speed
    assert not reading(at_rest, "speed")[slow].any()
    assert (reading(at_rest, "acceleration") != 0.0).all()


def test_converters_saturate():
    at_rest, *_ = run(["clipping"], speed=0.0)
    unlimited, *_ = run([], speed=0.0)
    for name in READINGS:
        low = IMPERFECTIONS[name].low
        if name == "acceleration":
            assert reading(at_rest, name).min() < 0.0
        else:
            assert reading(at_rest, name).min() == low == 0.0 > reading(unlimited, name).min()
    fleet = Fleet(1, realism=1.0, imperfections=["clipping"])
    fleet.reset([0], schedules=[()], missions=[0.0])
    values = fleet.plan.healthy.copy()
    for place in ("port_voltage_bias", "port_current_bias"):
        values[:, list(PARAMETERS).index(place)] = 28.0
    fleet.set_healthy(values)
    observation = fleet.step(np.zeros((1, 3)))[0]
    assert observation[INDEX["port_voltage"]] == 24.0
    assert observation[INDEX["port_current"]] == 25.0


def stationary(values, std, time):
    """Assert that a process (n_samples, n_lanes) has this std at all times, this correlation."""
    scatter = 4.0 * std / math.sqrt(2 * N)
    assert values[0].std() == pytest.approx(std, abs=scatter)
    assert values[-1].std() == pytest.approx(std, abs=scatter)
    assert values.std() == pytest.approx(std, rel=0.05)
    lag = round(10 * time)
    correlation = np.corrcoef(values[lag:].ravel(), values[:-lag].ravel())[0, 1]
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.08)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_the_accelerometer_feels_the_tilt(factor):
    observations, true, _ = run(["tilt"], factor, sensor_noise=0.0, steps=600)
    error = reading(observations, "acceleration") - true["acceleration"]
    # 0.1 deg of pitch: 0.0171 m/s^2; 1 deg of roll, of which 1 %: 0.0017
    stationary(error, factor * math.hypot(0.01712, 0.00171), 3.0)
    for name in set(READINGS) - {"acceleration"}:
        assert np.abs(reading(observations, name) - true[name]).max() < 2e-4


def test_the_paddle_wheel_has_coloured_noise():
    observations, true, _ = run(["coloured_noise"], sensor_noise=0.0, steps=600)
    stationary(reading(observations, "speed") - true["speed"], 0.005, 1.0)
    acceleration = reading(observations, "acceleration") - true["acceleration"]
    assert np.abs(acceleration).max() < 1e-6


def test_a_change_of_the_water_changes_the_speed_but_is_not_felt():
    n = 300
    fleet = Fleet(n, realism=1.0, imperfections=["water_current"], **QUIET)
    fleet.reset(range(n), schedules=[()] * n, missions=[0.4] * n)
    current = [row(fleet, layout.WATER_CURRENT)]
    target = [row(fleet, layout.WATER_TARGET)]
    speed = [row(fleet, layout.SPEED)]
    acceleration = [row(fleet, layout.ACCELERATION)]
    steps = 900
    for _ in range(steps):
        observation = fleet.step(np.full((n, 3), [0.4, 0.0, 0.0]))
        felt = observation[:, INDEX["acceleration"]]
        current.append(row(fleet, layout.WATER_CURRENT))
        target.append(row(fleet, layout.WATER_TARGET))
        speed.append(row(fleet, layout.SPEED))
        acceleration.append(row(fleet, layout.ACCELERATION))
        assert np.abs(felt - acceleration[-1]).max() < 1e-6
    current, target, speed, acceleration = map(np.array, (current, target, speed, acceleration))
    assert np.array_equal(current[0], target[0])
    assert current.std() == pytest.approx(0.1 / math.sqrt(3.0), rel=0.1)
    assert np.abs(target).max() <= 0.1 and np.abs(target).max() > 0.098
    changes = (np.diff(target, axis=0) != 0).sum()
    expected = n * steps * 0.1 / 600.0
    assert changes == pytest.approx(expected, abs=4 * math.sqrt(expected))
    # in 2 s the current goes 63 % of its way
    step, lane = np.argwhere(np.diff(target[:-30], axis=0) != 0)[0]
    way = target[step + 1, lane] - current[step, lane]
    assert current[step + 20, lane] - current[step, lane] == pytest.approx(0.632 * way, rel=1e-3)
    # what the accelerometer feels changes the speed over ground
    ground = speed + current
    gained = 0.1 * (0.5 * (acceleration[1:] + acceleration[:-1])).sum(axis=0)
    assert np.abs(np.ptp(speed, axis=0)).max() > 0.05
    assert np.abs(ground[-1] - ground[0] - gained).max() < 0.01


def test_the_battery_sags_with_time_and_current():
    ideal = Fleet(N)
    real = Fleet(N, realism=1.0, imperfections=["battery"])
    for fleet in (ideal, real):
        fleet.reset(range(N), schedules=[()] * N, missions=[0.8] * N)
        fleet.state.step[:] = 2 * 36000 - 1  # two hours
    sides = ("port_current", "starboard_current")
    current = sum(np.abs(FleetTruth(real)["state"][name]) for name in sides)
    assert current.min() > 1.0
    for fleet in (ideal, real):
        fleet.step(np.full((N, 3), [0.8, 0.0, 0.0]))
    share = row(real, layout.PORT_VOLTAGE) / row(ideal, layout.PORT_VOLTAGE)
    assert share == pytest.approx(1.0 - 2 * 0.025 - 0.002 * current, rel=1e-9)


def test_motors_warm_up():
    _, true, fleet = run(["heating"], speed=1.0, steps=600, **QUIET)
    mean_square = np.mean(true["port_current"] ** 2, axis=0)
    # 3 K/W, 1.01 ohm, a tenth of the time constant of 600 s
    temperature = 3.0 * 1.01 * mean_square * (1.0 - math.exp(-0.1))
    assert temperature.min() > 0.4
    assert row(fleet, layout.PORT_TEMPERATURE) == pytest.approx(temperature, rel=0.05)
    exact = row(fleet, layout.PORT_TEMPERATURE)
    parameters = FleetTruth(fleet)["parameters"]
    assert parameters["port_resistance"] == pytest.approx(1.01 * (1 + 0.0039 * exact), rel=1e-12)
    torque_constant = 0.061223652 * (1 - 0.002 * exact)
    assert parameters["port_torque_constant"] == pytest.approx(torque_constant, rel=1e-6)
    fleet.reset(range(N), schedules=[()] * N, missions=[1.0] * N)
    assert not row(fleet, layout.PORT_TEMPERATURE).any()
    assert FleetTruth(fleet)["parameters"]["port_resistance"] == pytest.approx(1.01)


def test_a_hot_motor_that_also_fails_stays_as_hot():
    fault = (FaultEvent("motor_overheating:port", 30.0, 1.0),)
    _, _, fleet = run(["heating"], speed=1.0, steps=301, schedules=[fault] * N, **QUIET)
    exact = row(fleet, layout.PORT_TEMPERATURE)
    assert exact.min() > 0.2
    resistance = FleetTruth(fleet)["parameters"]["port_resistance"]
    assert resistance == pytest.approx(1.4 * 1.01 * (1 + 0.0039 * exact), rel=1e-12)


def test_a_counter_that_is_late_from_now_on_shows_the_past():
    fleets = [Fleet(1, **QUIET) for _ in range(2)]
    for fleet in fleets:
        start = fleet.reset([3], schedules=[()], missions=[0.3])[0, INDEX["port_rpm"]]
    late = [(FaultEvent("late_counter:port", 0.0, 1.0),)]
    fleets[1].replan(schedules=late)
    rpm = [[], []]
    for _ in range(4):
        for fleet, values in zip(fleets, rpm, strict=True):
            observation = fleet.step(np.full((1, 3), [0.6, 0.0, 0.0]))
            values.append(observation[0, INDEX["port_rpm"]])
    assert len(set(rpm[0])) == 4
    assert start > 100.0
    assert rpm[1][0] == rpm[1][1] == rpm[1][2] == start  # then the reading of three before
    assert rpm[1][3] == rpm[0][0]


def test_everything_survives_the_json_of_the_specification():
    env = gym.make(ENV, realism=1.5, imperfections=["tilt", "latency"])
    text = env.unwrapped.spec.to_json()
    copy = gym.make(EnvSpec.from_json(text))
    first, _ = env.reset(seed=3)
    again, _ = copy.reset(seed=3)
    other, _ = gym.make(ENV, realism=1.5).reset(seed=3)
    assert np.array_equal(first, again) and not np.array_equal(first, other)


@pytest.mark.parametrize("value", [-0.1, 10.5, math.nan, "1", True])
def test_bad_realism_is_refused(value):
    with pytest.raises(InputError, match=r"^realism: got .* allowed is a number from 0 to 10"):
        gym.make(ENV, realism=value)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("tilt", "imperfections: got 'tilt'; .* put the names into a list"),
        (["tlit"], "imperfection: got 'tlit'; .* did you mean 'tilt'"),
        ([3], "imperfection: got 3; "),
        (5, "imperfections: got 5; "),
    ],
)
@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_bad_imperfections_are_refused(value, message, factor):
    with pytest.raises(InputError, match=message):
        Fleet(1, realism=factor, imperfections=value)


def test_every_datum_has_effect_unit_and_source():
    for magnitude in SURROUNDINGS.values():
        assert magnitude.effect in EFFECTS
        assert magnitude.unit and magnitude.about and magnitude.source
    fields = realism.Imperfections._fields
    assert tuple(realism.IMPERFECTIONS_ORIGIN) == fields
    assert all(origin.effect in EFFECTS for origin in realism.IMPERFECTIONS_ORIGIN.values())
    assert tuple(IMPERFECTIONS) == READINGS
    for name, datum in IMPERFECTIONS.items():
        assert CHANNELS[name].low <= datum.low < datum.high <= CHANNELS[name].high


def test_the_document_lists_the_data():
    text = DOCUMENT.read_text(encoding="utf-8")
    for effect, about in EFFECTS.items():
        assert f"| `{effect}` | {about} |" in text
    for name, datum in SURROUNDINGS.items():
        value = f"{datum.value:.4g}"
        cells = (f"`{name}`", value, datum.unit, datum.effect, datum.about, datum.source)
        assert f"| {' | '.join(cells)} |" in text
    for name, datum in IMPERFECTIONS.items():
        values = " | ".join(f"{value:.4g}" for value in datum)
        assert f"| `{name}` | {CHANNELS[name].unit} | {values} |" in text
    for name, (effect, source) in realism.IMPERFECTIONS_ORIGIN.items():
        assert f"| `{name}` | {effect} | {source} |" in text
