import math
from dataclasses import replace

import pytest

from diagnosers.residuals import Residuals
from training.field.diagnosis.causes import Cause
from training.field.diagnosis.diagnosis import FAULT, HEALTHY, THRESHOLDS, UNUSABLE, Verdict
from training.field.diagnosis.page import REPAIRS, Setting, page
from training.report.page import PRINTED_WIDTH, print_tables

from ..fleet_logs import VEHICLE

FOLDER = "/data/vehicles/of/the/institute/2026/autumn/campaign/missions"
BANK = Setting("", "filter_bank", "as the vehicle file says", THRESHOLDS["filter_bank"], VEHICLE)
RESIDUALS = BANK._replace(diagnoser="residuals", threshold=math.log(0.5))
RELATED = RESIDUALS._replace(vehicle=replace(VEHICLE, relations=Residuals().model))
LOAD = Cause(5.0, 9.0, "starboard load", "propeller_damage:starboard", -0.23, 0.1)
FAULTY = Verdict(
    f"{FOLDER}/late.csv",
    FAULT,
    duration=10.0,
    alarms=((5.0, 9.0),),
    fault=LOAD.fault,
    side="starboard",
    top=((LOAD.fault, 0.9), ("unknown", 1e-5)),
    raised_by=(LOAD,),
    indicators={"starboard load": {"value": -0.24, "std": 0.02, "limit": 0.1}},
)


def fleet(n=10):
    remark = "port_voltage: values beyond 30 V, up to {} to the end of the mission, kept ({})"
    healthy = [
        Verdict(
            f"{FOLDER}/mission-{k:02d}.csv", HEALTHY, 900.0, remarks=(remark.format(31 + k, k),)
        )
        for k in range(n - 2)
    ]
    unusable = Verdict(f"{FOLDER}/none.csv", UNUSABLE, remarks=("no log at all",))
    return [*healthy, FAULTY, unusable]


def table(results, heading):
    return next(one["table"] for one in results["sections"] if one["heading"] == heading)


def test_the_summary_counts_the_logs_and_names_the_faults():
    counts, fault, healthy = page(RESIDUALS, fleet(), [])["summary"]
    assert counts.startswith("10 logs, 120.2 minutes in all, diagnosed by `residuals`, ")
    assert counts.endswith(": 1 with a fault, 8 healthy, 1 unusable.")
    assert fault == "late.csv: `propeller_damage:starboard` from 5.0 s on."
    assert healthy.startswith("Healthy means that no alarm was raised")


def test_a_summary_of_many_faults_stays_short():
    summary = page(BANK, [replace(FAULTY, log=f"{k}.csv") for k in range(9)], [])["summary"]
    assert len(summary) == 4 and "other logs with a fault" in summary[-1]


def test_the_verdicts_say_what_raised_the_alarm():
    verdicts = table(page(RESIDUALS, fleet(), []), "Verdicts")
    row = dict(zip(verdicts["columns"], verdicts["rows"][-2], strict=True))
    assert row["log"] == "late.csv"
    assert row["raised by"] == "starboard load -23 % (limit ±10 %)"
    assert "severity (95 %)" not in row and "load of the shaft" not in row
    assert not any("propeller" in cell for cells in verdicts["rows"][:-2] for cell in cells)


def test_another_diagnoser_shows_the_indicators_beyond_their_limits():
    improbable = Cause(5.0, 9.0, "probability", LOAD.fault)
    verdicts = table(page(BANK, [replace(FAULTY, raised_by=(improbable,))], []), "Verdicts")
    row = dict(zip(verdicts["columns"], verdicts["rows"][0], strict=True))
    assert row["raised by"] == "probability"
    assert row["beyond its limit"] == "starboard load -24 %"


def test_the_last_alarm_has_value_std_and_limit_of_each_indicator():
    last = table(page(RESIDUALS, fleet(), []), "In the last alarm")
    assert last["columns"] == ["log", "starboard load", "most probable faults"]
    assert last["rows"] == [
        ["late.csv", "-24 ± 2 % (±10 %)", "propeller_damage:starboard 0.9"],
    ]


def test_a_fleet_without_an_alarm_has_no_table_of_alarms():
    headings = [one["heading"] for one in page(RESIDUALS, fleet()[:3], [])["sections"]]
    assert headings == ["Verdicts", "Logs in detail", "Repairs"]


def test_a_remark_on_many_logs_is_one_row():
    rows = table(page(RESIDUALS, fleet(), []), REPAIRS)["rows"]
    assert rows == [
        [
            "port_voltage: values beyond 30 V, up to 31 to 38 to the end of the mission, "
            "kept (0 to 7)",
            "8 logs: mission-00.csv, mission-01.csv, mission-02.csv, …",
        ],
        ["no log at all", "none.csv"],
    ]


@pytest.mark.parametrize("one_setting", [BANK, RESIDUALS])
def test_ten_logs_fit_a_terminal(one_setting, capsys):
    print_tables(page(one_setting, fleet(), [])["sections"], whole=True)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= PRINTED_WIDTH
    assert sum("mission-0" in line and "healthy" in line for line in lines) == 8


def test_a_wide_table_is_wrapped_and_loses_nothing(capsys):
    words = [f"word{k}" for k in range(60)]
    wide = {"heading": "Wide", "table": {"columns": ["a", "b"], "rows": [["x", " ".join(words)]]}}
    print_tables([wide])
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= PRINTED_WIDTH
    assert [word for word in printed.split() if word.startswith("word")] == words


@pytest.mark.parametrize(
    ("one_setting", "words"),
    [
        (
            BANK,
            f"below {math.exp(THRESHOLDS['filter_bank']):.2g} for three readings in a row, "
            "at which simulated healthy vehicles",
        ),
        (BANK._replace(threshold=-9.0), "below 0.00012 for three readings in a row, the lowest on"),
        (BANK._replace(has_load_limits=True), "`load limit`"),
        (RESIDUALS, "stays beyond its limit for 5 windows of 15 s, a second apart, or the median"),
        (RELATED, "a second apart (the drag: for 20), or the median"),
        (RESIDUALS, "diagnosed by `residuals`, as the vehicle file says"),
    ],
)
def test_the_intro_says_what_the_threshold_means_and_why_this_diagnoser(one_setting, words):
    results = page(one_setting, fleet(), [])
    assert words in " ".join(results["summary"] + results["intro"])
