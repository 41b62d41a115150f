import json
import math
import tracemalloc

import pyarrow.parquet
import pytest
from tqdm import tqdm

import auv_fault_env
from auv_fault_env import CHANNELS, FaultEvent, Fleet, to_json
from auv_fault_env.missions import follow_mission
from training import cli
from training.commands import simulate

SHORT = ["--duration", "3"]


def run(tmp_path, *arguments):
    code = cli.main(["simulate", "--output", str(tmp_path / "out"), *SHORT, *arguments])
    return code, tmp_path / "out"


def read(folder):
    return pyarrow.parquet.read_table(folder / "episodes.parquet").to_pydict()


def test_a_row_is_a_sample_of_a_vehicle(tmp_path):
    code, folder = run(tmp_path, "--vehicles", "3")
    assert code == 0
    columns = read(folder)
    assert len(columns["time"]) == 3 * 30
    assert set(CHANNELS) < set(columns)
    assert columns["vehicle"] == [0] * 30 + [1] * 30 + [2] * 30


def test_rows_are_the_fleet_itself(tmp_path):
    _, folder = run(
        tmp_path,
        "--vehicles",
        "2",
        "--seed",
        "5",
        "--mission",
        "thesis",
        "--schedule",
        healthy(tmp_path),
    )
    columns = read(folder)
    mission = auv_fault_env.MISSIONS["thesis"]
    fleet = Fleet(2)
    observation = fleet.reset([5, 6], schedules=[()] * 2, missions=[mission] * 2)
    for k in range(30):
        observation = fleet.step(follow_mission(observation))
        assert columns["speed"][k] == observation[0, 4]
        assert columns["speed"][30 + k] == observation[1, 4]
    assert columns["time"][29] == 3.0
    assert columns["seed"][30] == 6


def healthy(tmp_path):
    path = tmp_path / "healthy.json"
    path.write_text("[]")
    return str(path)


def test_many_vehicles_in_chunks_equal_few_at_once(tmp_path, monkeypatch):
    _, folder = run(tmp_path, "--vehicles", "5")
    whole = read(folder)
    monkeypatch.setattr(simulate, "ROWS_AT_ONCE", 60)
    _, folder = run(tmp_path, "--vehicles", "5")
    assert read(folder) == whole


def test_a_long_mission_of_one_vehicle_takes_no_more_memory_than_many_short_ones():
    fleet = Fleet(1)
    observation = fleet.reset([1])
    with tqdm(disable=True) as bar:
        tracemalloc.start()
        simulate.roll_out_with_truth(fleet, observation, 1000, bar)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert most / 1000 < 3000  # bytes per sample


def test_given_schedule_strikes_and_is_recorded(tmp_path):
    event = FaultEvent("propeller_loss:port", 1.0, 1.0)
    path = tmp_path / "faults.json"
    path.write_text(to_json((event,)))
    _, folder = run(tmp_path, "--vehicles", "1", "--schedule", str(path))
    columns = read(folder)
    assert columns["truth_label"][:10] == ["normal"] * 10
    assert columns["truth_label"][10:] == ["propeller_loss:port"] * 20
    assert columns["truth_port_beta"][-1] == 0.0
    assert json.loads((folder / "schedules.json").read_text())["0"] == json.loads(to_json((event,)))


def test_a_vehicle_with_one_shaft_has_no_starboard_faults_and_readings(tmp_path, capfd):
    one = ("--vehicles", "1", "--preset", "remus100")
    _, folder = run(tmp_path, *one, "--mission", "1.4")
    columns = read(folder)
    assert columns["speed_command"][-1] == pytest.approx(1.4) and columns["port_rpm"][-1] > 1000.0
    assert set(columns["starboard_rpm"]) == {0.0}
    path = tmp_path / "faults.json"
    path.write_text(to_json((FaultEvent("propeller_loss:starboard", 1.0, 1.0),)))
    code, _ = run(tmp_path, *one, "--schedule", str(path))
    message = capfd.readouterr().err.splitlines()[-1]
    assert code == 2 and "'propeller_loss:starboard'; allowed is one of port" in message


def test_sampled_schedules_are_recorded_exactly(tmp_path):
    _, folder = run(tmp_path, "--vehicles", "4", "--seed", "1")
    recorded = json.loads((folder / "schedules.json").read_text())
    sampler = auv_fault_env.ScheduleSampler()
    for vehicle in range(4):
        assert auv_fault_env.from_json(json.dumps(recorded[str(vehicle)])) == sampler.sample(
            1 + vehicle
        )


def test_healthy_vehicles_have_no_onset(tmp_path):
    _, folder = run(tmp_path, "--vehicles", "1", "--schedule", healthy(tmp_path))
    assert set(read(folder)["truth_onset"]) == {math.inf}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--preset", "thesis1993"],
            ["preset", "'thesis1993'", "npsnet1995", "did you mean 'thesis1992'"],
        ),
        (["--vehicles", "0"], ["vehicles", "0", "from 1"]),
        (["--duration", "-1"], ["duration", "-1", "0.1"]),
        (["--duration", "nan"], ["duration", "nan"]),
        (["--sensor-noise", "-1"], ["sensor-noise", "-1"]),
        (["--mission", "thesys"], ["mission", "'thesys'", "did you mean 'thesis'"]),
        (["--mission", "7"], ["mission speed", "7"]),
        (["--schedule", "nowhere.json"], ["schedule file", "nowhere.json"]),
    ],
    ids=lambda value: " ".join(value) if value and value[0].startswith("--") else "",
)
def test_bad_input_ends_with_two_one_line_and_nothing_written(tmp_path, capfd, arguments, words):
    code, _ = run(tmp_path, *arguments)
    message = capfd.readouterr().err
    assert code == 2
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())


def test_broken_schedule_names_line_and_column(tmp_path, capfd):
    path = tmp_path / "broken.json"
    path.write_text('[{"fault": "increased_drag",\n "onset": 1 "severity": 1}]')
    code, _ = run(tmp_path, "--schedule", str(path))
    assert code == 2
    assert "line 2 column 13" in capfd.readouterr().err


def test_schedule_after_the_end_is_refused(tmp_path, capfd):
    path = tmp_path / "late.json"
    path.write_text('[{"fault": "increased_drag", "onset": 4, "severity": 1}]')
    code, folder = run(tmp_path, "--schedule", str(path))
    assert code == 2
    assert "before the episode's end at 3 s" in capfd.readouterr().err
    assert not folder.exists()


def test_unknown_option_ends_with_two(capfd):
    assert cli.main(["simulate", "--vehicels", "3"]) == 2
    assert "--vehicels" in capfd.readouterr().err


def test_page_names_every_fault_and_holds_its_figure(tmp_path):
    _, folder = run(tmp_path, "--vehicles", "6", "--seed", "1")
    text = (folder / "index.html").read_text()
    for events in json.loads((folder / "schedules.json").read_text()).values():
        for event in events:
            assert event["fault"] in text
    assert text.count("data:image/svg+xml;base64,") == 1
    assert (folder / "figures" / "first-vehicle.png").exists()
