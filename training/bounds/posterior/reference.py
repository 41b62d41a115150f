"""The reference posterior along an episode: whole beliefs, and where truths lie in it."""

import numpy as np
from scipy.stats import norm

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.diagnoser import IMPOSSIBLE
from diagnosers.gaussian_bank import GaussianBank
from training.bounds.posterior.filters import VehicleFilters
from training.bounds.posterior.population import OnsetPrior, Population
from training.bounds.posterior.voltages import commanded_voltages

LEAST_STD = 1e-6  # of the severity of a particle


def point_severities(faults: tuple[str, ...]) -> np.ndarray:
    """Whether a fault changes noise or arrival of a reading, of which no filter has a gradient."""
    changed = [{*CATALOGUE[name].scale, *CATALOGUE[name].offset} for name in faults]
    endings = ("_noise", "_stuck", "_dropout")
    return np.array([any(name.endswith(endings) for name in names) for names in changed])


class ReferencePosterior:
    """Particles over fault, onset, ramp and severity, with the healthy vehicle in their filters.

    When it misleads: the healthy band is uniform and taken for Gaussian, and the filters are
    linearised; a severity that grows walks a little, for the length of its ramp; severities of
    sensors that stick, drop out or are noisy, and ramps, are as fine as there are particles. It
    expects no second, intermittent or repaired fault, and no imperfections as in
    `auv_fault_env.realism`. It is the best only as far as truths lie evenly in it (`shares_below`).
    """

    def __init__(self, prior: OnsetPrior, n_particles: int, vehicle: str = "thesis1992"):
        self.bank = GaussianBank(vehicle)
        self.faults = self.bank.fault_names
        self.prior = prior
        self.n_slots = max(4, n_particles // len(self.faults))
        names = classes()
        self.class_of_fault = np.array(
            [names.index(CATALOGUE[name].diagnosis) for name in self.faults]
        )

    def begin(self, observations: np.ndarray, seed: int) -> Population:
        """The particles before the first of the observations (n_samples, n_channels)."""
        voltages = commanded_voltages(observations, self.bank.constants.water)
        filters = VehicleFilters(
            self.bank, self.faults, self.prior.severity, voltages, self.n_slots
        )
        points = point_severities(self.faults)
        random = np.random.default_rng(seed)
        return Population(self.prior, filters, points, self.n_slots, random)

    def log_probability(self, population: Population) -> np.ndarray:
        """Log probabilities of the classes, (n_classes,)."""
        log_normal, by_fault = population.log_posterior()
        out = np.full(len(classes()), IMPOSSIBLE)
        out[0] = log_normal
        np.logaddexp.at(out, self.class_of_fault, by_fault)
        return np.maximum(out, IMPOSSIBLE)

    def run(self, observations: np.ndarray, seed: int) -> tuple[np.ndarray, Population]:
        """Log probabilities (n_samples, n_classes) along an episode, and its last particles."""
        observations = np.asarray(observations, np.float64)
        population = self.begin(observations, seed)
        beliefs = []
        for k, observation in enumerate(observations):
            population.update(k, observation)
            beliefs.append(self.log_probability(population))
        return np.array(beliefs), population

    def shares_below(
        self, population: Population, true_class: int, onset: float, severity: float
    ) -> tuple[float, float]:
        """Share of the posterior of a class below a true onset [s] and a true severity."""
        faults = np.flatnonzero(self.class_of_fault == true_class)
        log_weight = population.log_weight[faults]
        weight = np.exp(log_weight - np.logaddexp.reduce(log_weight, axis=None))
        # an onset is as likely anywhere in its sample
        low = np.floor(population.onset[faults] / SAMPLE_TIME) * SAMPLE_TIME
        alive = weight > 0.0
        below = ((onset - low[alive]) / SAMPLE_TIME).clip(0.0, 1.0)
        mean, variance = population.branches.severities()
        std = np.sqrt(np.maximum(variance[faults], LEAST_STD**2))[alive]
        mean = mean[faults][alive]
        least, largest = np.repeat(self.prior.severity[faults], population.log_weight.shape[1], 0)[
            alive.ravel()
        ].T
        cumulated = [norm.cdf((end - mean) / std) for end in (least, severity, largest)]
        inside = (cumulated[1] - cumulated[0]) / np.maximum(cumulated[2] - cumulated[0], 1e-12)
        shares = (weight[alive] @ below, weight[alive] @ inside.clip(0.0, 1.0))
        # the sum of the weights is 1 but for rounding
        return min(float(shares[0]), 1.0), min(float(shares[1]), 1.0)
