"""Numbers as plain data, as JSON takes them."""

from typing import Any

import numpy as np

DIGITS = 4  # of rounded numbers, as many as a figure shows


def finite(value: float) -> float | None:
    """The value, None if infinite or NaN: JSON knows neither."""
    return value if np.isfinite(value) else None


def rounded(values: Any, digits: int = DIGITS) -> list[float]:
    """The values as a list of rounded numbers."""
    return np.round(np.asarray(values, np.float64), digits).tolist()
