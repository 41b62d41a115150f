import json
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from training.metrics.records import HealthyOutcome
from training.seeds import purpose_of
from training.studies import robustness, robustness_rows, robustness_runs
from training.studies.robustness import RobustnessStudy
from training.studies.robustness_rows import ROWS, alarm_finding
from training.studies.robustness_runs import EveryOther, Runs, conditions

RUNS = Runs(diagnoser="null", purpose="validation", hours=1.0, workers=1, seed=0)


def outcome(begin, end, hours):
    """Two lanes, alarms at thresholds above -5."""
    n = len(begin)
    nothing = np.zeros((5, 2))
    return HealthyOutcome(
        low=np.full(n, -5.0),
        high=np.full(n, -0.2),
        begin=np.array(begin),
        quarter=np.arange(n) % 4,
        end_low=np.full(n, -5.0),
        end_high=np.full(n, -0.2),
        end=np.array(end),
        complete=np.array([-0.1]),
        least=np.full(2, -5.0),
        depth=nothing,
        fault=nothing,
        log_probability=nothing,
        hours=np.array(hours),
    )


def test_alarms_and_time_in_alarm_by_hand():
    healthy = outcome([10.0, 100.0, 200.0], [46.0, 136.0, 200.0], [0.5, 0.5])
    found = alarm_finding("x", healthy, -1.0, most_per_hour=2.0, most_time=0.01)
    assert found.figures["per_hour"] == 3.0 and found.figures["by_quarter"] == [1, 1, 1, 0]
    assert found.figures["time_in_alarm"] == pytest.approx(0.02)
    assert found.reached is False
    # below their level there is no alarm
    quiet = alarm_finding("x", healthy, -6.0, most_per_hour=2.0, most_time=0.01)
    assert quiet.figures["alarms"] == quiet.figures["time_in_alarm"] == 0
    assert quiet.reached is True
    long = outcome([10.0], [100.0], [0.5, 0.5])
    assert alarm_finding("x", long, -1.0, most_per_hour=2.0, most_time=0.01).reached is False


def test_no_row_has_the_seeds_of_another_or_of_the_thresholds():
    spans = [RUNS.seeds(row, robustness_runs.RUN_BLOCK) for row in range(len(ROWS) + 1)]
    firsts = [span.start for span in spans]
    assert np.diff(firsts).min() >= robustness_runs.RUN_BLOCK
    last = replace(RUNS, seed=robustness_runs.MOST_RUNS - 1)
    assert last.seeds(1, robustness_runs.RUN_BLOCK).stop <= RUNS.seeds(2, 1).start
    assert {purpose_of(first) for first in firsts} == {"validation"}
    assert purpose_of(RUNS.seeds(0, 1, "calibration").start) == "calibration"


def test_half_of_the_vehicles_have_the_stimulus():
    from auv_fault_env.channels import CHANNELS

    observation = np.full((4, len(CHANNELS)), 0.3)
    offset = EveryOther().offset(0, observation, None)
    assert (offset[::2] == 0.0).all() and (offset[1::2] != 0.0).all()


def test_merged_classes_are_those_of_the_propellers():
    names = classes()
    merged = [names[robustness_rows._merged(name)] for name in names]
    changed = {
        before: after for before, after in zip(names, merged, strict=True) if before != after
    }
    sides = ("port", "starboard")
    assert changed == {f"propeller_loss:{side}": f"propeller_damage:{side}" for side in sides}


def test_conditions_are_the_standard_ones_with_another_plant():
    of = conditions(realism=2.0, imperfections=("tilt",))
    assert of.plant["realism"] == 2.0 and of.plant["imperfections"] == ("tilt",)
    assert of.steering == conditions(realism=1.0).steering


def test_a_silent_diagnoser_alarms_never_and_names_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(robustness_rows, "HOUR", 60.0)
    rows = ("rest", "double")
    robustness.main(
        RobustnessStudy(
            output=tmp_path / "out",
            diagnoser="null",
            rows=rows,
            purpose="validation",
            hours=1.0,
            workers=1,
        )
    )
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert tuple(results["rows"]) == rows
    assert all(one["reached"] for one in results["rows"]["rest"])
    double = results["rows"]["double"]
    assert [one["figures"]["alarmed"] for one in double] == [0.0] * 3
    # without an alarm there is nothing to judge, and only all together are
    assert [one["reached"] for one in double] == [None] * 3
    assert [bool(one["to_reach"]) for one in double] == [True, False, False]
    command = results["command"]
    assert "--rows rest double" in command and "--purpose validation" in command


@pytest.mark.parametrize(
    ("right", "surely_wrong", "reached"),
    [(0.7, 0.05, True), (0.69, 0.0, False), (1.0, 0.06, False)],
)
def test_names_are_good_enough_if_most_are_right_and_few_surely_wrong(right, surely_wrong, reached):
    named = {"right": right, "surely_wrong": surely_wrong}
    finding = robustness_rows.Finding("all", "", "", None, named)
    assert robustness_rows._judged_by_names(finding).reached is reached


@pytest.mark.parametrize(
    "fields", [{"diagnoser": "nul"}, {"rows": ("rests",)}, {"hours": 0.0}, {"seed": 20}]
)
def test_bad_options_are_refused(tmp_path, fields):
    with pytest.raises(InputError):
        robustness.main(RobustnessStudy(output=tmp_path / "out", **fields))
