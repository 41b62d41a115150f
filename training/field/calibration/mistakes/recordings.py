"""Logs that are the same recording."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from training.field.calibration.mistakes.finding import Finding
from training.field.logs.log import Log

EQUAL = 0.99  # share of equal values in two copies of a recording


def recording_findings(logs: Sequence[Log]) -> list[Finding]:
    """Findings on logs whose readings are those of an earlier one."""
    findings = []
    for one, other in combinations(logs, 2):
        share = _equal_share(one.observation, other.observation)
        if share > EQUAL:
            evidence = f"{100 * share:.0f} % of its values are those of {one.name}"
            cause = "is it a copy, that no check by the other logs can trust?"
            findings.append(Finding((), evidence, cause, "leave it out", other.name))
    return findings


def _equal_share(one: np.ndarray, other: np.ndarray) -> float:
    """Share of equal values where both have one that is not zero; 0 for other lengths."""
    if one.shape != other.shape:
        return 0.0
    is_known = np.isfinite(one) & np.isfinite(other) & ((one != 0.0) | (other != 0.0))
    return float(np.mean(one[is_known] == other[is_known])) if is_known.any() else 0.0
