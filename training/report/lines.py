"""Lines of the figures that show readings over time."""

import numpy as np


def line_without_band(values: np.ndarray) -> dict[str, list[float]]:
    """The values (n_samples,) as a line of the figure `transients`, which has no band."""
    series = np.round(values.astype(float), 6).tolist()
    return {"clean": series, "mean": series, "std": [0.0] * len(series)}


def rounded(values: np.ndarray) -> list[float | None]:
    """The values (n_samples,) with six digits; None for one that is not finite."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]
