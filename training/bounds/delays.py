"""How soon a fault can be detected or isolated at all, given how fast the evidence for it gathers.

Pure functions of log-likelihood ratios. Those over time are (n_samples, n_lanes): row m holds the
ratio of the readings up to sample m + 1 after onset, drawn under the fault. Sources: Lorden, Ann.
Math. Stat. 42 (1971) 1897; Lai, IEEE Trans. Inf. Theory 44 (1998) 2917; Nikiforov, IEEE Trans. Inf.
Theory 41 (1995) 171; Neyman & Pearson, Phil. Trans. R. Soc. A 231 (1933) 289.
"""

from collections.abc import Callable

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from training.metrics.intervals import Interval

RESAMPLES = 100
LARGEST_EXPONENT = 700.0


def asymptotic_delay(information_rate: np.ndarray | float, samples: float) -> np.ndarray | float:
    """Least mean delay [s] of detection, log(samples)/I, infinite without information.

    Parameters
    ----------
    information_rate
        Mean log-likelihood ratio against the healthy vehicle, under the fault [nat/s].
    samples
        Mean number of samples between false alarms.

    The same, log(1/beta)/I, bounds the isolation from a rival that may be taken for the fault with
    probability beta, I then being the rate against it. Misleads: it holds in the limit of rare
    false alarms, of the worst case over what was before the onset. Where a sample tells more than
    is asked for it is below one sample, which no alarm can be; where it tells little it may be
    beaten: a detector that alarms by a coin with chance 1/samples has a mean delay of `samples`,
    which is below log(samples)/I once I is below log(samples)/samples. `detection_power` has no
    such limit.
    """
    with np.errstate(divide="ignore"):
        return np.log(samples) / np.maximum(information_rate, 0.0)


def neyman_pearson_power(llr: np.ndarray, level: np.ndarray | float) -> np.ndarray:
    """Greatest chance of deciding for a fault, (...,), of any test that a rival passes with a chance of only `level`.

    The likelihood-ratio test, from samples under the fault alone: a threshold c is passed by the
    rival with chance ``E_1[exp(-llr); llr > c]``. The rival is that of each lane, and one threshold
    for all is optimal for the mean over lanes at a mean level, whatever of a lane is known (its
    vehicle, its severity). Misleads with few lanes: one lane more or less is a step in power; and
    with ratios that are no likelihood ratios (see `mean_inverse_ratio`).

    Parameters
    ----------
    llr
        Log-likelihood ratios of lanes with the fault, (..., n_lanes).
    level
        Chance allowed to the rival, (...,).
    """
    spent = np.exp(np.minimum(-np.sort(llr, axis=-1)[..., ::-1], LARGEST_EXPONENT)) / llr.shape[-1]
    left = np.expand_dims(level, -1) - (np.cumsum(spent, axis=-1) - spent)
    power = np.clip(left / np.maximum(spent, np.finfo(float).tiny), 0.0, 1.0).mean(axis=-1)
    return np.maximum(power, np.minimum(level, 1.0))


def detection_power(llr: np.ndarray, samples: float) -> np.ndarray:
    """Greatest chance that an alarm has begun within m samples of onset, m from 1 on: (n_samples,).

    Whether one has is decided by the readings up to then, so it is a test of the fault against the
    healthy vehicle. On healthy vehicles the chance that an alarm begins among m samples is at most
    the mean number that begins, m/samples, if alarms come as often at any time as at any other,
    which onsets drawn at random make so in the mean. By Neyman and Pearson no such test has more
    power. Neither large samples nor independence are needed.
    """
    level = np.minimum(np.arange(1, len(llr) + 1) / samples, 1.0)
    return neyman_pearson_power(llr, level)


def delay_bound(power: np.ndarray) -> float:
    """Least restricted mean delay [s], the horizon being len(power) samples, of what by sample m happens with `power`.

    It can be no sooner than one sample after the onset.
    """
    return float(SAMPLE_TIME * (len(power) - power[:-1].sum()))


def bootstrap(
    bound: Callable[[np.ndarray], float], n_lanes: int, seed: int, n: int = RESAMPLES
) -> Interval:
    """95 % interval of a bound, a function of which lanes (indices) it is computed from."""
    random = np.random.default_rng(seed)
    values = [bound(random.integers(n_lanes, size=n_lanes)) for _ in range(n)]
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def mean_inverse_ratio(llr: np.ndarray) -> np.ndarray:
    """Mean of exp(-llr) over lanes (..., n_lanes) with the fault: 1 if these are likelihood ratios, less is honest too.

    It is the chance, under the rival, of readings that the fault can produce. Above 1 the low ones
    are too low, and bounds from them too high; late, where they are large, few lanes carry the
    mean, and chance low values are the rule.
    """
    return np.exp(np.minimum(-llr, LARGEST_EXPONENT)).mean(axis=-1)


def information_rate(llr: np.ndarray) -> np.ndarray:
    """Mean gain of the log-likelihood ratio (n_samples, ...) from onset to the horizon [nat/s], (...,)."""
    return llr[-1] * (SAMPLE_RATE / len(llr))


def late_rate(llr: np.ndarray) -> np.ndarray:
    """Mean gain of the log-likelihood ratio (n_samples, ...) over the second half [nat/s], (...,).

    What the shock of an abrupt onset says is over by then. Read off a single run it scatters by the
    square root of twice the rate over the time.
    """
    half = len(llr) // 2
    return (llr[-1] - llr[half - 1]) * (SAMPLE_RATE / (len(llr) - half))
