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
    assert len(vehicle.columns) == 10  # rudder and stern plane are constant
    for channel in vehicle.columns:
        assert f"{channel}: " in printed
    read = read_log(log, vehicle)
    assert read.segments == (slice(0, 300),)
    columns = np.genfromtxt(log, delimiter=",", names=True, dtype=None, encoding="utf-8")
    np.testing.assert_allclose(read.observation[:, 4], columns["speed"])


HEADER = "t,u_mps,motor_current,motor_current_limit,n,foo"


def test_every_column_is_printed_and_the_file_reads_its_log(tmp_path, capsys):
    rows = [f"{k / 5},{k % 7},{k % 5 + 0.1},20,{300 + k % 9},{k % 3}" for k in range(100)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([HEADER, *rows]))
    output = tmp_path / "vehicle.toml"
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 0
    printed = capsys.readouterr().out
    for column in HEADER.split(","):
        assert f"'{column}'" in printed
    assert "left out   'motor_current_limit': 'limit' names a limit" in printed
    assert "unknown    'foo'" in printed
    assert "tried      the file reads this log: 19.8 s at 5 rows a second" in printed
    assert "# [channels.port_voltage]" in output.read_text()


def assert_not_read(printed, output, why):
    """The file is written, and one line of error says what is to be done."""
    assert f"{output}: " in printed.out and "check the file before you use it" in printed.out
    assert "tried" not in printed.out
    start = f"auv-fault vehicle: {output} is written but does not read the log: {why}"
    assert printed.err.startswith(start) and printed.err.count("\n") == 1
    assert printed.err.endswith("; complete the file by hand, see docs/vehicle.md\n")


def test_file_without_a_channel_is_written_to_be_filled_in(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["t,depth", *(f"{k / 10},{k % 7}" for k in range(200))]))
    output = tmp_path / "vehicle.toml"
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 2
    assert_not_read(capsys.readouterr(), output, "no column is a reading")
    text = output.read_text()
    assert "\n[channels" not in text
    assert text.count("# [channels.") == 9


def test_no_rate_is_stated_where_the_time_cannot_be_read(tmp_path, capsys):
    log = tmp_path / "log.csv"
    rows = [f"tick {k},{k % 7},{k % 5 + 0.1}" for k in range(200)]
    log.write_text("\n".join(["Time,u_mps,motor_current", *rows]))
    output = tmp_path / "vehicle.toml"
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 2
    assert_not_read(capsys.readouterr(), output, "'Time' cannot be read as a time")
    assert "sample_rate = 10.0  # Hz; the rate is not known" in output.read_text()


def test_log_that_cannot_be_read_with_the_file_is_printed(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["t,u", *(f"{k / 10},{k % 7}" for k in range(20))]))
    output = tmp_path / "vehicle.toml"
    assert cli.main(["vehicle", "init", str(log), "--output", str(output)]) == 2
    assert_not_read(capsys.readouterr(), output, "log: got")


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
