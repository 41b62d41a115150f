"""The speed benchmark: complete tables and JSON at tiny sizes. No speed is asserted; a busy machine
must not fail.
"""

import contextlib
import importlib.util
import io
import json
import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from auv_fault_env.errors import InputError
from training.studies import speed
from training.studies.speed import (
    COMPARISONS,
    Size,
    Speed,
    comparison_rows,
    main,
    page,
    report,
)
from training.studies.speed_runs import rate, rates_in_turn

TINY = Size(lanes=5, many=70, episode=3, seconds=0.0)
OWN = [name for name in COMPARISONS if not name.startswith("gem")]
FIND = importlib.util.find_spec


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("speed") / "run"
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(
            importlib.util,
            "find_spec",
            lambda name: None if name == "gym_electric_motor" else FIND(name),
        )
        report(Speed(repeats=1, output=folder, seed=3), TINY)
    return SimpleNamespace(
        printed=printed.getvalue(), **json.loads((folder / "results.json").read_text("utf-8"))
    )


def test_results_hold_comparison_profiles_machine_and_command(results):
    assert results.command.endswith("--seed 3") and results.seed == 3 and results.repeats == 1
    assert (
        results.machine["processor"]
        and results.machine["cores"] >= 1
        and results.machine["versions"]["numba"]
    )
    assert list(results.rates) == OWN
    assert [row["what"] for row in results.comparison] == [
        COMPARISONS[name].what.format(lanes=5, many=70) for name in OWN
    ]
    for row in results.comparison:
        assert row["rate"] > 0 and row["ratio"] > 0
        assert (row["met"] is None) == (not row["target"])
    for stage in (
        "write_commands",
        "run_controllers",
        "sample_normals",
        "prepare_step",
        "advance_motion",
        "write_true_values",
        "read_sensors",
        "write_outcomes",
        "copy_results",
    ):
        assert results.batch_profile[stage] > 0
    assert results.single_profile["kernel"] > 0 and results.single_profile["truth"] > 0
    assert all(
        map(math.isfinite, [*results.batch_profile.values(), *results.single_profile.values()])
    )


def test_tables_name_every_row_and_how_to_install_what_is_missing(results):
    assert 'pip install -e ".[bench]"' in results.printed
    for what in [row["what"] for row in results.comparison] + [
        *results.batch_profile,
        *results.single_profile,
    ]:
        assert what in results.printed
    assert "Batch of 5 lanes" in results.printed


def test_gym_electric_motor_is_measured_where_it_is_installed():
    pytest.importorskip("gym_electric_motor")
    rates = rates_in_turn(speed.gem_runs(seed=0), repeats=1, seconds=0.0, about="gem")
    assert list(rates) == [name for name in COMPARISONS if name.startswith("gem")]


def test_ratios_are_medians_of_the_ratios_within_each_repeat():
    rates = {"cartpole": [100.0, 200.0, 400.0], "single": [60.0, 20.0, 260.0]}
    cartpole, single = comparison_rows(rates, Size())
    assert (cartpole["rate"], cartpole["ratio"], cartpole["met"]) == (200.0, 1.0, None)
    assert (single["rate"], single["ratio"], single["met"]) == (60.0, 0.6, True)


@pytest.mark.parametrize(("many", "met"), [(100.0, True), (70.0, False)])
def test_a_missed_target_is_printed_as_missed(many, met):
    rates = {"cartpole": [100.0], "parallel": [100.0], "many": [many]}
    row = comparison_rows(rates, Size())[-1]
    assert row["met"] is met and row["what"] == "Propulsion-v0, 65536 lanes"
    rates_section = page(results_with([row]))["sections"][0]
    assert rates_section["table"]["rows"][0][-1] == ("met" if met else "missed")


def test_a_run_is_measured_at_least_once():
    assert rate(lambda: 7, seconds=0.0) > 0


def results_with(comparison):
    profile = {"move": 3.0, "publish": 1.0}
    return {
        "command": "c",
        "machine": {"processor": "cpu", "cores": 2, "versions": {"python": "3"}},
        "size": {"lanes": 64},
        "comparison": comparison,
        "batch_profile": profile,
        "single_profile": profile,
    }


def test_shares_of_a_profile_add_up():
    row = {"what": "Propulsion-v0, single", "rate": 2.0, "ratio": 1.0, "to": "", "target": ""}
    _, batch, single = page(results_with([row | {"met": None}]))["sections"]
    for section in (batch, single):
        assert [row[-1] for row in section["table"]["rows"]] == ["75.0 %", "25.0 %", "100.0 %"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [({"repeats": 0}, "repeats"), ({"output": Path("pyproject.toml/speed")}, "pyproject.toml")],
)
def test_bad_input_is_refused_in_one_line_before_anything_is_measured(
    arguments, named, monkeypatch, request
):
    monkeypatch.chdir(request.config.rootpath)
    monkeypatch.setattr(speed, "measure", None)
    with pytest.raises(InputError) as refused:
        main(Speed(**arguments))
    assert named in str(refused.value) and "\n" not in str(refused.value)
