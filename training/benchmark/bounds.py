"""The bounds of a benchmark: the least delays of any diagnoser, by stimulus and class.

`BOUNDS` and `CLASS_BOUNDS` say what `bounds_of` returns. Times are in seconds up to `HORIZON`, a
rate is "1 h" or "10 h" between false alarms, a value with its 95 % interval is [value, low, high].

`detection_delay` holds for any diagnoser with so few false alarms, `all.isolation_delay` for any:
no decision is right more often, in the mean over classes and severities, than the most likely
class, given vehicle and onset. `isolation_delay` of a class is against its most similar rival, and
holds for a diagnoser that confuses the two with a probability of at most `CONFUSED`. The asymptotic
figures may be beaten.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from auv_fault_env.faults import known_classes
from auv_fault_env.parameters import SAMPLE_RATE
from training.benchmark.scores import MEAN_TIMES, RANKED_AT
from training.bounds.delays import (
    asymptotic_delay,
    bootstrap,
    delay_bound,
    detection_power,
    information_rate,
    mean_inverse_ratio,
    neyman_pearson_power,
    right_for_good,
)
from training.bounds.information import (
    log_likelihoods_known_severity,
    log_likelihoods_unknown_severity,
    simulate_suite_lanes,
)
from training.metrics.intervals import interval
from training.metrics.plain import rounded
from training.metrics.records import HORIZON
from training.stimuli import Stimulus

PlainData = Mapping[str, Any]
PER_HOUR = 3600.0 * SAMPLE_RATE  # samples
# samples between false alarms
RATES = {rate: time * SAMPLE_RATE for rate, time in MEAN_TIMES.items()}
CONFUSED = 0.01
AMOC_RATES = np.geomspace(0.02, 500.0, 23)  # false alarms per hour
CALIBRATED_AT = (1.0, 3.0, 10.0)  # s after onset
LEVELS = (0.01, 0.05, 0.2)
# episodes of a class that are compared with its bound: the interval of fewer is far too narrow
FEWEST = 8
BOUNDS: dict[str, str] = {
    "classes": "by class `CLASS_BOUNDS`",
    "all": "means over the classes: detection_delay and isolation_delay by rate, with intervals, "
    "and isolation_attained as by class",
    "amoc": "{false_alarms_per_hour, delay}: least mean detection delay against false alarms",
    "calibration": "inverse_ratio by time: mean of the inverse likelihood ratios, 1 if they are "
    "exact, less where healthy vehicles can show what faulty ones cannot; healthy_beyond by level: "
    "share of healthy vehicles whose ratio ever exceeds 1/level, at most the level if they are "
    "exact (Ville's inequality)",
    "lanes": "their number, all classes together",
}
CLASS_BOUNDS: dict[str, str] = {
    "information_rate": "nat/s",
    "asymptotic_delay": "by rate",
    "detection_delay": "by rate, with its interval",
    "delay_by_rate": "at each of the rates of `amoc`",
    "rival": "the most similar class",
    "rival_rate": "information against it [nat/s]",
    "isolation_delay": "with its interval",
    "asymptotic_isolation": "asymptotic delay of isolation",
    "isolation_attained": "with its interval: mean time until the most likely class is right for "
    "good, by the bank that knows vehicle and onset; no bound, but what is known to be possible",
}


def bounds_of(stimulus: Stimulus, seed: int, n_lanes: int) -> dict[str, Any]:
    """All bounds under a stimulus, from so many lanes like those of the standard suite."""
    lanes = simulate_suite_lanes(stimulus, seed, n_lanes)
    known = log_likelihoods_known_severity(lanes)
    unknown = log_likelihoods_unknown_severity(lanes)
    diagnosis = lanes.diagnosis
    by_class = {}
    for k, name in enumerate(known_classes()):
        of_class = diagnosis == k
        if of_class.any():
            by_class[name] = _class_bounds(known[:, of_class], unknown[:, of_class], k, seed)
    healthy_lanes = simulate_suite_lanes(stimulus, seed, n_lanes, healthy=True)
    healthy = _true_class_ratio(log_likelihoods_known_severity(healthy_lanes), diagnosis)
    true_class = _true_class_ratio(known, diagnosis)
    detection = {}
    isolation = {}
    for rate, samples in RATES.items():
        detection[rate] = _mean([bounds["detection_delay"][rate] for bounds in by_class.values()])
        isolation[rate] = _isolation_of_all(unknown, true_class, diagnosis, samples, seed)
    delay = np.mean([bounds["delay_by_rate"] for bounds in by_class.values()], axis=0)
    return {
        "classes": by_class,
        "all": {
            "detection_delay": detection,
            "isolation_delay": isolation,
            "isolation_attained": _mean(
                [bounds["isolation_attained"] for bounds in by_class.values()]
            ),
        },
        "amoc": {
            "false_alarms_per_hour": rounded(AMOC_RATES),
            "delay": rounded(delay),
        },
        "calibration": _calibration(true_class, healthy),
        "lanes": n_lanes,
    }


def _true_class_ratio(log_likelihoods: np.ndarray, diagnosis: np.ndarray) -> np.ndarray:
    """Log ratio of each lane's true class to normal, (n_samples, n_lanes)."""
    lanes = np.arange(len(diagnosis))
    return log_likelihoods[:, lanes, diagnosis].astype(np.float64)


def _class_bounds(known: np.ndarray, unknown: np.ndarray, k: int, seed: int) -> dict[str, Any]:
    """Bounds of class k from the log ratios of its lanes, with severities known and unknown."""
    own = known[:, :, k].astype(np.float64)
    information = information_rate(own)
    rivals = [j for j in range(1, known.shape[2]) if j != k]
    rival = max(rivals, key=lambda j: _isolation_delay(own - unknown[:, :, j]))
    against_rival = own - unknown[:, :, rival]
    rival_information = information_rate(against_rival)
    asymptotic = {}
    detection = {}
    for rate, samples in RATES.items():

        def detection_delay(llr: np.ndarray, samples: float = samples) -> float:
            return delay_bound(detection_power(llr, samples))

        asymptotic[rate] = _mean_asymptotic_delay(information, samples)
        detection[rate] = _with_interval(own, detection_delay, seed)
    delays = [delay_bound(detection_power(own, PER_HOUR / rate)) for rate in AMOC_RATES]
    return {
        "information_rate": float(information.mean()),
        "asymptotic_delay": asymptotic,
        "detection_delay": detection,
        "delay_by_rate": [round(delay, 4) for delay in delays],
        "rival": known_classes()[rival],
        "rival_rate": float(rival_information.mean()),
        "isolation_delay": _with_interval(against_rival, _isolation_delay, seed),
        "asymptotic_isolation": _mean_asymptotic_delay(rival_information, 1.0 / CONFUSED),
        "isolation_attained": _attained(unknown, k, seed),
    }


def _attained(log_likelihoods: np.ndarray, k: int, seed: int) -> list[float]:
    """Mean time from which class k stays the most likely fault of its lanes, with its interval."""
    is_right = log_likelihoods[:, :, 1:].argmax(axis=2) + 1 == k
    times = right_for_good(is_right)
    return [float(times.mean()), *interval(times, seed)]


def _isolation_delay(against_rival: np.ndarray) -> float:
    return delay_bound(neyman_pearson_power(against_rival, CONFUSED))


def _mean_asymptotic_delay(information: np.ndarray, samples: float) -> float:
    delays = np.minimum(asymptotic_delay(information, samples), HORIZON)
    return float(delays.mean())


def _with_interval(llr: np.ndarray, bound: Callable[[np.ndarray], float], seed: int) -> list[float]:
    """A bound from log-likelihood ratios (n_samples, n_lanes), and its bootstrap interval."""
    low, high = bootstrap(lambda lanes: bound(llr[:, lanes]), llr.shape[1], seed)
    return [bound(llr), low, high]


def _mean(bounds: list[list[float]]) -> list[float]:
    """Mean of independent bounds, with the interval that follows from theirs."""
    value, low, high = np.array(bounds).T
    mean = value.mean()
    below = np.sqrt(np.square(value - low).sum()) / len(value)
    above = np.sqrt(np.square(high - value).sum()) / len(value)
    return [float(mean), float(mean - below), float(mean + above)]


def _isolation_of_all(
    unknown: np.ndarray,
    true_class: np.ndarray,
    diagnosis: np.ndarray,
    samples: float,
    seed: int,
) -> list[float]:
    """Least mean isolation time: only the most likely fault is named, once it has been detected."""
    is_right = unknown[:, :, 1:].argmax(axis=2) + 1 == diagnosis

    def bound(lanes: np.ndarray) -> float:
        of_lanes = diagnosis[lanes]
        detected = []
        for k in np.unique(of_lanes):
            of_class = lanes[of_lanes == k]
            detected.append(detection_power(true_class[:, of_class], samples))
        named = is_right[:, lanes].mean(axis=1)
        return delay_bound(np.minimum(named, np.mean(detected, axis=0)))

    n_lanes = len(diagnosis)
    return [bound(np.arange(n_lanes)), *bootstrap(bound, n_lanes, seed)]


def _calibration(true_class: np.ndarray, healthy: np.ndarray) -> dict[str, dict[str, float]]:
    """How nearly the ratios are likelihood ratios, by faulty lanes and the same without faults."""
    inverse_ratio = {}
    for time in CALIBRATED_AT:
        at_time = true_class[round(time * SAMPLE_RATE) - 1]
        inverse_ratio[f"{time:g} s"] = float(mean_inverse_ratio(at_time))
    highest = healthy.max(axis=0)
    beyond = {f"{level:g}": float((highest > -np.log(level)).mean()) for level in LEVELS}
    return {"inverse_ratio": inverse_ratio, "healthy_beyond": beyond}


def check(results: PlainData) -> list[dict[str, Any]]:
    """Whether any diagnoser has beaten a bound, from the results of a benchmark that has bounds.

    Only abrupt faults count, and classes with at least `FEWEST` of them. A bound is beaten when the
    intervals do not overlap and the measured one is lower. Detection is compared at the rate of
    false alarms that the diagnoser may really have, the upper end of its interval. Among hundreds
    of comparisons some intervals miss their truth: one narrow miss proves nothing, several of one
    diagnoser do.
    """
    rows: list[dict[str, Any]] = []
    for stimulus, bounds in results["bounds"].items():
        for name, score in results["scores"][stimulus].items():
            rows += _comparisons(stimulus, name, score, bounds, results)
    return rows


def _comparisons(
    stimulus: str, name: str, score: PlainData, bounds: PlainData, results: PlainData
) -> Iterator[dict[str, Any]]:
    lanes = score["by_lane"]
    seed = results["seeds"]["bootstrap"]
    is_abrupt = np.array(results["episodes"]["abrupt"], bool)
    fault = np.array(results["episodes"]["fault"])
    detection = np.array(lanes["detection"])
    isolation = np.array(lanes["isolation"])
    highest_rate = score["rates"][RANKED_AT]["false_alarms_per_hour_interval"][1]
    rate = max(1.0, highest_rate)
    rates = bounds["amoc"]["false_alarms_per_hour"]
    who = {"stimulus": stimulus, "diagnoser": name}
    for k, class_name in enumerate(results["classes"]):
        of_class = is_abrupt & (fault == k)
        if of_class.sum() >= FEWEST and class_name in bounds["classes"]:
            bound = _bound_at_rate(bounds["classes"][class_name], rates, rate)
            comparison = _comparison(detection[of_class], bound, seed)
            yield who | {"what": "detection", "class": class_name} | comparison
    bound = bounds["all"]["isolation_delay"][RANKED_AT]
    comparison = _comparison(isolation[is_abrupt], bound, seed)
    yield who | {"what": "isolation", "class": "all"} | comparison


def _bound_at_rate(of_class: PlainData, rates: list[float], rate: float) -> list[float]:
    """The detection bound of a class at a rate per hour, its interval that of one per hour."""
    value, low, high = of_class["detection_delay"][RANKED_AT]
    at_rate = float(np.interp(np.log(rate), np.log(rates), of_class["delay_by_rate"]))
    return [at_rate, at_rate - (value - low), at_rate + (high - value)]


def _comparison(measured: np.ndarray, bound: list[float], seed: int) -> dict[str, Any]:
    low, high = interval(measured, seed)
    return {
        "measured": [float(measured.mean()), low, high],
        "bound": bound,
        "beaten": high < bound[1],
    }
