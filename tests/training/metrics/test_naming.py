import math

import numpy as np

from auv_fault_env.faults import UNKNOWN, classes
from training.metrics import naming
from training.metrics.naming import name_of, share_of_alarmed

NAMES = list(classes())


def named(names):
    return [NAMES.index(name) for name in names]


def test_the_one_right_name_of_an_explained_fault_is_its_class():
    fault = np.array(named(["seal_friction:port"]))
    right = naming.right_classes(fault, [{"shaft:port"}], np.array([True]))
    assert np.flatnonzero(right[0]).tolist() == fault.tolist()


def test_of_other_faults_every_class_of_a_component_that_fails_is_right():
    fault = np.array(named(["seal_friction:port", "normal", "normal"]))
    failing = [{"shaft:port", "shaft:starboard"}, {"sensor:port_rpm"}, {"propeller"}]
    right = naming.right_classes(fault, failing, np.zeros(3, bool))
    found = [{NAMES[k] for k in np.flatnonzero(row)} for row in right]
    assert found[0] == {"seal_friction:port", "seal_friction:starboard"} | {UNKNOWN}
    assert found[1] == {"sensor:port_rpm"} | {UNKNOWN}
    assert found[2] == {name for name in NAMES if name.startswith("propeller")} | {UNKNOWN}


def test_shares_are_of_lanes_with_an_alarm():
    unknown = 3
    is_right_class = np.eye(4, dtype=bool)[[1] * 5]
    is_right_class[:, unknown] = True
    found = name_of(
        alarm=np.array([True, True, True, True, False]),
        fault=np.array([1, unknown, 2, 2, 2]),
        log_fault=np.log([0.95, 0.95, 0.95, 0.5, 0.95]),
        is_right_class=is_right_class,
        unknown=unknown,
    )
    assert share_of_alarmed(found, found.right) == 0.5
    assert share_of_alarmed(found, found.unknown) == 0.25
    assert share_of_alarmed(found, found.surely_wrong) == 0.25


def test_the_share_of_no_lane_is_no_number():
    no = np.array([False])
    found = name_of(no, np.array([1]), np.zeros(1), np.eye(2, dtype=bool)[[1]], 0)
    assert math.isnan(share_of_alarmed(found, found.right))
