"""The light bank for training stimuli: few filters, beliefs like those of the whole bank."""

import numpy as np

from auv_fault_env import FaultEvent, Fleet, classes
from auv_fault_env.missions import follow_mission
from diagnosers import check_diagnoser, make
from training.learning.budgeted import speed_dependent_classes
from training.stimuli.light_bank import light_bank, light_classes, restrict_belief

IS_MISSING = np.array([name not in light_classes() for name in classes()])


def test_it_has_the_classes_of_all_and_the_filters_of_few():
    bank = light_bank()
    whole = make("gaussian_bank")
    assert bank.classes == whole.classes
    filters = [one.hypotheses().hypothesis.size for one in (bank, whole)]
    assert filters[0] < filters[1] / 8
    assert set(speed_dependent_classes()) < set(light_classes()) < set(classes())
    check_diagnoser(bank)


def test_a_class_without_a_hypothesis_is_impossible_and_the_others_share_all():
    bank = light_bank()
    belief = bank_after(bank, FaultEvent("sensor_bias:port_current", 1.0, 1.0), 40)
    assert IS_MISSING.sum() == 6
    assert (belief.log_probability[:, IS_MISSING] < -1e5).all()
    np.testing.assert_allclose(np.exp(belief.log_probability).sum(axis=1), 1.0)


def test_missing_classes_are_dropped_and_the_rest_stays():
    belief = bank_after(make("gaussian_bank"), FaultEvent("sensor_bias:port_current", 1.0, 1.0), 40)
    restricted = restrict_belief(belief)
    assert (restricted.log_probability[:, IS_MISSING] < -1e5).all()
    np.testing.assert_array_equal(
        restricted.log_probability[:, ~IS_MISSING], belief.log_probability[:, ~IS_MISSING]
    )


def test_it_names_a_lost_propeller_as_the_whole_bank_does():
    for bank in (light_bank(), make("gaussian_bank")):
        belief = bank_after(bank, FaultEvent("propeller_loss:port", 2.0, 1.0), 100)
        assert (
            belief.log_probability.argmax(axis=1) == list(classes()).index("propeller_loss:port")
        ).all()


def bank_after(bank, event, n_samples):
    fleet = Fleet(4)
    reading = fleet.reset(range(4), schedules=[(event,)] * 4, missions=["thesis"] * 4)
    bank.reset(4)
    for _ in range(n_samples):
        belief = bank.update(reading)
        reading = fleet.advance(follow_mission(reading))
    return belief
