"""The reference posterior on short episodes of the plant."""

import numpy as np
import pytest

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent
from training.bounds.posterior.population import OnsetPrior
from training.bounds.posterior.reference import ReferencePosterior, point_severities
from training.rollouts import roll_out

FAULTS = tuple(CATALOGUE)
N_SAMPLES = 150
EVENTS = (
    FaultEvent("increased_drag", 3.0, 0.9),
    FaultEvent("sensor_noise:port_current", 4.03, 0.5),
    FaultEvent("seal_friction:starboard", 2.52, 0.6, ramp=3.0),
)


@pytest.fixture(scope="module")
def prior():
    return OnsetPrior(
        probability=np.full(len(FAULTS), 0.8 / len(FAULTS)),
        severity=np.tile([0.2, 1.0], (len(FAULTS), 1)),
        onset=(2.0, 6.0),
        incipient=0.25,
        ramp=(2.0, 5.0),
    )


@pytest.fixture(scope="module")
def episodes():
    schedules = [(event,) for event in EVENTS] + [()]
    fleet = Fleet(len(schedules))
    missions = [MISSIONS["thesis"]] * len(schedules)
    return roll_out(fleet, range(len(schedules)), N_SAMPLES, None, schedules, missions)


@pytest.fixture(scope="module")
def found(prior, episodes):
    reference = ReferencePosterior(prior, 2000)
    lanes = range(len(EVENTS) + 1)
    return reference, [reference.run(episodes.observations[:, lane], 0) for lane in lanes]


def test_posterior_sums_to_one_at_every_sample(found):
    for log_probability, _ in found[1]:
        assert np.exp(log_probability).sum(axis=1) == pytest.approx(1.0)


def test_no_fault_is_possible_before_the_earliest_onset(found):
    for log_probability, _ in found[1]:
        assert (log_probability[:21, 0] == 0.0).all()
        assert (log_probability[22, 1:-1] > -50.0).all()


def test_posterior_beats_the_prior(prior, episodes, found):
    reference, beliefs = found
    begun = np.clip((np.arange(N_SAMPLES) - 1.0) / 10.0 - 2.0, 0.0, 4.0) / 4.0
    by_class = np.bincount(reference.class_of_fault, prior.probability, len(classes()))
    by_class[0] = 1.0 - by_class.sum()
    for lane, (log_probability, _) in enumerate(beliefs):
        label = episodes.label[:, lane]
        of_prior = np.where(label > 0, begun * by_class[label], 1.0 - begun * by_class[1:].sum())
        of_posterior = np.exp(log_probability[np.arange(N_SAMPLES), label])
        assert np.log(of_posterior).mean() > np.log(np.maximum(of_prior, 1e-12)).mean() + 0.3


def test_faults_are_named_at_the_end(found):
    names = [classes()[log_probability[-1].argmax()] for log_probability, _ in found[1]]
    assert names == [*(CATALOGUE[event.fault].diagnosis for event in EVENTS), "normal"]


def test_truths_lie_within_their_posterior(found):
    reference, beliefs = found
    for event, (_, population) in zip(EVENTS, beliefs, strict=False):
        true_class = classes().index(CATALOGUE[event.fault].diagnosis)
        shares = reference.shares_below(population, true_class, event.onset, event.severity)
        assert all(0.0 <= share <= 1.0 for share in shares)
        impossible = reference.shares_below(population, true_class, 0.0, 0.2)
        assert impossible == pytest.approx((0.0, 0.0), abs=1e-6)
        certain = reference.shares_below(population, true_class, 100.0, 1.0)
        assert certain == pytest.approx((1.0, 1.0), abs=1e-6)


def test_severities_are_points_where_no_reading_has_a_gradient():
    points = point_severities(FAULTS)
    kinds = {name.split(":")[0] for name, is_point in zip(FAULTS, points, strict=True) if is_point}
    assert kinds == {"sensor_noise", "sensor_stuck", "sensor_dropout"}
