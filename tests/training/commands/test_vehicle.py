import json

import numpy as np

from training import cli
from training.field.logs.log import read_log
from training.field.vehicle_file import read_vehicle


def simulated(tmp_path):
    output = tmp_path / "simulated"
    (tmp_path / "healthy.json").write_text(json.dumps([]))
    arguments = [
        "--vehicles",
        "1",
        "--duration",
        "30",
        "--schedule",
        str(tmp_path / "healthy.json"),
        "--formats",
        "csv",
    ]
    assert cli.main(["simulate", "--output", str(output), *arguments]) == 0
    return output / "episodes.csv"


def test_proposal_reads_the_log_it_was_made_from(tmp_path, capsys):
    log = simulated(tmp_path)
    output = tmp_path / "vehicle.toml"
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 0
    printed = capsys.readouterr().out
    vehicle = read_vehicle(output)
    assert len(vehicle.columns) == 12
    for channel in vehicle.columns:
        assert f"{channel}: " in printed
    read = read_log(log, vehicle)
    assert read.segments == (slice(0, 300),)
    columns = np.genfromtxt(log, delimiter=",", names=True, dtype=None, encoding="utf-8")
    np.testing.assert_allclose(read.observation[:, 4], columns["speed"])


def test_existing_file_is_kept(tmp_path, capfd):
    output = tmp_path / "vehicle.toml"
    output.write_text("mine")
    log = tmp_path / "log.csv"
    log.write_text("t,u\n0,1\n0.1,2\n")
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 2
    assert "allowed is a new file; choose another --output" in capfd.readouterr().err
    assert output.read_text() == "mine"


def test_unusable_log_leaves_nothing(tmp_path, capfd):
    assert (
        cli.main(
            ["vehicle", "init", str(tmp_path / "none.csv"), "--output", str(tmp_path / "v.toml")]
        )
        == 2
    )
    assert capfd.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())
