"""How much healthy missions differ from each other beyond the errors of their estimates: the healthy band."""

import numpy as np

UNIFORM = 3**0.5  # half-width of a uniform distribution by its standard deviation
PRIOR_UNITS = 4.0  # missions that the band of the vehicle file counts as
WIDEST = 0.9  # of a band, relative


def healthy_band(own: np.ndarray, variance: np.ndarray, std: float, band: float) -> float:
    """Half-width of the healthy band of one parameter, relative, as that of a uniform distribution.

    The spread between units beyond their errors (DerSimonian & Laird, Controlled Clinical Trials 7
    (1986) 177) is averaged with the file's band, which counts as `PRIOR_UNITS` units: one mission
    says nothing of a spread, so the file's band stands, and with many missions theirs does. The
    error of the common estimate is added, because a diagnoser has to reckon with it.

    Parameters
    ----------
    own, variance
        (n_units,) estimate of each mission or shaft, relative to the common one, and its variance.
    std
        Standard deviation of the common estimate, relative.
    band
        Half-width in the vehicle file, relative.

    Misleads: a spread by things the logs did not go through (fouling, cold water, a full battery)
    is not in it.
    """
    weight = 1.0 / variance
    units = weight.sum() ** 2 / np.sum(weight**2)
    between = between_variance(own, variance) if units > 1.0 else 0.0
    prior = (band / UNIFORM) ** 2
    tau = (PRIOR_UNITS * prior + (units - 1.0) * between) / (PRIOR_UNITS + units - 1.0)
    return float(min(UNIFORM * np.sqrt(tau + std**2), WIDEST))


def between_variance(own: np.ndarray, variance: np.ndarray) -> float:
    """Variance between units beyond that of their estimates, (n_units,) each, at least two; never negative."""
    weight = 1.0 / variance
    total = weight.sum()
    scatter = np.sum(weight * (own - np.sum(weight * own) / total) ** 2)
    return float(max(0.0, (scatter - (len(own) - 1)) / (total - np.sum(weight**2) / total)))
