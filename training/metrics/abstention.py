"""What a diagnoser would gain if it named a fault only where it is sure."""

from typing import NamedTuple

import numpy as np


class RiskCoverage(NamedTuple):
    """Share of wrong names among the beliefs named, by the share that is named, (n,) each."""

    coverage: np.ndarray
    risk: np.ndarray


def known_confidence(
    log_probability: np.ndarray, truth: np.ndarray, unknown: int
) -> tuple[np.ndarray, np.ndarray]:
    """Probability of the most probable known class, and whether that is the true one, (n,) each.

    The probability of the class `unknown` is that of no known class, so it lowers the confidence.
    log_probability is (n, n_classes), truth (n,).
    """
    known = log_probability.copy()
    known[:, unknown] = -np.inf
    return np.exp(known.max(axis=1)), known.argmax(axis=1) == truth


def risk_coverage(confidence: np.ndarray, right: np.ndarray) -> RiskCoverage:
    """Risk against coverage, the surest beliefs named first; confidence and right are (n,).

    Beliefs of equal confidence are named together, so their order does not matter. Depends on how
    difficult the beliefs are: compare on the same ones only. Source: El-Yaniv & Wiener, "On the
    foundations of noise-free selective classification", JMLR 11 (2010) 1605.
    """
    order = np.argsort(-confidence, kind="stable")
    descending = confidence[order]
    is_last = np.append(descending[1:] != descending[:-1], True)
    count = np.arange(1, len(order) + 1)
    risk = np.cumsum(~right[order]) / count
    return RiskCoverage((count / len(order))[is_last], risk[is_last])


def area(curve: RiskCoverage) -> float:
    """Area under risk against coverage: 0 if nothing is ever wrong.

    Each step of the curve counts with the risk at its end. A diagnoser that is wrong as often but
    knows when has the smaller area; one that is never wrong has none whatever its confidence. Read
    it beside the risk at full coverage.
    """
    widths = np.diff(curve.coverage, prepend=0.0)
    return float(widths @ curve.risk)


def risk_at(curve: RiskCoverage, coverage: float) -> float:
    """Risk of the smallest set of surest beliefs that has at least this share of them."""
    return float(curve.risk[np.searchsorted(curve.coverage, coverage - 1e-12)])
