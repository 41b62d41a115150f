"""The bounds of a benchmark: for every stimulus and class the least delays that any diagnoser can have.

What `bounds_of` gives for a stimulus; times in seconds up to `HORIZON`, a `rate` being "1 h" or "10 h" between false
alarms, a value with its 95 % interval a list [value, low, high]::

    classes      {class: {information_rate [nat/s], asymptotic_delay {rate: value},
                 detection_delay {rate: [value, low, high]}, delay_by_rate [value at each of amoc's
                 rates], rival, rival_rate [nat/s], isolation_delay [value, low, high],
                 asymptotic_isolation}}
    all          {detection_delay {rate: [...]}, isolation_delay {rate: [...]}}: mean over classes
    amoc         {false_alarms_per_hour, delay}: least mean detection delay against the rate of
    false alarms calibration  {inverse_ratio {time: value}, healthy_beyond {level: share}} lanes
    number of lanes, all classes together

How to read it: `detection_delay` holds for any diagnoser with so few false alarms
(`bounds.detection_power`), and `all.isolation_delay` for any (no decision is right more often, in
the mean over classes and severities, than that for the most likely class, told the vehicle and the
onset). `isolation_delay` of a class is against its most dangerous rival and holds for a diagnoser
that gives the rival the class' name with a chance of at most `MISNAMED`. The asymptotic figures may
be beaten. Calibration: the mean inverse ratio of the ratios used is 1 if they are likelihood
ratios, less where healthy vehicles can show what faulty ones cannot, and the share of healthy
vehicles whose ratio ever exceeds 1/level is at most the level (Ville's inequality).
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_RATE
from training.benchmark.scores import MEAN_TIMES
from training.bounds.delays import (
    asymptotic_delay,
    bootstrap,
    delay_bound,
    detection_power,
    information_rate,
    mean_inverse_ratio,
    neyman_pearson_power,
)
from training.bounds.information import (
    log_likelihoods_known_severity,
    log_likelihoods_unknown_severity,
    simulate_suite_lanes,
)
from training.metrics.intervals import interval
from training.metrics.records import HORIZON
from training.stimuli import Stimulus

PER_HOUR = 3600.0 * SAMPLE_RATE  # samples
# samples between false alarms
RATES = {rate: time * SAMPLE_RATE for rate, time in MEAN_TIMES.items()}
MISNAMED = 0.01
AMOC_RATES = np.geomspace(0.02, 500.0, 23)  # false alarms per hour
CALIBRATED_AT = (1.0, 3.0, 10.0)  # s after onset
LEVELS = (0.01, 0.05, 0.2)
# episodes of a class that are compared with its bound: the interval of fewer is far too narrow
FEWEST = 8


def bounds_of(stimulus: Stimulus, seed: int, n_lanes: int) -> dict[str, Any]:
    """All bounds under a stimulus, from so many lanes like those of the standard suite."""
    lanes = simulate_suite_lanes(stimulus, seed, n_lanes)
    known = log_likelihoods_known_severity(lanes)
    free = log_likelihoods_unknown_severity(lanes)
    diagnosis = lanes.diagnosis
    by_class = {
        name: _of_class(known[:, diagnosis == k], free[:, diagnosis == k], k, seed)
        for k, name in enumerate(classes())
        if (diagnosis == k).any()
    }
    healthy = _own(
        log_likelihoods_known_severity(simulate_suite_lanes(stimulus, seed, n_lanes, healthy=True)),
        diagnosis,
    )
    curves = np.mean([one["delay_by_rate"] for one in by_class.values()], axis=0)
    detection = {
        rate: _mean([one["detection_delay"][rate] for one in by_class.values()]) for rate in RATES
    }
    isolation = {
        rate: _isolation_of_all(free, _own(known, diagnosis), diagnosis, samples, seed)
        for rate, samples in RATES.items()
    }
    return {
        "classes": by_class,
        "all": {"detection_delay": detection, "isolation_delay": isolation},
        "amoc": {
            "false_alarms_per_hour": AMOC_RATES.round(4).tolist(),
            "delay": curves.round(4).tolist(),
        },
        "calibration": _calibration(_own(known, diagnosis), healthy),
        "lanes": n_lanes,
    }


def _own(paths: np.ndarray, diagnosis: np.ndarray) -> np.ndarray:
    """Ratio of each lane's own class against normal, (n_samples, n_lanes), of paths (n_samples, n_lanes, n_classes)."""
    return paths[:, np.arange(len(diagnosis)), diagnosis].astype(np.float64)


def _of_class(known: np.ndarray, free: np.ndarray, k: int, seed: int) -> dict[str, Any]:
    """Bounds of class k from the paths of its lanes: `known` with severities told, `free` without."""
    own = known[:, :, k].astype(np.float64)
    rates = information_rate(own)
    rivals = [j for j in range(1, known.shape[2]) if j != k]
    rival = max(rivals, key=lambda j: _isolation(own - free[:, :, j]))
    against = own - free[:, :, rival]
    rival_rates = information_rate(against)
    return {
        "information_rate": float(rates.mean()),
        "asymptotic_delay": {rate: _restricted(rates, samples) for rate, samples in RATES.items()},
        "detection_delay": {
            rate: _with_interval(
                own, lambda llr, samples=samples: delay_bound(detection_power(llr, samples)), seed
            )
            for rate, samples in RATES.items()
        },
        "delay_by_rate": [
            round(delay_bound(detection_power(own, PER_HOUR / rate)), 4) for rate in AMOC_RATES
        ],
        "rival": classes()[rival],
        "rival_rate": float(rival_rates.mean()),
        "isolation_delay": _with_interval(against, _isolation, seed),
        "asymptotic_isolation": _restricted(rival_rates, 1.0 / MISNAMED),
    }


def _isolation(against: np.ndarray) -> float:
    return delay_bound(neyman_pearson_power(against, MISNAMED))


def _restricted(rates: np.ndarray, samples: float) -> float:
    return float(np.minimum(asymptotic_delay(rates, samples), HORIZON).mean())


def _with_interval(llr: np.ndarray, bound: Callable[[np.ndarray], float], seed: int) -> list[float]:
    """A bound from (n_samples, n_lanes), and its bootstrap interval."""
    low, high = bootstrap(lambda some: bound(llr[:, some]), llr.shape[1], seed)
    return [bound(llr), low, high]


def _mean(bounds: list[list[float]]) -> list[float]:
    """Mean of independent bounds, with the interval that follows from theirs."""
    value, low, high = np.array(bounds).T
    below, above = (
        np.sqrt(np.square(gap).sum()) / len(value) for gap in (value - low, high - value)
    )
    return [float(value.mean()), float(value.mean() - below), float(value.mean() + above)]


def _isolation_of_all(
    free: np.ndarray, own: np.ndarray, diagnosis: np.ndarray, samples: float, seed: int
) -> list[float]:
    """Least mean isolation time: named right is at most the most likely fault, and only what has been detected."""
    right = free[:, :, 1:].argmax(axis=2) + 1 == diagnosis

    def bound(some: np.ndarray) -> float:
        kinds = diagnosis[some]
        detected = [detection_power(own[:, some[kinds == k]], samples) for k in np.unique(kinds)]
        return delay_bound(np.minimum(right[:, some].mean(axis=1), np.mean(detected, axis=0)))

    n_lanes = len(diagnosis)
    return [bound(np.arange(n_lanes)), *bootstrap(bound, n_lanes, seed)]


def _calibration(own: np.ndarray, healthy: np.ndarray) -> dict[str, dict[str, float]]:
    """How nearly the ratios are likelihood ratios, by lanes with their faults and by the same without."""
    highest = healthy.max(axis=0)
    return {
        "inverse_ratio": {
            f"{t:g} s": float(mean_inverse_ratio(own[round(t * SAMPLE_RATE) - 1]))
            for t in CALIBRATED_AT
        },
        "healthy_beyond": {
            f"{level:g}": float((highest > -np.log(level)).mean()) for level in LEVELS
        },
    }


def check(results: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Has any diagnoser beaten a bound? One row per stimulus, diagnoser and class, and one for all of them together.

    Only abrupt faults count, and classes with at least `FEWEST` of them. A bound is beaten when the
    intervals do not meet, the measured one being lower. Detection is compared at the rate of false
    alarms that the diagnoser may really have, the upper end of its interval. Among hundreds of
    comparisons some intervals miss their truth: one narrow miss proves nothing, several of one
    diagnoser do.

    Parameters
    ----------
    results
        Those of a benchmark, as `training.benchmark.scores` describes them, with `bounds` by
        stimulus.
    """
    return [
        row
        for stimulus, bounds in results["bounds"].items()
        for name, score in results["scores"][stimulus].items()
        for row in _checked(stimulus, name, score, bounds, results)
    ]


def _checked(
    stimulus: str,
    name: str,
    score: Mapping[str, Any],
    bounds: Mapping[str, Any],
    results: Mapping[str, Any],
) -> Iterator[dict[str, Any]]:
    episodes = results["episodes"]
    lanes = score["by_lane"]
    seed = results["seeds"]["bootstrap"]
    abrupt = np.array(episodes["abrupt"], bool)
    fault = np.array(episodes["fault"])
    rate = max(1.0, score["rates"]["1 h"]["false_alarms_per_hour_interval"][1])
    what = {"stimulus": stimulus, "diagnoser": name}
    for k, kind in enumerate(results["classes"]):
        of_class = abrupt & (fault == k)
        if of_class.sum() >= FEWEST and kind in bounds["classes"]:
            bound = _at_rate(bounds["classes"][kind], bounds["amoc"]["false_alarms_per_hour"], rate)
            yield (
                what
                | {"what": "detection", "class": kind}
                | _row(np.array(lanes["detection"])[of_class], bound, seed)
            )
    bound = bounds["all"]["isolation_delay"]["1 h"]
    yield (
        what
        | {"what": "isolation", "class": "all"}
        | _row(np.array(lanes["isolation"])[abrupt], bound, seed)
    )


def _at_rate(of_class: Mapping[str, Any], rates: list[float], rate: float) -> list[float]:
    """The detection bound of a class at a rate of false alarms per hour, its interval as wide as at one per hour."""
    value, low, high = of_class["detection_delay"]["1 h"]
    there = float(np.interp(np.log(rate), np.log(rates), of_class["delay_by_rate"]))
    return [there, there - (value - low), there + (high - value)]


def _row(measured: np.ndarray, bound: list[float], seed: int) -> dict[str, Any]:
    low, high = interval(measured, seed)
    return {
        "measured": [float(measured.mean()), low, high],
        "bound": bound,
        "beaten": high < bound[1],
    }
