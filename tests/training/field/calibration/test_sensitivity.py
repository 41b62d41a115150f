from dataclasses import replace

import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.schedules import FaultEvent
from training.field.calibration.sensitivity import (
    blind_residuals,
    largest_change,
    with_healthy_logs,
)

from .test_relation_fit import ONSET, logs_of, model

LOST = FaultEvent("propeller_loss:port", ONSET, 1.0)


def widened_steady(of, name, limit):
    return replace(of, steady={**of.steady, name: of.steady[name]._replace(limit=limit)})


def test_a_residual_is_blind_where_both_limits_hide_its_largest_change():
    one_limit = widened_steady(model(), "port_load", 1e6)
    both = replace(one_limit, lasting={**model().lasting, "port_load": 1e6})
    assert blind_residuals(model()) == blind_residuals(one_limit) == []
    assert blind_residuals(both) == ["port_load"]


def test_healthy_logs_widen_limits_and_never_narrow_them():
    wide = with_healthy_logs(model(), logs_of(2, FaultEvent("increased_drag", ONSET, 0.6)))
    same = with_healthy_logs(model(), [])
    assert same == replace(model(), coefficients=same.coefficients)
    for name, limit in wide.lasting.items():
        assert limit >= model().lasting[name]
    assert wide.lasting["push"] > model().lasting["push"]


def test_a_log_that_would_make_residuals_blind_is_refused_with_its_time_and_remedy():
    healthy, *_ = logs_of(1, first=500)
    lost, *_ = logs_of(1, LOST, first=600)
    with pytest.raises(InputError) as caught:
        with_healthy_logs(model(), [healthy, lost._replace(name="lost.csv")])
    message = str(caught.value)
    for word in ("lost.csv", "drag", "% off at", "leave the log out of --healthy", "below"):
        assert word in message
    assert "\n" not in message
    time = float(message.split(" off at ")[1].split(" s")[0])
    assert time > ONSET


def test_a_model_that_is_blind_already_refuses_no_log_for_that():
    blind = replace(widened_steady(model(), "push", 1e6), lasting={**model().lasting, "push": 1e6})
    assert blind.smallest_changes()["push"] > largest_change("push")
    assert blind_residuals(with_healthy_logs(blind, logs_of(1, first=500))) == ["push"]
