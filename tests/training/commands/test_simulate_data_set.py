"""The data set of `auv-fault simulate`: types, dictionary, events, parts, distributions."""

import csv
import json
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

from auv_fault_env import (
    CHANNELS,
    FaultEvent,
    Fleet,
    MissionDistribution,
    MissionSampler,
    ScheduleDistribution,
    ScheduleSampler,
)
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import first_onset
from auv_fault_env.unmodelled import plant_fault
from training import cli, seeds
from training.commands import simulate
from training.field.vehicle_file import Column, VehicleFile, write_vehicle

LARGEST = 350e6 / (10_000 * 600)  # bytes per sample, of 10,000 vehicles over 60 s
EVENTFUL = {"healthy": 0.0, "compound": 1.0, "intermittent": 0.5, "repaired": 0.5, "onset": [1, 3]}


@pytest.fixture(autouse=True)
def no_page(monkeypatch):
    """Leave out the page, which takes longer than all else here."""
    monkeypatch.setattr(simulate, "write_report", lambda *_: None)


def simulated(folder, *arguments, duration=3):
    options = ["--output", str(folder), "--duration", str(duration), *arguments]
    assert cli.main(["simulate", *options]) == 0
    return folder


def read(folder, table="episodes"):
    return pyarrow.parquet.read_table(folder / f"{table}.parquet")


def json_file(tmp_path, content):
    path = tmp_path / "given.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return str(path)


@pytest.fixture(scope="module")
def eventful(tmp_path_factory):
    """40 vehicles with two faults each, by the whole path from a JSON file."""
    tmp_path = tmp_path_factory.mktemp("eventful")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulate, "write_report", lambda *_: None)
        options = "--vehicles", "40", "--schedules", json_file(tmp_path, EVENTFUL)
        return simulated(tmp_path / "run", *options, duration=20)


def test_readings_are_float32_with_zstd_and_split_streams(eventful):
    file = pyarrow.parquet.ParquetFile(eventful / "episodes.parquet")
    exact = {"time", "truth_onset"}
    for k, field in enumerate(file.schema_arrow):
        chunk = file.metadata.row_group(0).column(k)
        assert chunk.compression == "ZSTD"
        if pa.types.is_floating(field.type):
            assert field.type == (pa.float64() if field.name in exact else pa.float32())
            assert "BYTE_STREAM_SPLIT" in chunk.encodings
        else:
            assert "RLE_DICTIONARY" in chunk.encodings


def test_a_sample_takes_so_few_bytes_that_ten_thousand_vehicles_fit(tmp_path):
    folder = simulated(tmp_path / "run", "--vehicles", "60", duration=60)
    n_bytes = sum(path.stat().st_size for path in folder.glob("*.parquet"))
    assert n_bytes / (60 * 600) < LARGEST


def test_the_dictionary_and_the_metadata_of_the_files_say_the_same(eventful):
    with (eventful / "dictionary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    said = []
    for table in ("episodes", "events"):
        for field in read(eventful, table).schema:
            words = {name.decode(): text.decode() for name, text in field.metadata.items()}
            said.append({"table": table, "column": field.name} | words)
            assert words["description"]
            is_number = pa.types.is_floating(field.type)
            assert bool(words["unit"]) == is_number, field.name
    for row in rows:
        kind = row.pop("type")
        column = read(eventful, row["table"])[row["column"]]
        is_name = pa.types.is_dictionary(column.type)
        assert kind == ("string" if is_name else column.to_numpy().dtype)
    assert rows == said


def test_every_event_is_in_the_events(eventful):
    recorded = json.loads((eventful / "schedules.json").read_text())
    found = {vehicle: [] for vehicle in recorded}
    for row in read(eventful, "events").to_pylist():
        event = FaultEvent(
            *(row[name] for name in ("fault", "onset", "severity", "ramp", "end", "period", "duty"))
        )
        assert row["event"] == len(found[str(row["vehicle"])])
        assert row["seed"] == row["vehicle"]
        fault = plant_fault(event.fault)
        assert (row["class"], row["component"]) == (fault.diagnosis, fault.component)
        found[str(row["vehicle"])].append(event)
    assert sum(map(len, found.values())) > 60
    for vehicle, events in recorded.items():
        assert [FaultEvent(**event) for event in events] == found[vehicle]


def severity(event, time):
    """What the dictionary says of the severity profile."""
    since = time - event["onset"]
    severity = event["severity"] * np.minimum(since / max(event["ramp"], 1e-12), 1.0)
    if event["period"]:
        severity[(since / event["period"] + 1e-9) % 1.0 > event["duty"]] = 0.0
    severity[(since < 0.0) | (time >= event["end"])] = 0.0
    return severity


def test_the_events_explain_severity_and_class_of_every_sample(eventful):
    episodes = read(eventful).to_pydict()
    time = np.round(np.array(episodes["time"][:200]) - 0.1, 1)
    worst = np.zeros((40, 200))
    label = np.full((40, 200), "normal", object)
    for event in read(eventful, "events").to_pylist():
        now = severity(event, time)
        is_worse = now > worst[event["vehicle"]]
        worst[event["vehicle"]][is_worse] = now[is_worse]
        label[event["vehicle"]][is_worse] = event["class"]
    np.testing.assert_allclose(episodes["truth_severity"], worst.ravel(), atol=1e-6)
    assert episodes["truth_label"] == label.ravel().tolist()
    assert 0.2 < np.mean(worst > 0.0) < 0.9


def test_text_only_on_demand_and_with_the_same_numbers(tmp_path):
    folder = simulated(tmp_path / "run", "--vehicles", "2")
    assert list(folder.glob("*.csv")) == [folder / "dictionary.csv"]
    both = simulated(tmp_path / "both", "--vehicles", "2", "--formats", "csv", "parquet")
    for table in ("episodes", "events"):
        text = pyarrow.csv.read_csv(both / f"{table}.csv").to_pydict()
        assert (folder / f"{table}.parquet").read_bytes() == (
            both / f"{table}.parquet"
        ).read_bytes()
        for name, values in read(both, table).to_pydict().items():
            if values and not isinstance(values[0], str):
                np.testing.assert_allclose(text[name], values, rtol=1e-6)
            else:
                assert text[name] == values


def test_a_healthy_data_set_has_an_empty_table_of_events(tmp_path):
    folder = simulated(tmp_path / "run", "--schedule", json_file(tmp_path, []))
    assert read(folder, "events").num_rows == 0


def test_parts_of_a_data_set_share_no_seed(tmp_path):
    found = {}
    for split, purpose in seeds.SPLITS.items():
        options = "--split", split, "--vehicles", "2", "--seed", "7"
        folder = simulated(tmp_path / split, *options, duration=0.2)
        found[split] = set(read(folder)["seed"].to_pylist())
        assert found[split] == set(seeds.seeds(purpose, 2, 7))
        assert {seeds.purpose_of(seed) for seed in found[split]} == {purpose}
    assert len(set.union(*found.values())) == 8


def test_vehicles_of_a_part_are_those_of_its_seeds(tmp_path):
    options = "--vehicles", "1", "--seed"
    part = simulated(tmp_path / "part", *options, "3", "--split", "test")
    plain = simulated(tmp_path / "plain", *options, str(seeds.seeds("test", 1, 3)[0]))
    assert read(part).equals(read(plain))


@dataclass(frozen=True)
class OneFault(ScheduleDistribution):
    """One fault at a random time."""

    latest: float = 2.0

    def schedule(self, random, vehicle):
        return [FaultEvent("increased_drag", random.uniform(0.0, self.latest), 0.5)]


@dataclass(frozen=True)
class Slow(MissionDistribution):
    """One speed, without a default."""

    speed: float

    def mission(self, random, maximum_speed):
        return self.speed * maximum_speed


@dataclass(frozen=True)
class Broken(ScheduleDistribution):
    """Foreign code that fails."""

    def schedule(self, random, vehicle):
        return 1 / 0


def test_distributions_are_those_of_the_environment(tmp_path):
    given = {"healthy": 0.5, "onset": [0.5, 2.0], "prior": {"increased_drag": 1.0}}
    missions = tmp_path / "missions.json"
    missions.write_text('{"speed": [0.3, 0.4], "from_rest": 0.0}')
    options = "--schedules", json_file(tmp_path, given), "--missions", str(missions)
    folder = simulated(tmp_path / "run", "--vehicles", "12", "--realism", "1", *options)
    fleet = Fleet(
        12,
        schedules=ScheduleSampler(**given),
        missions=MissionSampler((0.3, 0.4), from_rest=0.0),
        realism=1.0,
    )
    observation = fleet.reset(range(12))
    for _ in range(30):
        observation = fleet.step(follow_mission(observation))
    columns = {name: read(folder)[name].to_numpy().reshape(12, 30) for name in CHANNELS}
    np.testing.assert_array_equal(np.stack([*columns.values()])[:, :, -1].T, observation)
    onset = read(folder)["truth_onset"].to_numpy().reshape(12, 30)
    assert onset[:, 0].tolist() == first_onset(fleet.plan).tolist()
    assert set(read(folder, "events")["fault"].to_pylist()) == {"increased_drag"}
    assert columns["mission_speed"].min() >= 0.3 and columns["mission_speed"].max() <= 0.4


def test_a_class_of_ones_own_is_taken_by_its_name(tmp_path, monkeypatch):
    folder = simulated(tmp_path / "run", "--schedules", f"{__name__}:OneFault")
    assert read(folder, "events")["fault"].to_pylist() == ["increased_drag"] * 8
    given = {"type": f"{__name__}:Slow", "speed": 0.25}
    folder = simulated(tmp_path / "run", "--missions", json_file(tmp_path, given))
    assert set(read(folder)["mission_speed"].to_pylist()) == {0.25}


def vehicle_file(tmp_path):
    """A heavy vehicle with one exact parameter, one that varies widely, and a noisy sensor."""
    path = tmp_path / "vehicle.toml"
    vehicle = VehicleFile(
        replace(PRESETS["thesis1992"], alpha=-0.2),
        {"speed": Column("speed")},
        band={"alpha": 0.0, "gamma": 0.5},
        noise={"speed": 0.3, "acceleration": 0.0},
    )
    write_vehicle(path, vehicle)
    return str(path)


def test_vehicles_of_a_file_have_its_constants_band_and_noise(tmp_path):
    options = "--vehicle", vehicle_file(tmp_path), "--schedule", json_file(tmp_path, [])
    folder = simulated(tmp_path / "run", "--vehicles", "30", *options)
    columns = {name: read(folder)[name].to_numpy() for name in read(folder).column_names}
    assert set(columns["truth_alpha"]) == {np.float32(-0.2)}
    gamma = np.unique(columns["truth_gamma"] / PRESETS["thesis1992"].gamma)
    assert len(gamma) == 30 and 0.5 <= gamma.min() < 0.7 and 1.3 < gamma.max() <= 1.5
    error = {name: columns[name] - columns[f"truth_{name}"] for name in ("speed", "acceleration")}
    assert 0.27 < error["speed"].std() < 0.33
    assert np.abs(error["acceleration"]).max() < 1e-6


@pytest.mark.parametrize(
    "more", [("--preset", "remus100"), ("--formats", "minari")], ids=["preset", "minari"]
)
def test_what_does_not_go_with_a_vehicle_file_is_refused(tmp_path, capfd, more):
    options = "--output", str(tmp_path / "run"), "--vehicle", vehicle_file(tmp_path)
    assert cli.main(["simulate", *options, *more]) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1 and "--vehicle" in message and more[1] in message


@pytest.mark.parametrize(
    ("arguments", "content", "words"),
    [
        (["--schedules"], "[]", ["schedules", "got []", "give --schedule"]),
        (["--schedules"], "{", ["schedules", "line 1 column 2"]),
        (["--schedules"], {"healty": 1}, ["'healty'", "did you mean 'healthy'"]),
        (["--schedules"], {"healthy": 2}, ["healthy", "from 0 to 1"]),
        (["--schedules"], {"prior": 5}, ["prior: got 5", "a mapping of classes to weights"]),
        (["--missions"], {"speed": [0.5, 2]}, ["speed of the legs", "from 0 to 1"]),
        (["--missions"], {"type": f"{__name__}:Slow"}, ["missions", "'speed'"]),
        (["--missions"], {"type": f"{__name__}:Slow", "speed": 3}, ["mission speed", "3"]),
        (["--missions", f"{__name__}:OneFault"], None, ["a subclass of MissionDistribution"]),
        (["--schedules", f"{__name__}:Broken"], None, ["ZeroDivisionError", "schedules"]),
        (["--schedules", "nowhere:Storm"], None, ["'nowhere:Storm'", "can be imported"]),
        (["--schedules", "nowhere.json"], None, ["schedules", "'nowhere.json'", "No such file"]),
        (["--schedule", "a.json", "--schedules", "b.json"], None, ["beside --schedule"]),
        (["--mission", "0.4", "--missions", "b.json"], None, ["beside --mission"]),
        (
            ["--split", "test", "--seed", str(10**9)],
            None,
            ["seed: got 1000000000", "0 to 999999999"],
        ),
        (["--mission", "0,4"], None, ["mission: got '0,4'", "a speed [m/s]"]),
        (["--split", "tset"], None, ["split", "did you mean 'test'"]),
        (["--vehicle", "nowhere.toml"], None, ["vehicle file", "'nowhere.toml'"]),
        (["--realism", "-1"], None, ["realism", "-1"]),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(tmp_path, capfd, arguments, content, words):
    if content is not None:
        arguments = [*arguments, json_file(tmp_path, content)]
    code = cli.main(["simulate", "--output", str(tmp_path / "run"), *arguments])
    message = capfd.readouterr().err
    assert code == 2 and "Traceback" not in message
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not (tmp_path / "run").exists()
