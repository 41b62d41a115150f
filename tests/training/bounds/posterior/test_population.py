"""The particles against cases that can be enumerated."""

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from auv_fault_env.parameters import SAMPLE_TIME
from training.bounds.posterior.population import OnsetPrior, Population, pruned

SIGNS = np.array([1.0, -1.0])  # of the shift of the mean by each fault
N_SAMPLES = 60
GRID = 400  # severities of the enumeration
PRIOR = OnsetPrior(
    probability=np.array([0.5, 0.3]),
    severity=np.array([[0.5, 2.0], [0.5, 2.0]]),
    onset=(1.0, 4.0),
    incipient=0.0,
    ramp=(1.0, 2.0),
)


class ShiftedMeans:
    """A standard normal whose mean shifts by the severity: `population.Branches`."""

    def __init__(self, n_slots):
        self.mean = np.zeros((SIGNS.size, n_slots))
        self.variance = np.zeros((SIGNS.size, n_slots))

    def branch(self, fault, slot, mean, variance):
        self.mean[fault, slot] = mean
        self.variance[fault, slot] = variance

    def copy(self, fault, parent, slot, severity):
        self.mean[fault, slot] = severity
        self.variance[fault, slot] = 0.0

    def severities(self):
        return self.mean, self.variance

    def step(self, observation, share):
        gradient = SIGNS[:, None] * share
        total = 1.0 + gradient**2 * self.variance
        innovation = observation - gradient * self.mean
        gain = gradient * self.variance / total
        self.mean = self.mean + gain * innovation
        self.variance = self.variance * (1.0 - gain * gradient)
        return norm.logpdf(observation), norm.logpdf(innovation / np.sqrt(total)) - np.log(
            total
        ) / 2


def readings(seed, fault=0, onset=2.05, severity=1.2):
    random = np.random.default_rng(seed)
    present = (np.arange(N_SAMPLES) - 1) * SAMPLE_TIME >= onset
    return random.standard_normal(N_SAMPLES) + present * SIGNS[fault] * severity


def enumerated(values):
    """Log probabilities of no fault and of each fault after every sample, (n_samples, 3)."""
    n_onsets = round((PRIOR.onset[1] - PRIOR.onset[0]) / SAMPLE_TIME)
    first = round(PRIOR.onset[0] / SAMPLE_TIME)
    place = (np.arange(GRID) + 0.5) / GRID
    severity = PRIOR.severity[0, 0] + place * np.diff(PRIOR.severity[0])
    log_normal = norm.logpdf(values)
    out = []
    for n in range(1, values.size + 1):
        k = np.arange(n)
        # an onset within a sample shows from the second sample after its beginning on
        shown = first + 2 + np.arange(n_onsets)
        begun = shown < n
        joint = [log_normal[:n].sum() + np.log(1.0 - PRIOR.probability.sum() * begun.mean())]
        for sign, probability in zip(SIGNS, PRIOR.probability, strict=True):
            shifted = norm.logpdf(values[:n, None] - sign * severity)
            terms = [
                np.where(k[:, None] < start, log_normal[:n, None], shifted).sum(axis=0)
                for start in shown[begun]
            ]
            share = probability / n_onsets / GRID
            joint.append(logsumexp(terms) + np.log(share) if terms else -np.inf)
        out.append(joint - logsumexp(joint))
    return np.array(out)


def particles(values, points, n_slots, seed=0):
    random = np.random.default_rng(seed)
    population = Population(PRIOR, ShiftedMeans(n_slots), np.full(2, points), n_slots, random)
    out = []
    for k, value in enumerate(values):
        population.update(k, value)
        log_normal, by_fault = population.log_posterior()
        out.append([log_normal, *by_fault])
    return np.array(out), population


@pytest.mark.parametrize("points", [False, True])
def test_posterior_of_a_shift_of_the_mean_is_that_by_enumeration(points):
    values = readings(seed=1)
    found, _ = particles(values, points, n_slots=2000)
    assert np.exp(found) == pytest.approx(np.exp(enumerated(values)), abs=0.03)


def test_few_particles_are_without_bias_in_the_evidence():
    values = readings(seed=2)
    exact = enumerated(values)[-1]
    odds = [np.diff(particles(values, False, 60, seed)[0][-1, :2])[0] for seed in range(40)]
    assert np.exp(odds).mean() == pytest.approx(np.exp(exact[1] - exact[0]), rel=0.3)


def test_probabilities_sum_to_one_and_none_is_before_the_earliest_onset():
    found, _ = particles(readings(seed=3), False, n_slots=100)
    assert np.exp(found).sum(axis=1) == pytest.approx(1.0)
    earliest = round(PRIOR.onset[0] / SAMPLE_TIME) + 2
    assert (found[:earliest, 1:] == -np.inf).all()
    assert (found[earliest, 1:] > -np.inf).all()


def test_severity_and_onset_of_the_particles_are_those_of_the_readings():
    values = readings(seed=4, severity=1.8)
    _, population = particles(values, True, n_slots=1000)
    weight = np.exp(population.log_weight[0] - logsumexp(population.log_weight[0]))
    alive = weight > 0.0
    severity = population.branches.severities()[0][0]
    present = values[22:]
    assert weight @ severity == pytest.approx(present.mean(), abs=0.25)
    assert weight[alive] @ population.onset[0, alive] == pytest.approx(2.05, abs=0.3)


def test_pruning_keeps_the_heavy_and_the_mean_of_the_others():
    log_weight = np.log([4.0, 3.0, 0.1, 0.2, 0.3, 0.4])
    random = np.random.default_rng(0)
    draws = np.exp([pruned(log_weight, 4, random) for _ in range(4000)])
    assert ((draws > 0.0).sum(axis=1) <= 4).all()
    assert (draws[:, :2] == np.exp(log_weight[:2])).all()
    assert draws.mean(axis=0) == pytest.approx(np.exp(log_weight), rel=0.1)
    assert draws[:, 2:].max() == pytest.approx(0.5)


def test_pruning_leaves_few_particles_as_they_are():
    log_weight = np.array([-1.0, -np.inf, -2.0])
    assert (pruned(log_weight, 2, np.random.default_rng(0)) == log_weight).all()
