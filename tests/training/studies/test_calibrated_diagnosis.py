import json

import pytest

from training.field.vehicle_file import read_vehicle
from training.studies import calibrated_diagnosis, faulty_mission
from training.studies.calibrated_diagnosis import ASSUMED, CALIBRATED, DiagnosisStudy
from training.studies.faulty_mission import FOLDS, FaultyMissionStudy


def test_the_faulty_mission_is_found_and_no_healthy_one(tmp_path):
    faulty_mission.main(FaultyMissionStudy(output=tmp_path / "out", missions=FOLDS, duration=120.0))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["false_alarms"] == 0
    assert (
        results["verdicts"].pop(f"mission-{FOLDS:03d}.csv") == "fault"
        and results["alarm_time"] < 60.0
    )
    assert set(results["verdicts"].values()) == {"healthy"} and len(results["verdicts"]) == FOLDS
    assert read_vehicle(tmp_path / "out" / "calibrated.toml").shafts == 1


def test_without_a_greater_load_the_last_mission_is_healthy_too(tmp_path):
    faulty_mission.main(
        FaultyMissionStudy(output=tmp_path / "out", missions=FOLDS, duration=60.0, load=1.0)
    )
    assert json.loads((tmp_path / "out" / "results.json").read_text())["alarm_time"] is None


@pytest.mark.slow
def test_a_calibrated_vehicle_is_diagnosed_nearly_as_well_as_the_preset(tmp_path):
    calibrated_diagnosis.main(DiagnosisStudy(output=tmp_path / "out", vehicles=1, lanes=36))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["ratio"] > 0.8  # 48 episodes: the study itself says it more exactly
    assert results["scores"][CALIBRATED]["macro_f1"] > results["scores"][ASSUMED]["macro_f1"] + 0.1
