"""How near the best possible diagnosis is: a reference posterior beside the diagnosers.

Run ``python -m training.studies.bayes_gap``. Some episodes of the suite `ideal` run under the
thesis' stimulus, four in five of them with a fault. The reference knows the simulator and from what
the episodes are drawn (`training.bounds.posterior`). Score: log loss of the true class per sample,
over the classes without `unknown`, and the isolation time if each diagnoser names its most probable
class at every sample. The ranks of true onsets and severities tell whether the reference is right
(simulation-based calibration: Talts et al., arXiv:1804.06788).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np
from scipy.stats import binom
from tqdm import tqdm

from auv_fault_env.compiling import digest
from auv_fault_env.errors import finite_in_range, whole_number
from auv_fault_env.faults import CATALOGUE, UNKNOWN, classes
from auv_fault_env.schedules import ScheduleSampler
from diagnosers import make
from diagnosers.diagnoser import IMPOSSIBLE
from training.benchmark import suites
from training.benchmark.suites import ONE_FAULT, Conditions, Episode
from training.benchmark.trials import lane_truth, run_closed_loop
from training.bounds.posterior.population import OnsetPrior
from training.bounds.posterior.reference import ReferencePosterior
from training.metrics import isolation_time, probability, restricted_mean
from training.metrics.intervals import interval, paired_bootstrap
from training.metrics.records import HORIZON
from training.report.cells import percent, with_interval
from training.report.sections import figure_section, table_section
from training.stimuli import Thesis
from training.studies.run import command_line, run_study

REFERENCE = "reference"
ORACLE = "oracle"  # knows vehicle and severity
DIAGNOSERS = (ORACLE, "gaussian_bank", "filter_bank", "integrated")
HEALTHY = ScheduleSampler().healthy  # share of the episodes without a fault
RANK_BINS = 10
ONSET_STEP = 0.01  # s, to which the suite rounds onsets
TITLE = "How near is the best?"


class Beliefs(NamedTuple):
    """What was believed of every episode, over the classes without `unknown`."""

    loss: np.ndarray  # (n_samples, n_lanes), -log p(true class) [nat]
    named: np.ndarray  # (n_samples, n_lanes), most probable class
    entropy: np.ndarray  # (n_samples, n_lanes) [nat]


@dataclass(frozen=True)
class BayesGap:
    """Compare diagnosers with a reference posterior that knows the simulator."""

    episodes: int = 300
    """Episodes, of which a fifth is healthy."""
    particles: int = 10_000
    """Particles of the reference, shared evenly by the faults."""
    seed: int = 0
    """Place of the first episode in the suite; also that of the particles."""
    output: Path = Path("runs/bayes_gap")
    """Folder of the report; an earlier run there is replaced."""
    cache: Path = Path("runs/bayes_gap-cache")
    """Folder of finished episodes, from which an interrupted run goes on."""


def main(arguments: BayesGap) -> None:
    """Run the reference and the diagnosers, and write results and page."""
    whole_number("episodes", arguments.episodes, 5)
    whole_number("particles", arguments.particles, 200)
    finite_in_range("seed", arguments.seed, 0, 1000)
    run_study("bayes_gap", arguments, lambda folder: study(arguments), page)


def study(arguments: BayesGap) -> dict[str, Any]:
    """Scores and ranks as plain data."""
    suite = suites.load(suites.IDEAL)
    episodes = chosen_episodes(suite, arguments.episodes, arguments.seed)
    truth = lane_truth(suite.conditions, episodes)
    observations: list[np.ndarray] = []
    beliefs = {}
    # results of other code are not taken over
    memory = joblib.Memory(arguments.cache / digest(Path(__file__)), verbose=0)
    for name in DIAGNOSERS:
        observations, log_probability = memory.cache(followed)(name, suite.conditions, episodes)
        beliefs[name] = judged(log_probability, truth.label)
    remembered = memory.cache(reference_episode)
    # contiguous, so that an episode is found again whatever the number of episodes
    of_lanes = [np.ascontiguousarray(lane) for lane in np.moveaxis(observations, 1, 0)]
    found = [
        remembered(of_lane, episode, arguments.particles, arguments.seed)
        for of_lane, episode in zip(of_lanes, tqdm(episodes, unit="episode"), strict=True)
    ]
    log_probability = np.stack([one[0] for one in found], axis=1)
    beliefs = {REFERENCE: judged(log_probability, truth.label)} | beliefs
    is_faulty = np.array([bool(episode.schedule) for episode in episodes])
    shares = np.array([one[1:] for one in found])[is_faulty]
    onset = truth.at_instants.onset
    rows = [
        row(name, one, beliefs[REFERENCE], truth.label, onset, is_faulty)
        for name, one in beliefs.items()
    ]
    return {
        "episodes": len(episodes),
        "faulty": int(is_faulty.sum()),
        "particles": arguments.particles,
        "rows": rows,
        "ranks": {"onset": shares[:, 0].tolist(), "severity": shares[:, 1].tolist()},
    }


def chosen_episodes(suite: suites.Suite, n_episodes: int, first: int) -> list[Episode]:
    """Faulty episodes of the suite from place `first` on, then healthy ones.

    The suite is in random order, so any of its stretches is a fair sample.
    """
    n_healthy = round(HEALTHY * n_episodes)
    places = (first + np.arange(n_episodes - n_healthy)) % len(suite.episodes)
    start = suite.healthy["counting"] + first
    healthy = suite.conditions.healthy_episodes(range(start, start + n_healthy))
    return [suite.episodes[place] for place in places] + healthy


def prior_of_suite(faults: Sequence[str]) -> OnsetPrior:
    """From what the episodes are drawn: severities as in the suite, all else as in `ONE_FAULT`."""
    diagnoses = [CATALOGUE[name].diagnosis for name in faults]
    n_members = np.array([diagnoses.count(name) for name in diagnoses])
    return OnsetPrior(
        probability=(1.0 - HEALTHY) / len(set(diagnoses)) / n_members,
        severity=np.tile(ONE_FAULT.severity, (len(faults), 1)),
        onset=ONE_FAULT.onset,
        incipient=ONE_FAULT.incipient,
        ramp=ONE_FAULT.ramp,
    )


def followed(
    name: str, conditions: Conditions, episodes: Sequence[Episode]
) -> tuple[np.ndarray, np.ndarray]:
    """Observations (n_samples, n_lanes, n_channels), and log probabilities by a diagnoser."""
    observations = []
    log_probabilities = []
    n_samples = int(conditions.lengths(episodes).max())
    loop = run_closed_loop(make(name), Thesis(), conditions, episodes)
    for sample in tqdm(loop, desc=name, total=n_samples, unit="sample"):
        observations.append(sample.observation)
        log_probabilities.append(sample.belief.log_probability)
    return np.array(observations), np.array(log_probabilities)


def reference_episode(
    observations: np.ndarray, episode: Episode, n_particles: int, seed: int
) -> tuple[np.ndarray, float, float]:
    """Log probabilities (n_samples, n_classes), and the ranks of true onset and severity.

    The ranks of a healthy episode are NaN.
    """
    reference = ReferencePosterior(prior_of_suite(tuple(CATALOGUE)), n_particles)
    log_probability, population = reference.run(observations, seed)
    if not episode.schedule:
        return log_probability, np.nan, np.nan
    event = episode.schedule[0]
    true_class = classes().index(CATALOGUE[event.fault].diagnosis)
    # the suite rounds onsets
    onset = event.onset - 0.5 * ONSET_STEP
    ranks = reference.shares_below(population, true_class, onset, event.severity)
    return log_probability, *ranks


def judged(log_probability: np.ndarray, label: np.ndarray) -> Beliefs:
    """Beliefs (n_samples, n_lanes, n_classes) against the true classes, without `unknown`."""
    known = np.delete(log_probability, classes().index(UNKNOWN), axis=-1).astype(np.float64)
    total = np.logaddexp.reduce(known, axis=-1, keepdims=True)
    known = np.maximum(known - total, IMPOSSIBLE)
    of_truth = np.take_along_axis(known, label[..., None], axis=-1)[..., 0]
    entropy = -(np.exp(known) * known).sum(axis=-1)
    return Beliefs(-of_truth, known.argmax(axis=-1), entropy)


def row(
    name: str,
    beliefs: Beliefs,
    reference: Beliefs,
    label: np.ndarray,
    onset: np.ndarray,
    is_faulty: np.ndarray,
) -> dict[str, Any]:
    """Scores of a diagnoser, and its gaps to the reference with their intervals."""
    loss = beliefs.loss.mean(axis=0)
    best = reference.loss.mean(axis=0)
    time, best_time = (
        isolation_time(
            one.named[:, is_faulty],
            label.max(axis=0)[is_faulty],
            onset[is_faulty],
            HORIZON,
        )
        for one in (beliefs, reference)
    )
    is_normal = label == 0
    return {
        "name": name,
        "loss": float(loss.mean()),
        "loss_interval": interval(loss, seed=0),
        "loss_gap": float((loss - best).mean()),
        "loss_gap_interval": paired_bootstrap(loss, best, seed=0),
        "loss_normal": float(beliefs.loss[is_normal].mean()),
        "loss_faulty": float(beliefs.loss[~is_normal].mean()),
        "entropy": float(beliefs.entropy.mean()),
        "isolation": restricted_mean(time),
        "isolation_interval": interval(time.time, seed=0),
        "isolation_gap": restricted_mean(time) - restricted_mean(best_time),
        "isolation_gap_interval": paired_bootstrap(time.time, best_time.time, seed=0),
        "isolated": probability(time),
        "falsely_faulty": float((beliefs.named[is_normal] != 0).mean()),
    }


def page(results: dict[str, Any]) -> dict[str, Any]:
    """Tables of scores and gaps, and the figure of the ranks."""
    rows = [score_cells(one) for one in results["rows"]]
    columns = [
        "diagnoser",
        "log loss [nat/sample] (95 %)",
        "gap to the reference",
        "isolation [s] (95 %)",
        "gap to the reference",
        "isolated",
        "normal samples named faulty",
        "loss of normal samples",
        "of faulty ones",
        "entropy",
    ]
    n_faulty = results["faulty"]
    caption = (
        f"Share of the reference's posterior below the truth, {n_faulty} faulty episodes, given the"
        " true class. Where the reference is right, all shares are equally frequent."
    )
    counts = {
        name: np.histogram(shares, RANK_BINS, (0.0, 1.0))[0].tolist()
        for name, shares in results["ranks"].items()
    }
    data = {"counts": counts, "band": expected_counts(n_faulty)}
    return {
        "title": TITLE,
        "summary": summary(results),
        "intro": [
            f"{results['episodes']} episodes of the suite ideal under the thesis' stimulus,"
            f" {n_faulty} of them with a fault; {results['particles']} particles. A diagnoser names"
            " its most probable class at every sample, `unknown` left out."
        ],
        "command": results["command"],
        "sections": [
            table_section("Scores", columns, rows),
            figure_section("Calibration", "rank_histograms", "ranks", caption, data),
        ],
    }


def summary(results: dict[str, Any]) -> list[str]:
    """The diagnoser that is nearest to the reference, and its distance."""
    competing = [one for one in results["rows"] if one["name"] not in (REFERENCE, ORACLE)]
    nearest = min(competing, key=lambda one: one["loss_gap"])
    loss = with_interval(nearest["loss_gap"], nearest["loss_gap_interval"], 3, "+")
    time = with_interval(nearest["isolation_gap"], nearest["isolation_gap_interval"], 2, "+")
    return [
        f"{len(competing)} diagnosers beside the posterior of Bayes' rule, computed by particles, "
        f"on {results['episodes']} episodes.",
        f"{nearest['name']} is nearest: its log loss is {loss} nat per sample above the "
        f"reference, its isolation time {time} s.",
        "No diagnoser can have a lower expected log loss than the exact posterior; an isolation "
        "time can be shorter.",
    ]


def score_cells(one: dict[str, Any]) -> list[str]:
    """The cells of a diagnoser's row."""
    is_reference = one["name"] == REFERENCE
    gaps = [
        "" if is_reference else with_interval(one[gap], one[f"{gap}_interval"], digits, "+")
        for gap, digits in (("loss_gap", 3), ("isolation_gap", 2))
    ]
    return [
        one["name"],
        with_interval(one["loss"], one["loss_interval"], 3),
        gaps[0],
        with_interval(one["isolation"], one["isolation_interval"], 2),
        gaps[1],
        percent(one["isolated"]),
        f"{100.0 * one['falsely_faulty']:.2f} %",
        f"{one['loss_normal']:.3f}",
        f"{one['loss_faulty']:.3f}",
        f"{one['entropy']:.3f}",
    ]


def expected_counts(n_faulty: int) -> tuple[float, float]:
    """Central 95 % of the count in a bin if all ranks are equally likely."""
    low, high = binom.ppf([0.025, 0.975], n_faulty, 1.0 / RANK_BINS)
    return float(low), float(high)


if __name__ == "__main__":
    command_line(main)
