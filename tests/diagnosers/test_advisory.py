"""The rules of the advice at their edges, its hysteresis, its intervals, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS
from diagnosers import Belief
from diagnosers.advisory import ACTIONS, LIMITS, MARGIN, N_AGREEING, Quantiles, Situation, advise
from diagnosers.capability import N_PLANT, capability

VEHICLE = PRESETS["thesis1992"]
ONE_SHAFT = replace(VEHICLE, shafts=1)
EASY = Situation(
    speed=0.8,
    distance_to_go=500.0,
    distance_home=500.0,
    energy_left=1e6,
    hotel_load=5.0,
    current=0.0,
)


def belief_of(name="normal", severity=0.0, probability=1.0, n_lanes=1):
    """What is certain or, with the rest on `normal`, probable."""
    share = np.full((n_lanes, len(classes())), 1e-40)
    share[:, 0] = 1.0 - probability + 1e-40
    share[:, classes().index(name)] += probability
    means = np.full_like(share, severity)
    means[:, 0] = 0.0
    return Belief(np.log(share), means, np.zeros_like(share))


def stacked(*beliefs):
    return Belief(*(np.concatenate(parts) for parts in zip(*beliefs, strict=True)))


def action(belief, situation, vehicle=VEHICLE, **settings):
    (word,) = advise(belief, situation, vehicle, **settings).action
    return str(word)


def test_a_healthy_vehicle_with_energy_to_spare_continues():
    advice = advise(belief_of(), EASY, VEHICLE)
    assert (
        advice.action[0] == "continue"
        and advice.speed[0] == EASY.speed
        and advice.distrusted[0] == ""
    )
    assert advice.range.low[0] > EASY.distance_to_go
    for quantiles in (
        advice.reachable_speed,
        advice.energy_per_metre,
        advice.range,
        advice.best_range,
        advice.range_home,
    ):
        assert isinstance(quantiles, Quantiles)
        assert quantiles.low[0] < quantiles.median[0] < quantiles.high[0]


@pytest.fixture(scope="module")
def tight():
    """A battery for about 500 m, and the safe ranges at the mission's and at the best speed."""
    situation = EASY._replace(energy_left=1e4)
    advice = advise(belief_of("increased_drag", 1.0), situation, VEHICLE)
    assert advice.best_speed[0] < situation.speed
    return situation, advice.range.low[0], advice.best_range.low[0], advice.range_home


@pytest.mark.parametrize(
    ("to_go", "home", "expected"),
    [
        ("0.99 of the range", "far", "continue"),
        ("1.01 of the range", "far", "derate"),
        ("0.99 of the best", "near", "derate"),
        ("1.01 of the best", "near", "return"),
        ("1.01 of the best", "far", "abort"),
    ],
)
def test_what_to_do_follows_from_the_range(tight, to_go, home, expected):
    situation, at_speed, best, homeward = tight
    share, base = to_go.split(" of the ")
    distance = float(share) * {"range": at_speed, "best": best}[base] / MARGIN
    back = {"near": homeward.low[0], "far": homeward.median[0]}[home] / MARGIN
    asked = situation._replace(distance_to_go=distance, distance_home=back)
    assert action(belief_of("increased_drag", 1.0), asked) == expected


def test_the_derated_speed_is_the_fastest_that_reaches_the_goal(tight):
    situation, at_speed, best, _ = tight
    situation = situation._replace(distance_to_go=(at_speed + best) / 2 / MARGIN)
    belief = belief_of("increased_drag", 1.0)
    advice = advise(belief, situation, VEHICLE)
    assert advice.action[0] == "derate"
    same, faster = (
        situation._replace(speed=advice.speed[0] + more) for more in (0.0, 0.1 * situation.speed)
    )
    assert action(belief, same) == "continue"
    assert action(belief, faster) == "derate"
    assert (
        f"at {advice.speed[0]:.2f} m/s" in advice.reason[0]
        and "increased_drag is likely (100 %" in advice.reason[0]
    )


def test_a_head_current_shortens_the_way_to_go_and_lengthens_the_way_home():
    against, still = (
        advise(belief_of(), EASY._replace(current=current), VEHICLE) for current in (0.2, 0.0)
    )
    assert against.range.median[0] == pytest.approx(still.range.median[0] * 0.6 / 0.8)
    assert against.range_home.median[0] > still.range_home.median[0]


@pytest.mark.parametrize(
    ("shafts", "probability", "current", "expected"),
    [
        (2, 1.0, 0.0, "continue"),  # the other propeller does it
        (2, 1.0, 1.15, "abort"),  # it reaches 1.2 m/s
        (2, 1.0, -1.15, "abort"),
        (2, 0.0, 1.15, "return"),  # with the current
        (1, 1.0, 0.0, "abort"),
        (1, 0.15, 0.0, "abort"),  # more than one in ten
        (1, 0.05, 0.0, "return"),  # no range is sure, but home is probable
        (1, 0.01, 0.0, "continue"),
    ],
)
def test_a_vehicle_that_may_drift_aborts(shafts, probability, current, expected):
    situation = EASY._replace(current=current, speed=0.3 if current == 0.0 else 1.0)
    vehicle = replace(VEHICLE, shafts=shafts)
    got = advise(belief_of("propeller_loss:port", 1.0, probability), situation, vehicle)
    assert got.action[0] == expected
    assert ("it may reach only" in got.reason[0]) == (expected == "abort")


@pytest.mark.parametrize("channel", READINGS)
def test_a_false_reading_is_named(channel):
    advice = advise(belief_of(f"sensor:{channel}", 0.8, 0.9), EASY, VEHICLE)
    assert (
        advice.distrusted[0] == f"sensor:{channel}"
        and f"sensor:{channel} is likely (90 %)" in advice.reason[0]
    )
    assert advice.action[0] == ("derate" if channel == "speed" else "continue")
    assert advice.speed[0] <= EASY.speed


def test_a_motor_stays_within_its_rating():
    # N m: 4.1 A of the rated 4.75 before the propeller is turned
    stiff = replace(VEHICLE, coulomb_friction=0.25)
    advice = advise(belief_of(), EASY._replace(speed=0.9), stiff)
    assert advice.action[0] == "derate" and 0.3 < advice.speed[0] < 0.6
    assert "rated" in advice.reason[0]


def test_the_action_changes_only_when_every_recent_judgement_agrees():
    fine = belief_of()
    bad = belief_of("propeller_loss:port", 1.0)
    seen = []
    advice = None
    for belief in (
        [fine]
        + [bad] * (N_AGREEING - 1)
        + [fine]
        + [bad] * N_AGREEING
        + [fine, bad] * 3
        + [fine] * N_AGREEING
    ):
        advice = advise(belief, EASY._replace(speed=0.3), ONE_SHAFT, previous=advice)
        seen.append(str(advice.action[0]))
    quiet = N_AGREEING + N_AGREEING
    alarmed = 6 + N_AGREEING
    assert seen == ["continue"] * quiet + ["abort"] * alarmed + ["continue"]


def test_lanes_are_independent_of_each_other():
    beliefs = [
        belief_of(),
        belief_of("increased_drag", 0.7),
        belief_of("propeller_loss:port", 1.0),
        belief_of("sensor:speed", 1),
    ]
    situation = EASY._replace(
        energy_left=np.array([1e4, 8e3, 6e3, 1e5]), distance_to_go=np.full(4, 400.0)
    )
    together = advise(stacked(*beliefs), situation, VEHICLE)
    for lane, belief in enumerate(beliefs):
        alone = advise(
            belief,
            situation._replace(energy_left=situation.energy_left[lane], distance_to_go=400.0),
            VEHICLE,
        )
        assert alone.action[0] == together.action[lane] and alone.reason[0] == together.reason[lane]
        for one, all_lanes in zip(alone.range, together.range, strict=True):
            assert one[0] == all_lanes[lane]


def test_the_interval_holds_the_true_energy_of_healthy_vehicles():
    fleet = Fleet(400)
    fleet.reset(range(400), schedules=[()] * 400)
    true = capability(
        fleet.plan.healthy[:, None, :N_PLANT], np.full((400, 1), EASY.speed), VEHICLE
    ).power[:, 0, 0]
    per_metre = advise(belief_of(), EASY, VEHICLE).energy_per_metre
    truly = (true + EASY.hotel_load) / EASY.speed
    assert 0.90 <= ((truly >= per_metre.low) & (truly <= per_metre.high)).mean() <= 0.99
    assert np.median(truly) == pytest.approx(per_metre.median[0], rel=0.005)


def test_no_action_is_left_out_of_the_rules():
    assert ACTIONS == ("continue", "derate", "return", "abort")
    assert set(LIMITS) == set(Situation._fields)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0.0}, "speed of the situation: got 0.0; allowed is a number from 0.01 to 1"),
        ({"distance_to_go": -1.0}, "distance_to_go of the situation: got -1.0"),
        ({"energy_left": float("nan")}, "energy_left of the situation: got nan"),
        ({"hotel_load": float("inf")}, "hotel_load of the situation: got inf"),
        ({"current": 11.0}, "current of the situation: got 11.0"),
        ({"speed": [0.3, 0.3]}, "speed: got .0.3, 0.3.; allowed is numbers of shape"),
        ({"distance_home": "far"}, "distance_home: got 'far'"),
    ],
)
def test_an_impossible_situation_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        advise(belief_of(), EASY._replace(**change), VEHICLE)


def test_a_faster_vehicle_may_have_a_faster_mission():
    remus = PRESETS["remus100"]
    assert advise(belief_of(), EASY._replace(speed=1.4), remus).speed[0] == 1.4
    with pytest.raises(InputError, match=r"speed of the situation: got 1.6; .* 0.01 to 1.5"):
        advise(belief_of(), EASY._replace(speed=1.6), remus)
