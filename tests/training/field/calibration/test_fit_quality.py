from dataclasses import replace

import pytest

from auv_fault_env.channels import CHANNELS
from training.field.calibration.fit_quality import (
    GOOD,
    POOR,
    USABLE,
    fit_quality,
)
from training.field.vehicle_file import Column

from ..healthy_missions import OFF
from .test_relation_fit import FILE, logs_of, model

# a motor of which the bank does not know that it draws twice the current
UNLIKE = replace(OFF, torque_constant=0.5 * OFF.torque_constant)


def quality_of(**changes):
    return fit_quality(logs_of(2), replace(FILE, **changes))


def without(*absent):
    return {name: Column(name) for name in CHANNELS if name not in absent}


def test_the_bank_diagnoses_the_vehicle_that_it_knows():
    quality = quality_of(relations=model())
    assert (quality.level, quality.diagnoser) == (GOOD, "filter_bank")
    assert quality.time_in_alarm == 0.0
    assert quality.smallest_changes == model().smallest_changes()
    assert quality.line.startswith("fit: good: ") and "drag" in quality.line
    assert quality.line.endswith("diagnose uses filter_bank")


def test_a_single_log_shows_no_share_of_alarms_and_no_good_fit():
    quality = fit_quality(logs_of(1), replace(FILE, relations=model()))
    assert (quality.level, quality.diagnoser) == (USABLE, "filter_bank")
    assert quality.time_in_alarm is None and "of the healthy time" not in quality.line
    assert quality.line.startswith("fit: usable: one log cannot show how far healthy missions")
    assert "drag" in quality.line and "; name three or more healthy logs; " in quality.line
    unlike = fit_quality(logs_of(1), replace(FILE, vehicle=UNLIKE, relations=model()))
    assert (unlike.level, unlike.diagnoser) == (USABLE, "residuals")
    assert unlike.time_in_alarm is None and "of the healthy time" not in unlike.line


def test_likely_mistakes_make_the_fit_poor_and_come_first():
    quality = quality_of(relations=model())
    assert quality.in_doubt([]) is quality
    doubted = quality.in_doubt(["port_voltage", "log b.csv", "port_voltage"])
    assert (doubted.level, doubted.diagnoser) == (POOR, quality.diagnoser)
    assert doubted.line.startswith("fit: poor: likely mistakes: port_voltage, log b.csv; ")
    assert "; settle the warnings first; diagnose uses" in doubted.line


def test_the_relations_diagnose_a_vehicle_unlike_the_model():
    quality = quality_of(vehicle=UNLIKE, relations=model())
    assert (quality.level, quality.diagnoser) == (USABLE, "residuals")
    assert quality.time_in_alarm > 0.5
    assert "port load" in quality.line and "\n" not in quality.line


def test_a_blind_relation_makes_the_fit_poor_and_is_named():
    steady = dict(model().steady)
    steady["push"] = steady["push"]._replace(limit=1e4)
    blind = replace(model(), steady=steady, lasting={**model().lasting, "push": 1e4})
    quality = quality_of(vehicle=UNLIKE, relations=blind)
    assert (quality.level, quality.diagnoser) == (POOR, "residuals")
    assert "no lasting changes below: drag" in quality.line and quality.remedy in quality.line


@pytest.mark.parametrize(
    ("logs", "columns", "words"),
    [
        (logs_of, without("port_current"), ["port_current", "log what is lacking"]),
        (
            lambda _: [log._replace(segments=(slice(0, 1000),)) for log in logs_of(1)],
            without(),
            ["no relations from", "120 s", "add healthy missions"],
        ),
    ],
    ids=["a channel", "time under way"],
)
def test_what_the_relations_lack_is_named(logs, columns, words):
    quality = fit_quality(logs(1), replace(FILE, vehicle=UNLIKE, columns=columns))
    assert (quality.level, quality.diagnoser) == (POOR, "filter_bank")
    for word in words:
        assert word in quality.line


def test_a_vehicle_that_no_diagnoser_can_judge_is_poor():
    logs = logs_of(1)
    quality = fit_quality(logs, replace(FILE, columns={"speed": Column("speed")}))
    assert (quality.level, quality.time_in_alarm) == (POOR, None)
    assert "port_voltage or port_rpm" in quality.line
