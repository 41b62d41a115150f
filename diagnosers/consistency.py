"""Normalised errors and innovations of a filter, and the band in which a consistent filter stays.

Source: Bar-Shalom, Li & Kirubarajan, "Estimation with Applications to Tracking and Navigation",
Wiley 2001, 5.4.
"""

import numpy as np
from scipy.stats import chi2

from diagnosers.kalman import Estimate


def nees(estimate: Estimate, truth: np.ndarray) -> np.ndarray:
    """Normalised estimation error squared (n_lanes,) of the first m states; truth is (n_lanes, m).

    Chi-square with m degrees of freedom if the model is true; with a mean above m the filter is
    overconfident. Misleads over time: successive values of one lane are correlated.
    """
    m = truth.shape[1]
    error = truth - estimate.mean[:, :m]
    covariance = estimate.covariance[:, :m, :m]
    whitened = np.linalg.solve(covariance, error[..., None])[..., 0]
    return np.einsum("li,li->l", error, whitened)


def nis(estimate: Estimate) -> np.ndarray:
    """Normalised innovation squared (n_lanes,), chi-square of one degree of freedom.

    Misleads at cruise: it does not show an error of drag and thrust in the same proportion.
    """
    return estimate.innovation**2 / estimate.innovation_variance


def consistency_band(freedom: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Band of the mean of n independent chi-square values of ``freedom`` degrees of freedom."""
    low, high = chi2.interval(level, freedom * n)
    return float(low / n), float(high / n)
