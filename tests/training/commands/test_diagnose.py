import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from auv_fault_env.channels import INDEX
from auv_fault_env.errors import InputError
from training.arguments import Diagnose
from training.commands import diagnose
from training.field.vehicle_file import Column, write_vehicle

from ..field.calibration.test_relation_fit import FILE, logs_of, model
from ..field.calibration.test_sensitivity import LOST
from ..field.fleet_logs import VEHICLE, episode, write_log

FAULT = "seal_friction:port"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A vehicle file, a healthy and a faulty log, and one that is none."""
    folder = tmp_path_factory.mktemp("vehicle")
    write_vehicle(folder / "v.toml", VEHICLE)
    write_log(folder / "healthy.csv", episode())
    write_log(folder / "faulty.csv", episode(FAULT))
    (folder / "broken.csv").write_bytes(b"\x00\x01\x02 no log at all")
    return folder


def run(folder: Path, output: Path, *logs: str, **settings) -> int:
    paths = tuple(folder / f"{log}.csv" for log in logs)
    return diagnose.main(Diagnose(vehicle=folder / "v.toml", logs=paths, output=output, **settings))


@pytest.fixture(scope="module")
def all_three(folder, tmp_path_factory):
    output = tmp_path_factory.mktemp("runs") / "diagnose"
    return run(folder, output, "healthy", "faulty", "broken"), output


def test_the_worst_verdict_is_the_exit_code(folder, tmp_path, all_three, capsys):
    assert all_three[0] == 3
    assert run(folder, tmp_path / "one", "healthy") == 0
    assert run(folder, tmp_path / "two", "healthy", "broken") == 2
    assert "broken.csv" in capsys.readouterr().out


def test_a_poor_fit_is_a_warning_and_stands_in_the_report(folder, tmp_path, capsys):
    assert run(folder, tmp_path / "good", "healthy") == 0
    assert "warning" not in capsys.readouterr().err
    write_vehicle(tmp_path / "v.toml", replace(VEHICLE, poor_fit="no relations without speed"))
    settings = Diagnose(
        vehicle=tmp_path / "v.toml", logs=(folder / "healthy.csv",), output=tmp_path / "poor"
    )
    assert diagnose.main(settings) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert line.endswith("alarms on healthy logs are likely: no relations without speed")
    assert "Do not trust a verdict" in (tmp_path / "poor" / "index.html").read_text()


def test_the_results_name_verdict_time_class_side_severity_and_load(all_three):
    results = json.loads((all_three[1] / "results.json").read_text())
    healthy, faulty, broken = results["verdicts"]
    assert [one["verdict"] for one in (healthy, faulty, broken)] == ["healthy", "fault", "unusable"]
    assert (faulty["fault"], faulty["side"]) == (FAULT, "port")
    assert faulty["severity_low"] <= 0.9 <= faulty["severity_high"]
    assert 5.0 < faulty["alarms"][0][0] < 10.0 and faulty["load"]["port"] > 0.1
    assert len(faulty["top"]) == 3 and not healthy["top"] and broken["remarks"]
    (cause,) = faulty["raised_by"]
    assert [cause["begin"], cause["end"]] == faulty["alarms"][0]
    assert (cause["rule"], cause["fault"]) == ("probability", FAULT)


def test_the_csv_has_a_row_for_each_log(all_three):
    with (all_three[1] / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == ["healthy", "fault", "unusable"]
    assert rows[1]["fault"] == FAULT and float(rows[1]["alarm_time"]) > 5.0
    assert rows[1]["raised_by"] == "probability"
    assert rows[0]["alarm_time"] == rows[0]["severity"] == rows[0]["raised_by"] == ""


def test_the_page_shows_signals_estimates_belief_and_alarms(all_three):
    text = (all_three[1] / "index.html").read_text()
    assert text.count("data:image/svg+xml;base64,") == 2
    for words in (
        "seal_friction:port",
        "unusable",
        "faulty.csv, 20 s: fault, seal_friction:port from",
    ):
        assert words in text
    results = json.loads((all_three[1] / "results.json").read_text())
    panels = details(results)["figures"][0]["data"]["panels"]
    assert list(panels)[-3:] == ["estimate", "p(normal)", "probability"]
    assert (
        set(panels["estimate"]) == {"drag", "thrust"} and "port, healthy" in panels["current [A]"]
    )


def details(results):
    return next(one for one in results["sections"] if one["heading"] == "Logs in detail")


def test_no_fault_is_listed_for_a_log_without_an_alarm(all_three):
    results = json.loads((all_three[1] / "results.json").read_text())
    healthy = details(results)["figures"][1]
    assert "healthy.csv" in healthy["caption"]
    assert "probability" not in healthy["data"]["panels"]
    (row, *_) = results["sections"][0]["table"]["rows"]
    assert [cell for cell in row if cell] == ["healthy.csv", "healthy"]


def test_the_verdicts_are_printed(folder, tmp_path, capsys):
    run(folder, tmp_path / "out", "faulty")
    printed = capsys.readouterr().out
    assert "faulty.csv" in printed and FAULT in printed and "port +" in printed


def test_healthy_logs_lower_the_threshold_as_far_as_they_come(folder, tmp_path):
    """A log said to be healthy raises no alarm, nor does one that is no worse."""
    write_log(folder / "slight.csv", episode("propeller_damage:port", 0.4))
    assert run(folder, tmp_path / "out", "slight") == 3
    assert run(folder, tmp_path / "out", "slight", healthy=(folder / "slight.csv",)) == 0
    assert run(folder, tmp_path / "out", "faulty", healthy=(folder / "healthy.csv",)) == 3


def test_a_healthy_log_that_the_model_excludes_is_refused(folder, tmp_path):
    """A threshold as low as that would let most faults pass."""
    unlike = episode().copy()
    unlike[:, [INDEX["port_voltage"], INDEX["starboard_voltage"]]] *= 2.0
    write_log(folder / "unlike.csv", unlike)
    with pytest.raises(InputError) as error:
        run(folder, tmp_path / "out", "faulty", healthy=(folder / "unlike.csv",))
    for words in ("healthy log unlike.csv", "log p(normal) of -", "leave the log out of --healthy"):
        assert words in str(error.value)
    assert "residuals" not in str(error.value)  # the vehicle has no relations


@pytest.fixture(scope="module")
def related(tmp_path_factory):
    """A vehicle file that chooses residuals, and a healthy and a faulty log of the vehicle."""
    folder = tmp_path_factory.mktemp("related")
    file = replace(FILE, time=Column("time"), relations=model(), diagnoser="residuals")
    write_vehicle(folder / "v.toml", file)
    for name, events in (("healthy", ()), ("lost", (LOST,))):
        log, *_ = logs_of(1, *events, first=700)
        write_log(folder / f"{name}.csv", log.observation)
    return folder


def test_the_vehicle_file_chooses_the_diagnoser_and_the_option_overrides_it(
    related, tmp_path, capsys
):
    assert run(related, tmp_path / "chosen", "lost") == 3
    printed = capsys.readouterr().out
    assert "residuals finds lasting changes from: drag " in printed
    results = json.loads((tmp_path / "chosen" / "results.json").read_text())
    assert "--diagnoser residuals" in results["command"]
    assert "as the vehicle file says" in results["summary"][0]
    (verdict,) = results["verdicts"]
    assert [[one["begin"], one["end"]] for one in verdict["raised_by"]] == verdict["alarms"]
    last = verdict["raised_by"][-1]
    assert abs(last["value"]) > last["limit"]
    assert set(verdict["indicators"]["drag"]) == {"value", "std", "limit"}
    run(related, tmp_path / "limits", "healthy", diagnoser="limits")
    assert "--diagnoser limits" in (tmp_path / "limits" / "results.json").read_text()
    assert "lasting changes" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("channels", "factor", "place"),
    [
        (("speed",), 3600 / 1852, r"unit of speed in other\.csv: got 'm/s'; allowed is kn, "),
        (
            ("port_rpm",),
            np.pi / 30,
            r"unit of port_rpm in other\.csv: got 'rpm'; allowed is rad/s, ",
        ),
        (
            ("port_rpm", "starboard_rpm"),
            np.pi / 30,
            r"unit of port_rpm in other\.csv: got 'rpm'; allowed is rad/s, ",
        ),
    ],
    ids=["knots", "rad/s", "rad/s of both"],
)
def test_a_log_that_is_surely_in_another_unit_gets_no_verdict(
    related, tmp_path, channels, factor, place
):
    other = np.genfromtxt(related / "healthy.csv", delimiter=",", skip_header=1)[:, 1:]
    other[:, [INDEX[name] for name in channels]] *= factor
    write_log(tmp_path / "other.csv", other)
    settings = Diagnose(
        vehicle=related / "v.toml", logs=(tmp_path / "other.csv",), output=tmp_path / "out"
    )
    with pytest.raises(InputError, match=place + "with which .*; write unit = "):
        diagnose.main(settings)
    with pytest.raises(InputError, match=place):
        healthy = (tmp_path / "other.csv",)
        run(related, tmp_path / "out", "healthy", healthy=healthy)
    # beside a log that can be used it is one that cannot
    logs = (related / "healthy.csv", tmp_path / "other.csv")
    assert diagnose.main(replace(settings, logs=logs)) == 2


def test_a_speed_that_goes_wrong_by_the_factor_of_a_unit_is_a_fault(related, tmp_path):
    broken = np.genfromtxt(related / "healthy.csv", delimiter=",", skip_header=1)[:, 1:]
    broken[1200:, INDEX["speed"]] *= 1852 / 3600
    write_log(tmp_path / "broken.csv", broken)
    settings = Diagnose(
        vehicle=related / "v.toml", logs=(tmp_path / "broken.csv",), output=tmp_path / "out"
    )
    assert diagnose.main(settings) == 3


def test_a_stream_has_the_diagnoser_of_the_vehicle_file(related, monkeypatch, capsys):
    lost = (related / "lost.csv").read_bytes()
    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(lost)))
    assert run(related, Path("nowhere"), follow=True) == 3
    captured = capsys.readouterr()
    assert "residuals finds lasting changes from: drag " in captured.err
    answers = [json.loads(line) for line in captured.out.splitlines()]
    for answer in answers:
        assert (answer["raised_by"] is not None) == answer["alarm"]
        # it estimates none
        assert answer["severity"] is None and answer["severity_95"] is None
    assert "(limit " in answers[-1]["raised_by"]


def test_a_healthy_log_that_blinds_the_residuals_is_refused(related, tmp_path):
    with pytest.raises(InputError, match=r"healthy log lost\.csv: .* leave the log out"):
        run(related, tmp_path / "out", "healthy", healthy=(related / "lost.csv",))
    assert not list(tmp_path.iterdir())


def test_where_the_bank_refuses_a_healthy_log_residuals_are_the_remedy(related, tmp_path):
    with pytest.raises(InputError, match="add --diagnoser residuals"):
        settings = {"diagnoser": "filter_bank", "healthy": (related / "lost.csv",)}
        run(related, tmp_path / "out", "healthy", **settings)


@pytest.mark.parametrize(
    ("logs", "settings", "words"),
    [
        (("broken",), {}, "broken.csv"),
        ((), {}, "at least one log"),
        (("nowhere", "broken"), {}, "nowhere.csv"),
        (("healthy",), {"diagnoser": "filterbank"}, "did you mean 'filter_bank'"),
        (("healthy",), {"healthy": (Path("nowhere.csv"),)}, "nowhere.csv"),
        (("healthy",), {"follow": True}, "healthy.csv'; allowed is none with --follow"),
    ],
    ids=["no log", "none", "none usable", "diagnoser", "healthy", "log and stream"],
)
def test_bad_input_is_refused_in_one_line_and_nothing_is_written(
    folder, tmp_path, logs, settings, words
):
    with pytest.raises(InputError) as error:
        run(folder, tmp_path / "out", *logs, **settings)
    assert words in str(error.value) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())
