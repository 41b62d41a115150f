import json
import re

import numpy as np
import pytest
from tqdm import tqdm

from auv_fault_env.parameters import FOOT, PRESETS
from training import cli
from training.report.page import print_tables
from training.thesis import kalman_networks, raw_networks, recommendation_page
from training.thesis.comparison import COLUMNS
from training.thesis.runs import STEPS, TEST_RUNS, record

ALPHA = 0
BETA = 1
NO_BAR = tqdm(disable=True)


@pytest.fixture(scope="module")
def clean():
    return record(0.0, [0], NO_BAR)


@pytest.fixture(scope="module")
def noisy():
    return record(1.0, list(range(20)), NO_BAR)


def estimate(recording, run, parameter, seconds):
    return recording.mean[round(10 * seconds), list(TEST_RUNS).index(run), :, parameter]


def test_the_thesis_values_are_those_of_the_preset():
    vehicle = PRESETS["thesis1992"]
    assert 1.35 * vehicle.alpha * FOOT == pytest.approx(-0.0333, abs=1e-12)
    assert 0.65 * vehicle.beta / FOOT == pytest.approx(2.1906e-7, rel=1e-12)


@pytest.mark.parametrize(
    ("run", "parameter", "true", "limit"),
    [("drag", ALPHA, 1.35, 0.003), ("thrust", BETA, 0.65, 0.002)],
)
def test_noise_free_the_changed_parameter_is_found_as_closely_as_in_the_thesis(
    clean, run, parameter, true, limit
):
    for end in (50.0, 60.0):
        assert estimate(clean, run, parameter, end) == pytest.approx(true, rel=limit)
    after_two_changes = clean.mean[300:, list(TEST_RUNS).index(run), 0, parameter]
    assert np.abs(after_two_changes / true - 1).max() < 0.02


def test_before_the_fault_the_estimate_is_nominal(clean):
    assert np.abs(clean.mean[:101, :4] - 1).max() < 1e-3


def test_one_propeller_lost_halves_beta(clean):
    assert estimate(clean, "loss", BETA, 60.0) == pytest.approx(0.5, rel=0.01)


def test_drag_moves_beta_until_the_speed_changes_and_then_lets_it_return(clean):
    beta = clean.mean[:, list(TEST_RUNS).index("drag"), 0, BETA]
    assert beta[100:200].min() < 0.9
    assert beta[-1] == pytest.approx(1.0, rel=0.005)


def test_with_noise_the_scatter_is_what_the_filter_expects_of_a_healthy_vehicle(noisy):
    row = list(TEST_RUNS).index("normal")
    end = -1
    scatter = noisy.mean[end, row].std(axis=0)
    expected = noisy.std[end, row].mean(axis=0)
    assert np.all(scatter[:2] < 1.5 * expected[:2])
    assert np.all(scatter[:2] > expected[:2] / 3)


def test_mean_innovation_of_a_healthy_vehicle_is_one(noisy):
    assert noisy.nis[50:, list(TEST_RUNS).index("normal")].mean() == pytest.approx(1.0, abs=0.05)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The whole command with few seeds and networks, a hundredth of the training and a small
    comparison.
    """
    folder = tmp_path_factory.mktemp("reproduce") / "report"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(raw_networks, "CHECKPOINTS", (240, 600, 900, 1_500))
        patch.setattr(kalman_networks, "CHECKPOINTS", (1_000, 2_000))
        patch.setattr(recommendation_page, "LANES", 8)
        patch.setattr(recommendation_page, "HOURS", 0.05)
        assert (
            cli.main(["reproduce", "--output", str(folder), "--seeds", "2", "--networks", "2"]) == 0
        )
    return folder


def test_command_writes_a_self_contained_report(report, capsys):
    page = (report / "index.html").read_text()
    results = json.loads((report / "results.json").read_text())
    figures = [
        figure["name"] for section in results["sections"] for figure in section.get("figures", ())
    ]
    for name in figures:
        assert (report / "figures" / f"{name}.png").stat().st_size > 10_000
    assert page.count("data:image/svg+xml;base64,") == len(figures) == len(set(figures)) >= 15
    assert "http" not in page.replace("http://www.w3.org", "")
    for number in ("-0.0332 1/ft", "2.1945e-07", "-50 %", "8.5", "5.81"):
        assert number in page
    assert (report / "results.json").stat().st_size < 10e6
    assert page.count("auv-fault reproduce --seed 0 --seeds 2 --networks 2") == 1
    assert re.search(r"\d+ agree without noise, \d+ agree in part, \d+ differ", page)
    manifest = json.loads((report / "manifest.json").read_text())
    assert manifest["arguments"]["seeds"] == manifest["arguments"]["networks"] == 2
    print_tables(results["sections"])
    assert "IV.C" in capsys.readouterr().out


@pytest.mark.parametrize(
    "place",
    [
        f"Fig. {number}"
        for number in "4.1 4.2 5.1 5.7 5.8 5.9 5.10 5.12 5.14 5.15 5.16 5.17 5.19 5.20".split()
    ]
    + ["V.C.1", "V.D.1", "VI.A", "VI.B"],
)
def test_every_result_of_the_thesis_has_its_row(report, place):
    sections = json.loads((report / "results.json").read_text())["sections"]
    rows = [
        row
        for part in sections
        if part.get("table", {}).get("columns") == COLUMNS
        for row in part["table"]["rows"]
    ]
    found = [row for row in rows if re.search(rf"{re.escape(place)}(?!\d)", row[0])]
    assert found
    for row in found:
        assert row[COLUMNS.index("verdict (noise-free)")] in (
            "agrees",
            "agrees in part",
            "differs",
            "not judged",
            "-",
        )


@pytest.mark.parametrize("table", ["Table 5.1", "Table 5.2"])
def test_tables_of_operating_modes_are_there(report, table):
    sections = json.loads((report / "results.json").read_text())["sections"]
    (section,) = [section for section in sections if section["heading"].startswith(table)]
    assert section["table"]["rows"][0][0] == "normal"


def test_too_few_networks_show_no_spread(tmp_path, capsys):
    assert cli.main(["reproduce", "--output", str(tmp_path / "report"), "--networks", "1"]) == 2
    assert "networks: got 1" in capsys.readouterr().err


def test_recordings_hold_the_whole_run(clean):
    assert clean.readings.shape == (STEPS + 1, len(TEST_RUNS), 1, 12)
    assert np.isfinite(clean.mean).all()
