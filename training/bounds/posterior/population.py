"""Particles of faults that may begin at any sample: births, Bayes' rule, pruning.

Nothing before its onset distinguishes a fault from a normal system. So at each sample particles
branch off the normal hypothesis, one for each piece of the prior of a fault that begins then, and
the number of particles of each fault is bounded by pruning without bias.

Sources: Fearnhead & Clifford, "On-line inference for hidden Markov models via particle filters",
J. R. Stat. Soc. B 65, 2003, doi:10.1111/1467-9868.00421 (`pruned`); Liu & West, "Combined parameter
and state estimation in simulation-based filtering", in "Sequential Monte Carlo Methods in
Practice", Springer 2001 (`Population.refresh`).
"""

import math
from typing import NamedTuple, Protocol

import numpy as np

from auv_fault_env.episodes import severities_over_time
from auv_fault_env.layout import SeverityProfile
from auv_fault_env.parameters import SAMPLE_TIME

SLOTS_PER_BIRTH = 12  # slots of a fault for each particle that begins at a sample
ABRUPT_SHARE = 0.4  # of these particles
KEPT_SHARE = 0.6  # of the slots, after pruning
LEAST_EFFECTIVE = 0.5  # share of the particles; below, severities that are points are drawn anew
REFRESH_EVERY = 10  # samples, after the last onset
JITTER = 0.15  # of new severities, in standard deviations of the old
NEGLIGIBLE = 100.0  # log weight below that of the heaviest particle of a fault
TIME_TOLERANCE = 1e-9  # s, by which a sample time may miss an onset at that time


class OnsetPrior(NamedTuple):
    """What is known of the fault of an episode before it; all quantities are uniform."""

    probability: np.ndarray  # (n_faults,), the rest is that of no fault
    severity: np.ndarray  # (n_faults, 2), least and largest
    onset: tuple[float, float]  # s
    incipient: float  # probability of a ramp
    ramp: tuple[float, float]  # s


class Branches(Protocol):
    """What is normal, and a particle for each fault and slot that branches off it."""

    def branch(self, fault, slot, mean, variance) -> None:
        """Let particles begin as the normal one, with these moments of the severity."""

    def copy(self, fault, parent, slot, severity) -> None:
        """Let slots of a fault continue the slots `parent`, with these severities."""

    def step(self, observation, share) -> tuple[float, np.ndarray]:
        """Log density of an observation if normal, and by particle (n_faults, n_slots).

        share (n_faults, n_slots): of its full severity that a particle has.
        """

    def severities(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance of the severity of each particle, (n_faults, n_slots) each."""


class Population:
    """The particles of one episode.

    Attributes
    ----------
    log_normal
        Logarithm of the joint density of no fault so far and the observations.
    log_weight
        The same of each particle (n_faults, n_slots), -inf for a free slot.
    onset, ramp
        Of each particle [s]; its onset is as likely anywhere in the sample before.
    """

    def __init__(
        self,
        prior: OnsetPrior,
        branches: Branches,
        points: np.ndarray,
        n_slots: int,
        random: np.random.Generator,
    ):
        """Begin an episode; `points` (n_faults,): whether severities are points, not Gaussians."""
        self.prior = prior
        self.branches = branches
        self.points = points
        self.random = random
        self.log_normal = 0.0
        self._log_evidence = 0.0
        shape = len(prior.probability), n_slots
        self.log_weight = np.full(shape, -np.inf)
        self.onset = np.full(shape, np.inf)
        self.ramp = np.zeros(shape)
        self.n_births = max(2, n_slots // SLOTS_PER_BIRTH)
        self.n_kept = min(round(KEPT_SHARE * n_slots), n_slots - self.n_births)

    def update(self, k: int, observation: np.ndarray) -> None:
        """Take all particles through sample k of the episode."""
        first, last = self.prior.onset
        # a fault shows in the sample after the step in which it is present
        begin = (k - 2) * SAMPLE_TIME
        end = (k - 1) * SAMPLE_TIME
        low = min(max(begin, first), last)
        high = min(max(end, first), last)
        if high > low:
            self._make_room()
            self._begin(low, high)
        elif high == last and k % REFRESH_EVERY == 0:
            self._refresh_all(self.log_weight.shape[1])
        shares = self._shares(end + TIME_TOLERANCE)
        log_density, log_densities = self.branches.step(observation, shares)
        self._log_evidence += log_density
        begun = (high - first) / (last - first)
        remaining = 1.0 - self.prior.probability.sum() * begun
        self.log_normal = self._log_evidence + math.log(max(remaining, 1e-300))
        is_alive = self.log_weight > -np.inf
        self.log_weight[is_alive] += log_densities[is_alive]

    def log_posterior(self) -> tuple[float, np.ndarray]:
        """Log probability of no fault so far, and of each fault (n_faults,)."""
        by_fault = np.logaddexp.reduce(self.log_weight, axis=1)
        total = np.logaddexp(self.log_normal, np.logaddexp.reduce(by_fault))
        return self.log_normal - total, by_fault - total

    def _shares(self, time: float) -> np.ndarray:
        shape = self.log_weight.shape
        whole = np.ones(shape)
        profile = SeverityProfile(
            onset=self.onset,
            severity=whole,
            ramp=self.ramp,
            end=np.full(shape, np.inf),
            period=np.zeros(shape),
            duty=whole,
        )
        profiles = np.stack(profile, axis=-1).reshape(-1, 1, len(profile))
        return severities_over_time(np.array([time]), profiles).reshape(shape)

    def _make_room(self) -> None:
        is_free = self.log_weight == -np.inf
        for fault in np.flatnonzero(is_free.sum(axis=1) < self.n_births):
            if not (self.points[fault] and self._refresh(fault, self.n_kept)):
                self.log_weight[fault] = pruned(self.log_weight[fault], self.n_kept, self.random)

    def _begin(self, low: float, high: float) -> None:
        """Let particles of every fault begin between two times [s]."""
        n_faults = len(self.log_weight)
        n_abrupt = max(1, round(ABRUPT_SHARE * self.n_births))
        n_ramps = self.n_births - n_abrupt
        is_free = self.log_weight == -np.inf
        slot = np.argsort(~is_free, axis=1, kind="stable")[:, : self.n_births]
        fault = np.repeat(np.arange(n_faults), self.n_births)
        slot = slot.ravel()
        place = np.concatenate([np.arange(n_abrupt) / n_abrupt, np.arange(n_ramps) / n_ramps])
        width = np.repeat([1.0 / n_abrupt, 1.0 / n_ramps], [n_abrupt, n_ramps])
        share = width * np.repeat(
            [1.0 - self.prior.incipient, self.prior.incipient], [n_abrupt, n_ramps]
        )
        least, largest = self.prior.severity[fault].T
        span = largest - least
        is_point = self.points[fault]
        within = np.where(is_point, self.random.random(fault.size), 0.5)
        mean = least + span * (np.tile(place, n_faults) + within * np.tile(width, n_faults))
        variance = np.where(is_point, 0.0, (span * np.tile(width, n_faults)) ** 2 / 12.0)
        is_ramped = np.tile(np.arange(self.n_births) >= n_abrupt, n_faults)
        first, last = self.prior.onset
        shortest, longest = self.prior.ramp
        probability = self.prior.probability[fault] * np.tile(share, n_faults)
        probability *= (high - low) / (last - first)
        ramp = shortest + (longest - shortest) * self.random.random(fault.size)
        self.onset[fault, slot] = low + (high - low) * self.random.random(fault.size)
        self.ramp[fault, slot] = np.where(is_ramped, ramp, 0.0)
        with np.errstate(divide="ignore"):
            self.log_weight[fault, slot] = self._log_evidence + np.log(probability)
        self.branches.branch(fault, slot, mean, variance)

    def _refresh_all(self, n_kept: int) -> None:
        for fault in np.flatnonzero(self.points):
            self._refresh(fault, n_kept)

    def _refresh(self, fault: int, n_kept: int) -> bool:
        """Draw the particles of a fault anew if few have most of the weight; whether that was so.

        Their severities, which are points, move a little, without a change of mean and variance.
        """
        log_weight = self.log_weight[fault]
        total = np.logaddexp.reduce(log_weight)
        if total == -np.inf:
            return False
        weight = np.exp(log_weight - total)
        n_alive = np.count_nonzero(weight)
        if 1.0 / np.square(weight).sum() >= LEAST_EFFECTIVE * min(n_alive, n_kept):
            return False
        place = (np.arange(n_kept) + self.random.random()) / n_kept
        parent = np.searchsorted(np.cumsum(weight), place).clip(0, weight.size - 1)
        severity = self.branches.severities()[0][fault]
        mean = weight @ severity
        std = math.sqrt(weight @ np.square(severity - mean))
        kept = math.sqrt(1.0 - JITTER**2)
        moved = mean + kept * (severity[parent] - mean)
        moved += JITTER * std * self.random.standard_normal(n_kept)
        slot = np.arange(n_kept)
        self.branches.copy(fault, parent, slot, moved.clip(*self.prior.severity[fault]))
        self.onset[fault, slot] = self.onset[fault, parent]
        self.ramp[fault, slot] = self.ramp[fault, parent]
        self.log_weight[fault] = -np.inf
        self.log_weight[fault, slot] = total - math.log(n_kept)
        return True


def pruned(log_weight: np.ndarray, n_kept: int, random: np.random.Generator) -> np.ndarray:
    """Log weights (n,) of which at most `n_kept` remain, with the old ones as their means.

    Those above a limit stay as they are; of the others some are drawn and get the limit as weight.
    """
    highest = log_weight.max()
    alive = np.flatnonzero(log_weight > highest - NEGLIGIBLE)
    if alive.size <= n_kept:
        return np.where(log_weight > highest - NEGLIGIBLE, log_weight, -np.inf)
    weight = np.exp(log_weight[alive] - highest)
    ordered = np.sort(weight)[::-1]
    rest = np.cumsum(ordered[::-1])[::-1]  # of each weight and all smaller ones
    n_above = np.arange(n_kept)
    limits = rest[:n_kept] / (n_kept - n_above)
    n_whole = int(np.flatnonzero(ordered[:n_kept] <= limits)[0])
    limit = limits[n_whole]
    is_whole = weight > limit
    new = np.full(log_weight.shape, -np.inf)
    new[alive[is_whole]] = log_weight[alive[is_whole]]
    others = alive[~is_whole]
    n_drawn = n_kept - int(is_whole.sum())
    edges = np.cumsum(weight[~is_whole])
    place = (np.arange(n_drawn) + random.random()) / n_drawn * edges[-1]
    drawn = np.unique(np.searchsorted(edges, place).clip(0, others.size - 1))
    new[others[drawn]] = highest + math.log(limit)
    return new
