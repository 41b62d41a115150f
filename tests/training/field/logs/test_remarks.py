"""Remarks of a fleet: a unit is named once, and only where it explains every log."""

from training.field.logs.remarks import remark_rows

REMARK = "speed is {} times what port_rpm gives with these constants{}; are the units right?"
IN_RAD = ", as if with shaft speed in rad/s"


def test_a_common_explanation_is_named_once():
    rows = remark_rows([("a", REMARK.format(9.1, IN_RAD)), ("b", REMARK.format(9.8, IN_RAD))])
    assert rows == [[REMARK.format("9.1 to 9.8", IN_RAD), "a, b"]]


def test_an_explanation_of_some_logs_alone_is_not_named():
    rows = remark_rows([("a", REMARK.format(9.1, IN_RAD)), ("b", REMARK.format(25, ""))])
    assert rows == [[REMARK.format("9.1 to 25", ""), "a, b"]]
