import json
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import INDEX
from auv_fault_env.errors import refusal
from training import cli
from training.commands import calibrate
from training.field.vehicle_file import Column, read_vehicle, write_vehicle

from ..field.fleet_logs import VEHICLE, write_log
from ..field.healthy_missions import OFF, healthy_logs, kept


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    write_vehicle(folder / "vehicle.toml", VEHICLE)
    for k, log in enumerate(healthy_logs(n=3, n_samples=900)):
        write_log(folder / f"{k}.csv", log.observation)
    return [folder / "vehicle.toml", *(folder / f"{k}.csv" for k in range(3))]


def run(tmp_path, vehicle, *logs):
    code = cli.main(
        ["calibrate", "--vehicle", str(vehicle), "--output", str(tmp_path / "out"), *map(str, logs)]
    )
    return code, tmp_path / "out"


@pytest.fixture(scope="module")
def finished(paths, tmp_path_factory):
    code, folder = run(tmp_path_factory.mktemp("run"), *paths)
    assert code == 0
    return folder


def test_vehicle_file_holds_the_fit_and_says_so(finished):
    results = json.loads((finished / "results.json").read_text())
    file = read_vehicle(finished / "vehicle.toml")
    for name in ("alpha", "beta", "resistance", "torque_constant", "coulomb_friction"):
        row = results["estimates"][name]
        assert getattr(file.vehicle, name) == row["value"] != row["before"]
        assert row["low"] < row["value"] < row["high"]
        assert getattr(file.vehicle, name) == pytest.approx(getattr(OFF, name), rel=0.15)
    assert dict(file.columns) == dict(VEHICLE.columns)
    assert file.noise == results["noise"] and file.band == results["band"]
    text = (finished / "vehicle.toml").read_text()
    assert text.count("fitted, 95 % interval") == 9  # with c1, c2 and the disturbance's two


def test_the_last_line_says_how_well_the_vehicle_is_known(paths, tmp_path, capfd):
    code, folder = run(tmp_path, *paths)
    last = capfd.readouterr().out.strip().split("\n")[-1]
    quality = json.loads((folder / "results.json").read_text())["fit_quality"]
    assert code == 0 and last.startswith(f"fit: {quality['level']}: ")
    assert last.endswith(f"diagnose uses {quality['diagnoser']}")
    assert last in (folder / "vehicle.toml").read_text()
    assert f"diagnose uses {quality['diagnoser']}" in (folder / "index.html").read_text()
    assert read_vehicle(folder / "vehicle.toml").diagnoser == quality["diagnoser"]


def test_page_has_fits_residuals_and_what_is_not_known(finished):
    text = (finished / "index.html").read_text()
    for heading in (
        "Fitted parameters",
        "Not identified",
        "Leaving one mission out",
        "Fit",
        "Port against starboard",
    ):
        assert f">{heading}</h2>" in text
    assert "rudder and planes do not move" in text
    assert {path.stem for path in (finished / "figures").iterdir()} == {"fit", "missions"}
    assert (finished / "manifest.json").exists()


def test_leave_one_out_is_printed_for_every_mission(paths, tmp_path, capfd):
    run(tmp_path, *paths)
    out = capfd.readouterr().out
    assert all(f"{k}.csv" in out for k in range(3))
    for word in ("Leaving one mission out", "alpha", "Not identified", "gamma", "vehicle.toml"):
        assert word in out


def test_single_mission_is_calibrated_without_a_check(paths, tmp_path, capfd):
    code, folder = run(tmp_path, *paths[:2])
    assert code == 0
    results = json.loads((folder / "results.json").read_text())
    assert results["leave_one_out"] == [] and results["fit_quality"]["time_in_alarm"] is None
    page = (folder / "index.html").read_text()
    assert "one mission only" in page and "How much the missions differ" not in page
    printed = capfd.readouterr().out
    assert "Leaving one mission out" not in printed and "of the healthy time" not in printed
    assert "one log cannot show how far healthy missions differ" in printed.split("\n")[-2]


def test_poor_log_is_calibrated_as_far_as_it_goes(paths, tmp_path):
    """Speed alone: nothing is fitted, the file stays as it is but for the noise."""
    poor = kept(healthy_logs(n=1), ("speed",))[0].observation
    np.nan_to_num(poor, copy=False)
    lines = [
        "time,v",
        *(f"{0.1 * k:.1f},{row[INDEX['speed']]}" for k, row in enumerate(poor)),
    ]
    (tmp_path / "poor.csv").write_text("\n".join(lines))
    (tmp_path / "poor.toml").write_text(
        '[vehicle]\nsample_rate = 10.0\n[time]\ncolumn = "time"\n[channels.speed]\ncolumn = "v"\n'
    )
    code, folder = run(tmp_path, tmp_path / "poor.toml", tmp_path / "poor.csv")
    assert code == 0
    file = read_vehicle(folder / "vehicle.toml")
    assert file.vehicle == read_vehicle(tmp_path / "poor.toml").vehicle
    assert file.noise["speed"] == pytest.approx(0.01, rel=0.15)
    assert "no relations" in file.poor_fit or "filter bank" in file.poor_fit


def test_a_good_fit_is_no_warning(paths, tmp_path):
    _, folder = run(tmp_path, *paths)
    assert read_vehicle(folder / "vehicle.toml").poor_fit == ""
    assert "poor_fit" not in (folder / "vehicle.toml").read_text()


@pytest.mark.parametrize(
    ("logs", "words"),
    [
        ((), ["logs", "at least one healthy log"]),
        (("nowhere.csv",), ["nowhere.csv"]),
    ],
    ids=["no log", "missing log"],
)
def test_bad_input_ends_with_two_one_line_and_nothing_written(paths, tmp_path, capfd, logs, words):
    code, folder = run(tmp_path, paths[0], *logs)
    message = capfd.readouterr().err.replace("\r", "\n").strip().split("\n")[-1]
    assert code == 2
    for word in words:
        assert word in message
    assert not folder.exists()


def test_a_log_given_twice_is_refused(paths, tmp_path, capfd):
    code, folder = run(tmp_path, paths[0], paths[1], paths[1])
    assert code == 2 and "each log once" in capfd.readouterr().err and not folder.exists()


def test_a_log_that_is_a_link_to_itself_is_refused(paths, tmp_path, capfd):
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    code, folder = run(tmp_path, paths[0], tmp_path / "loop.csv")
    assert code == 2 and "symbolic links" in capfd.readouterr().err and not folder.exists()


def test_likely_mistakes_are_warnings_lines_and_a_section(paths, tmp_path, capfd):
    vehicle = replace(VEHICLE, columns=VEHICLE.columns | {"port_rpm": Column("port_rpm", 1 / 60)})
    write_vehicle(tmp_path / "vehicle.toml", vehicle)
    code, folder = run(tmp_path, tmp_path / "vehicle.toml", *paths[1:])
    output = capfd.readouterr()
    assert code == 0
    assert "auv-fault calibrate: warning: port_rpm: " in output.err
    assert "multiply scale by 60 in [channels.port_rpm]" in output.err
    assert "fit: poor: likely mistakes: port_rpm; " in output.out
    (mistake,) = json.loads((folder / "results.json").read_text())["mistakes"]
    assert mistake["channels"] == ["port_rpm"] and mistake["remedy"] in output.err
    assert ">Likely mistakes</h2>" in (folder / "index.html").read_text()


def test_a_fit_that_fails_after_a_warning_names_the_warning(paths, tmp_path, capfd, monkeypatch):
    def failing(samples, vehicle):
        raise refusal("inertia", 1e-5, "from 0.000139", "raise it")

    monkeypatch.setattr(calibrate, "calibrate_samples", failing)
    vehicle = replace(VEHICLE, columns=VEHICLE.columns | {"port_rpm": Column("port_rpm", 1 / 60)})
    write_vehicle(tmp_path / "vehicle.toml", vehicle)
    code, folder = run(tmp_path, tmp_path / "vehicle.toml", *paths[1:])
    assert code == 2 and not folder.exists()
    error = capfd.readouterr().err.splitlines()[-1]
    assert "the fit fails (inertia: got 1e-05; " in error
    assert error.endswith("; settle the warnings on port_rpm first")


def test_a_mistake_that_leaves_no_meaning_is_refused(paths, tmp_path, capfd):
    vehicle = replace(VEHICLE, columns=VEHICLE.columns | {"speed": Column("speed", -1.0)})
    write_vehicle(tmp_path / "vehicle.toml", vehicle)
    code, folder = run(tmp_path, tmp_path / "vehicle.toml", *paths[1:])
    assert code == 2 and not folder.exists()
    assert "auv-fault calibrate: speed: negative" in capfd.readouterr().err


def test_a_right_file_has_no_mistake(finished):
    results = json.loads((finished / "results.json").read_text())
    assert results["mistakes"] == []
    assert "Likely mistakes" not in (finished / "index.html").read_text()
