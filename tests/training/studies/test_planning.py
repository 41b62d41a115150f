"""The study of planning on a few vehicles."""

from training.benchmark.trials import FAULTY, THRESHOLD
from training.seeds import purpose_of
from training.stimuli import STIMULI
from training.studies.planning import POINTS, Planning, lanes_of, study
from training.studies.stimulus_front_runs import point_of


def test_a_reference_is_compared_with_itself_and_costs_its_amplitude(tmp_path):
    points = ("thesis:0.05",)
    arguments = Planning(points, per_class=1, hours=0.05, workers=1, cache=tmp_path)
    results = study(arguments, [point_of(text) for text in points])
    (row,) = results["points"]
    assert row["ratio"] == [1.0, 1.0, 1.0]
    assert abs(row["healthy_rms"] - 0.05) < 1e-3
    assert 0.0 < row["mean"][0] <= 30.0
    assert "thesis:0.05 is the quickest" in results["summary"][1]
    (section,) = results["sections"]
    assert section["table"]["rows"][0][0] == "thesis:0.05"


def test_vehicles_are_of_validation_and_lose_whole_propellers():
    lanes = lanes_of(Planning(per_class=2, hours=0.1))
    faulty = lanes.episodes[FAULTY]
    assert len(faulty) == 14 and len(lanes.episodes[THRESHOLD]) == 6
    for episodes in lanes.episodes.values():
        assert {purpose_of(one.seed) for one in episodes} == {"validation"}
    for episode in faulty:
        (event,) = episode.schedule
        assert event.ramp == 0.0
        assert event.severity == 1.0 or not event.fault.startswith("propeller_loss")


def test_its_points_are_stimuli():
    assert {point_of(text).stimulus for text in POINTS} <= STIMULI.keys()
