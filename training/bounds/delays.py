"""Bounds on the delay of detection and isolation from the evidence for a fault.

Pure functions of log-likelihood ratios. Those over time are (n_samples, n_lanes): row m holds the
ratio of the readings up to sample m + 1 after onset, of vehicles with the fault. Sources: Lorden,
Ann. Math. Stat. 42 (1971) 1897; Lai, IEEE Trans. Inf. Theory 44 (1998) 2917; Nikiforov, IEEE Trans.
Inf. Theory 41 (1995) 171; Neyman & Pearson, Phil. Trans. R. Soc. A 231 (1933) 289.
"""

from collections.abc import Callable

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from training.metrics.intervals import Interval

RESAMPLES = 100
LARGEST_EXPONENT = 700.0


def asymptotic_delay(information_rate: np.ndarray | float, samples: float) -> np.ndarray | float:
    """Least mean delay [s] of detection, log(samples)/I; infinite without information.

    The same, log(1/beta)/I, bounds the isolation from a rival that may be mistaken for the fault
    with probability beta; I is then the rate against the rival.

    Misleads: it holds in the limit of rare false alarms, for the worst case over the time before
    onset. Where one sample says enough, it is below one sample, which no alarm can be. Where I is
    below log(samples)/samples it can be beaten: a detector that alarms at random with probability
    1/samples has a mean delay of `samples`. `detection_power` has no such limits.

    Parameters
    ----------
    information_rate
        Mean log-likelihood ratio against the healthy vehicle, under the fault [nat/s].
    samples
        Mean number of samples between false alarms.
    """
    with np.errstate(divide="ignore"):
        return np.log(samples) / np.maximum(information_rate, 0.0)


def neyman_pearson_power(llr: np.ndarray, level: np.ndarray | float) -> np.ndarray:
    """Greatest power of any test that mistakes a rival for the fault with probability `level`.

    The test is that of the likelihood ratio. Its power follows from lanes with the fault alone: the
    rival passes a threshold c with probability ``E_1[exp(-llr); llr > c]``. Every lane has its own
    rival; one threshold for all is optimal for the mean over lanes at a mean level, whatever is
    known of a lane (its vehicle, its severity).

    Misleads with few lanes, where one lane is a step in power, and with ratios that are not
    likelihood ratios (see `mean_inverse_ratio`).

    Parameters
    ----------
    llr
        Log-likelihood ratios of lanes with the fault, (..., n_lanes).
    level
        Probability that the rival may be mistaken for the fault, (...,).

    Returns
    -------
    power
        Probability of deciding for the fault, (...,).
    """
    descending = np.sort(llr, axis=-1)[..., ::-1]
    level_per_lane = np.exp(np.minimum(-descending, LARGEST_EXPONENT)) / llr.shape[-1]
    level_before = np.cumsum(level_per_lane, axis=-1) - level_per_lane
    level_left = np.expand_dims(level, -1) - level_before
    share = level_left / np.maximum(level_per_lane, np.finfo(float).tiny)
    power = np.clip(share, 0.0, 1.0).mean(axis=-1)
    return np.maximum(power, np.minimum(level, 1.0))


def detection_power(llr: np.ndarray, samples: float) -> np.ndarray:
    """Greatest probability of an alarm within m samples of onset, for m from 1 on, (n_samples,).

    Whether an alarm has begun depends on the readings up to then, so it is a test of the fault
    against the healthy vehicle. On healthy vehicles the probability that an alarm begins among m
    samples is at most the mean number of such alarms, m/samples, if alarms are equally frequent at
    all times; with random onsets this holds in the mean. By Neyman and Pearson no such test has
    more power. The bound needs neither rare false alarms nor independent samples.

    Parameters
    ----------
    llr
        Log-likelihood ratios over time, (n_samples, n_lanes).
    samples
        Mean number of samples between false alarms.
    """
    level = np.minimum(np.arange(1, len(llr) + 1) / samples, 1.0)
    return neyman_pearson_power(llr, level)


def delay_bound(power: np.ndarray) -> float:
    """Least restricted mean delay [s] of an event that has happened by sample m with `power[m]`.

    The horizon is len(power) samples. The delay is at least one sample.
    """
    return float(SAMPLE_TIME * (len(power) - power[:-1].sum()))


def right_for_good(is_right: np.ndarray) -> np.ndarray:
    """Time [s] from onset to the first sample from which a decision stays right, (n_lanes,).

    is_right is (n_samples, n_lanes), from the first sample after the onset to the horizon. A lane
    that is wrong at the horizon counts with the horizon. It is no bound, but what one diagnoser
    attains: another may be sooner.
    """
    number = np.arange(1, len(is_right) + 1)[:, None]
    last_wrong = np.where(is_right, 0, number).max(axis=0)
    return SAMPLE_TIME * np.minimum(last_wrong + 1, len(is_right))


def bootstrap(
    bound: Callable[[np.ndarray], float], n_lanes: int, seed: int, n: int = RESAMPLES
) -> Interval:
    """95 % interval of a bound, which is a function of the indices of the lanes to use."""
    random = np.random.default_rng(seed)
    values = [bound(random.integers(n_lanes, size=n_lanes)) for _ in range(n)]
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def mean_inverse_ratio(llr: np.ndarray) -> np.ndarray:
    """Mean of exp(-llr) over lanes (..., n_lanes) with the fault: 1 for likelihood ratios.

    It is the probability, under the rival, of readings that the fault can produce; below 1 the
    rival can produce others as well. Above 1 the low ratios are too low, and bounds from them too
    high. Misleads late after onset: ratios are large, few lanes determine the mean, and values that
    are too low by chance are common.
    """
    return np.exp(np.minimum(-llr, LARGEST_EXPONENT)).mean(axis=-1)


def information_rate(llr: np.ndarray) -> np.ndarray:
    """Mean gain of the log-likelihood ratio (n_samples, ...) after onset [nat/s], (...,)."""
    return llr[-1] * (SAMPLE_RATE / len(llr))


def late_rate(llr: np.ndarray) -> np.ndarray:
    """Mean gain of the log-likelihood ratio (n_samples, ...) over the second half [nat/s], (...,).

    By then the transient of an abrupt onset is over. The standard deviation of the rate of a single
    run is the square root of twice the rate divided by the time.
    """
    half = len(llr) // 2
    return (llr[-1] - llr[half - 1]) * (SAMPLE_RATE / (len(llr) - half))
