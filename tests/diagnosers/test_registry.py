"""Every registered diagnoser keeps the rules; names and settings that do not exist are refused."""

import pytest

import diagnosers
from auv_fault_env.errors import InputError
from diagnosers import NAMES, check_diagnoser, make, ranked


@pytest.mark.parametrize("name", NAMES)
def test_every_diagnoser_keeps_the_rules(name):
    diagnoser = make(name)
    assert diagnoser.name == name
    check_diagnoser(diagnoser)


def test_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"got 'cusun'; allowed is one of .*did you mean 'cusum'"):
        make("cusun")


def test_settings_that_the_class_has_not_are_refused():
    with pytest.raises(InputError, match=r"settings of random: got .*sead.*Random\(seed"):
        make("random", sead=3)


@pytest.mark.parametrize("name", ["limits", "cusum", "rules"])
def test_an_unknown_vehicle_is_refused(name):
    with pytest.raises(InputError, match="preset: got 'thesis1993'"):
        make(name, vehicle="thesis1993")


def test_references_do_not_compete():
    assert {"oracle", "null", "random"} <= set(NAMES) - set(ranked())
    assert diagnosers.REGISTRY["limits"].ranked
