"""The healthy band: how much healthy missions differ beyond the errors of their estimates."""

import numpy as np

UNIFORM = 3**0.5  # half-width of a uniform distribution by its standard deviation
PRIOR_UNITS = 4.0  # missions that the band of the vehicle file counts as
WIDEST = 0.9  # of a band, relative


def healthy_band(
    estimates: np.ndarray, variances: np.ndarray, std: float, file_band: float
) -> float:
    """Half-width of the healthy band of one parameter, relative, as of a uniform distribution.

    The variance between units beyond their errors (DerSimonian & Laird, Controlled Clinical Trials
    7 (1986) 177) is averaged with the file's band, which counts as `PRIOR_UNITS` units: after one
    mission the file's band stands, and after many missions theirs does. The error of the common
    estimate is added, because a diagnoser has to reckon with it.

    Misleads: variation by causes that the logs do not contain (fouling, cold water, a full battery)
    is not in it. Estimates and variances are of each mission or shaft, (n_units,), and relative, as
    are the standard deviation of the common estimate and the half-width in the vehicle file.
    """
    weights = 1.0 / variances
    n_units = weights.sum() ** 2 / np.sum(weights**2)  # effective
    between = between_variance(estimates, variances) if n_units > 1.0 else 0.0
    prior = (file_band / UNIFORM) ** 2
    total_weight = PRIOR_UNITS + n_units - 1.0
    variance = (PRIOR_UNITS * prior + (n_units - 1.0) * between) / total_weight
    return float(min(UNIFORM * np.sqrt(variance + std**2), WIDEST))


def between_variance(estimates: np.ndarray, variances: np.ndarray) -> float:
    """Variance between units beyond that of their estimates, at least two, (n_units,) each."""
    weights = 1.0 / variances
    total = weights.sum()
    mean = np.sum(weights * estimates) / total
    scatter = np.sum(weights * (estimates - mean) ** 2)
    excess = scatter - (len(estimates) - 1)
    return float(max(0.0, excess / (total - np.sum(weights**2) / total)))
