"""Is a filter honest about its errors? Normalised errors and innovations, and the band they should stay in.

Source: Bar-Shalom, Li & Kirubarajan, "Estimation with Applications to Tracking and Navigation",
Wiley 2001, 5.4.
"""

import numpy as np
from scipy.stats import chi2

from diagnosers.kalman import Estimate


def nees(estimate: Estimate, truth: np.ndarray) -> np.ndarray:
    """Normalised estimation error squared (n_lanes,) of the first m states; truth (n_lanes, m) in the mean's units.

    Chi-square with m degrees of freedom if the filter's model is true, so its mean over lanes is m;
    above it the filter is overconfident. Misleads over time: successive values of one lane are
    correlated.
    """
    m = truth.shape[1]
    error = truth - estimate.mean[:, :m]
    whitened = np.linalg.solve(estimate.covariance[:, :m, :m], error[..., None])[..., 0]
    return np.einsum("li,li->l", error, whitened)


def nis(estimate: Estimate) -> np.ndarray:
    """Normalised innovation squared (n_lanes,), chi-square of one degree; blind to drag against thrust at cruise."""
    return estimate.innovation**2 / estimate.innovation_variance


def band(freedom: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Chi-square band of the mean of n independent values of ``freedom`` degrees of freedom each."""
    low, high = chi2.interval(level, freedom * n)
    return float(low / n), float(high / n)
