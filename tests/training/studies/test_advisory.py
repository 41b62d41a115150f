"""Missions end as they should, energy and time add up, and the page comes from the results."""

import json
import subprocess
import sys

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from diagnosers.advisory import ABORT, CONTINUE, RETURN, Situation, advise
from training.studies import advisory, mission_runs
from training.studies.advisory_page import page
from training.studies.mission_runs import (
    ABORTED,
    FOLLOWED,
    GOAL,
    HOME,
    IGNORED,
    STRANDED,
    TRUTH_KNOWN,
    MissionPlan,
    MissionRuns,
    normal_belief,
    run_missions,
)

VEHICLE = PRESETS["thesis1992"]
PLENTY = 1e6


def situation(n_lanes=1, **values):
    usual = dict(
        speed=0.5,
        distance_to_go=30.0,
        distance_home=20.0,
        energy_left=PLENTY,
        hotel_load=5.0,
        current=0.0,
    )
    return Situation(
        **{name: np.full(n_lanes, value, float) for name, value in (usual | values).items()}
    )


def advice_to(level, n_lanes=1):
    advice = advise(normal_belief(n_lanes), situation(n_lanes), VEHICLE)
    return advice._replace(
        level=np.full(n_lanes, level), speed=np.full(n_lanes, 0.0 if level == ABORT else 0.5)
    )


@pytest.mark.parametrize(
    ("level", "energy", "end", "samples"),
    [
        (CONTINUE, PLENTY, GOAL, 600),
        (RETURN, PLENTY, HOME, 400),
        (ABORT, PLENTY, ABORTED, 1),
        (CONTINUE, 60.0, STRANDED, 100),
    ],
)
def test_how_a_mission_ends(level, energy, end, samples):
    """0.5 m/s over 30 m to go or 20 m home; 1 W of the motors beside the hotel load of 5 W."""
    mission = MissionRuns(situation(energy_left=energy))
    mission.follow(advice_to(level))
    n_samples = 0
    while mission.is_underway.any():
        mission.advance(np.array([0.5]), np.array([0.1]))
        n_samples += 1
    assert mission.outcome[0] == end
    assert n_samples == pytest.approx(samples if end != ABORTED else 0, abs=1)
    assert mission.energy_used[0] == pytest.approx(0.6 * n_samples)
    mission.advance(np.array([0.5]), np.array([0.1]))
    assert mission.energy_used[0] == pytest.approx(0.6 * n_samples)  # what has ended uses nothing
    assert mission.duration[0] == pytest.approx(0.1 * n_samples)


def test_a_current_against_the_way_carries_home():
    mission = MissionRuns(situation(current=0.1))
    mission.advance(np.array([0.5]), np.array([0.0]))
    assert mission.situation.distance_to_go[0] == pytest.approx(30.0 - 0.04)
    mission.follow(advice_to(RETURN))
    mission.advance(np.array([0.5]), np.array([0.0]))
    assert mission.situation.distance_home[0] == pytest.approx(20.0 + 0.04 - 0.06)


def test_the_speed_is_held_unless_its_reading_is_distrusted():
    mission = MissionRuns(situation())
    for _ in range(100):
        command = mission.command(np.array([0.4]))
    assert command[0, 0] == pytest.approx(0.5 + 10.0 * mission_runs.TRIM_RATE * 0.1)
    mission.follow(advice_to(CONTINUE)._replace(distrusted=np.array(["sensor:speed"])))
    assert mission.command(np.array([0.0]))[0, 0] == 0.5


def test_changes_of_the_action_are_counted():
    mission = MissionRuns(situation(2))
    for level in (
        [CONTINUE, CONTINUE],
        [CONTINUE, RETURN],
        [CONTINUE, CONTINUE],
        [ABORT, CONTINUE],
    ):
        mission.follow(advice_to(CONTINUE, 2)._replace(level=np.array(level)))
    assert mission.action_changes.tolist() == [1, 2]


def test_the_true_belief_knows_class_and_severity():
    fleet = Fleet(2)
    fleet.reset([0, 1], schedules=[(), (FaultEvent("increased_drag", 0.0, 0.7),)])
    for _ in range(2):
        fleet.step(np.zeros((2, 3)))
    belief = mission_runs.true_belief(fleet)
    top = belief.log_probability.argmax(axis=1)
    assert [classes()[k] for k in top] == ["normal", "increased_drag"]
    assert belief.severity_mean[1, top[1]] == pytest.approx(0.7)
    np.testing.assert_allclose(np.exp(belief.log_probability).sum(axis=1), 1.0)


def plan_of(schedule, n_lanes=8, **values):
    return MissionPlan(range(n_lanes), [schedule] * n_lanes, situation(n_lanes, **values))


def test_on_the_plant_a_healthy_mission_uses_what_the_advice_predicts():
    plan = plan_of((), distance_to_go=120.0)
    predicted = advise(normal_belief(8), plan.situation, VEHICLE).energy_per_metre
    runs = run_missions(plan, VEHICLE, IGNORED, make("null"))
    assert (runs.outcome == GOAL).all() and runs.advice is None
    used = runs.energy_used / 120.0
    assert used.mean() == pytest.approx(predicted.median[0], rel=0.02)
    assert (used > 0.98 * predicted.low).all() and (used < 1.02 * predicted.high).all()


def test_advice_on_the_truth_saves_missions_that_ignoring_it_strands():
    """Doubled drag, a fast mission, and a battery for less than the way at that speed."""
    plan = plan_of(
        (FaultEvent("increased_drag", 5.0, 1.0),),
        speed=0.8,
        distance_to_go=150.0,
        energy_left=4200.0,
    )
    diagnoser = make("null")
    ignored, informed = (
        run_missions(plan, VEHICLE, arm, diagnoser) for arm in (IGNORED, TRUTH_KNOWN)
    )
    assert (ignored.outcome == STRANDED).all()
    assert (informed.outcome == GOAL).all()
    assert (informed.energy_used < 4200.0).all()


def test_with_energy_to_spare_advice_changes_nothing():
    plan = plan_of((FaultEvent("increased_drag", 2.0, 1.0),), distance_to_go=20.0)
    ignored, followed = (
        run_missions(plan, VEHICLE, arm, make("null")) for arm in (IGNORED, FOLLOWED)
    )
    np.testing.assert_array_equal(ignored.energy_used, followed.energy_used)
    assert (followed.outcome == GOAL).all() and (followed.action_changes == 0).all()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A short study by the command's own main."""
    output = tmp_path_factory.mktemp("study") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advisory, "LENGTH", (30.0, 60.0))
        advisory.main(advisory.AdvisoryStudy(output=output, missions=4, diagnoser="limits"))
    assert (output / "index.html").stat().st_size > 10_000 and (output / "manifest.json").exists()
    return json.loads((output / "results.json").read_text())


def test_every_mission_has_ended_once_in_every_arm(results):
    for part in advisory.PARTS:
        for figures in results["parts"][part].values():
            assert sum(figures["outcomes"].values()) == pytest.approx(1.0)
            assert figures["completed"][0] == pytest.approx(figures["outcomes"]["reached the goal"])
    assert results["parts"]["healthy"][IGNORED]["completed"][0] == 1.0
    assert sum(results["counts"].values()) == 2 * 4


def test_differences_are_those_of_the_arms(results):
    faulty, by = (results[key]["propulsion fault"] for key in ("parts", "differences"))
    for other in (IGNORED, TRUTH_KNOWN):
        for quantity in ("completed", "stranded", "energy", "duration"):
            gap, low, high = by[f"followed minus {other}"][quantity]
            assert gap == pytest.approx(faulty[FOLLOWED][quantity][0] - faulty[other][quantity][0])
            assert low <= gap + 1e-9 and gap <= high + 1e-9


def test_the_page_is_made_from_results_alone(results):
    report = page(results)
    ends, differences, by_class, _ = report["sections"]
    assert len(ends["table"]["rows"]) == 9 and len(differences["table"]["rows"]) == 6
    assert [row[0] for row in by_class["table"]["rows"]] == sorted(results["counts"])
    for section in report["sections"][:3]:
        assert all(len(row) == len(section["table"]["columns"]) for row in section["table"]["rows"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"missions": 0}, "missions: got 0"),
        ({"diagnoser": "filterbank"}, "did you mean 'filter_bank'"),
        ({"hotel_load": float("nan")}, "hotel load: got nan"),
        ({"seed": -1}, "seed: got -1"),
    ],
)
def test_bad_input_is_refused(change, message, tmp_path):
    with pytest.raises(InputError, match=message):
        advisory.main(advisory.AdvisoryStudy(output=tmp_path / "run", **change))
    assert not (tmp_path / "run").exists()


def test_bad_input_is_one_line_at_the_command_line(tmp_path):
    command = [
        sys.executable,
        "-m",
        "training.studies.advisory",
        "--missions",
        "0",
        "--output",
        str(tmp_path / "run"),
    ]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 2 and run.stderr.count("\n") == 1 and "missions: got 0" in run.stderr
