"""Scores of other benchmarks, computed as theirs, to compare with published figures.

All of them count samples, or whole runs, and none knows how soon a fault was found: read them
beside the isolation time, and no further than the comparison needs. Their delays are left out on
purpose: fddbenchmark's ADD takes a delay in samples times the step of the window once more, leaves
out the runs it missed, and counts an alarm that stands at onset as a delay of zero.

Label and decision are (n_samples, n_lanes) class indices over time, 0 is normal, as in
`training.metrics`; a decision is the fault named while the alarm stands. A share of nothing
is NaN.
"""

from typing import NamedTuple

import numpy as np

from training.metrics import NORMAL, confusion
from training.metrics.plain import finite


class Fddbenchmark(NamedTuple):
    """Scores of fddbenchmark; the last two are by class, (n_classes,)."""

    detection_tpr: float
    detection_fpr: float
    cdr: float
    tpr: np.ndarray
    fpr: np.ndarray


def fddbenchmark(label: np.ndarray, decision: np.ndarray, n_classes: int) -> Fddbenchmark:
    """Rates of detection, correct diagnosis rate, and the rates of each class.

    Detection: the share of the faulty samples at which any fault was named, and of the normal ones.
    CDR: the share of the faulty samples with a fault named at which it was the right one. By class:
    the share of its samples at which it was named, and the share of the *normal* samples at which
    it was.

    Misleads: samples of one run are not independent, the long ones rule, and CDR grows if only easy
    faults are named. Source: https://github.com/airi-industrial-ai/fddbenchmark,
    `FDDEvaluator.evaluate`, commit 0d1b9c0 (2023); every sample ends a window, which is its step of
    1.
    """
    matrix = confusion(label.ravel(), decision.ravel(), n_classes)
    faulty = matrix[1:]
    named = faulty[:, 1:].sum()
    return Fddbenchmark(
        _share(named, faulty.sum()),
        _share(matrix[0, 1:].sum(), matrix[0].sum()),
        _share(np.trace(faulty[:, 1:]), named),
        np.array([_share(row[k], row.sum()) for k, row in enumerate(matrix)]),
        np.array([_share(count, matrix[0].sum()) for count in matrix[0]]),
    )


def true_detection_rate(label: np.ndarray, decision: np.ndarray) -> float:
    """TDR of DX 2025: share of the samples with a fault at which any fault is detected.

    An alarm from before the fault counts as detected: read it beside `false_alarm_rate`. Source:
    the competitions' page, https://vehsys.gitlab-pages.liu.se/dx25benchmarks (LiU-ICE and SLIDe
    share the definitions).
    """
    return _share((decision[label != NORMAL] != NORMAL).sum(), (label != NORMAL).sum())


def false_alarm_rate(label: np.ndarray, decision: np.ndarray) -> float:
    """FAR of DX 2025: share of the samples without a fault at which one is detected.

    The page of the competition scores 1 - FAR. A share of samples, not a number of alarms: one
    alarm that stays is worse than a hundred that do not. Source: as `true_detection_rate`.
    """
    return _share((decision[label == NORMAL] != NORMAL).sum(), (label == NORMAL).sum())


def fault_isolation_accuracy(
    label: np.ndarray, decision: np.ndarray, log_probability: np.ndarray
) -> float:
    """FIA of DX 2025: mean probability of the true fault over the samples with a detection.

    log_probability (..., n_classes) goes with label and decision (...,), at all samples or at some
    drawn at random. The competition's isolation sums to 1 over the faults, so the probability is
    that among faults. Misleads: a diagnoser that detects late isolates well; read it beside
    `true_detection_rate`. Source: as there.
    """
    chosen = (label != NORMAL) & (decision != NORMAL)
    log_probability = log_probability[chosen].astype(np.float64)
    label = label[chosen]
    among_faults = log_probability[:, 1:] - np.logaddexp.reduce(
        log_probability[:, 1:], axis=1, keepdims=True
    )
    return _share(np.exp(among_faults[np.arange(len(label)), label - 1]).sum(), len(label))


def utility(diagnosed: np.ndarray, true: np.ndarray) -> np.ndarray:
    """m_utl: the worth of a diagnosis for repair, 1 if right; sets (..., n_components), bool.

    ``1 - n (N + 1) / (f (n + 1)) - m (M + 1) / (f (m + 1))`` with f components, n of them wrongly
    diagnosed of the N diagnosed, and m faults missed among the M components that are not: the
    expected share of the components that are touched in vain. Misleads: to say nothing has almost
    half of the worth where one component is at fault.

    Source: Feldman et al., "Empirical evaluation of diagnostic algorithm performance using a
    generic framework", IJPHM 1(2), 2010; the readme of https://github.com/jdekleer/dxc26synth,
    commit 6da03bd (DXC'26).
    """
    n_components = true.shape[-1]
    size = diagnosed.sum(axis=-1)
    wrong = (diagnosed & ~true).sum(axis=-1)
    missed = (true & ~diagnosed).sum(axis=-1)
    in_vain = wrong * (size + 1) / (wrong + 1) + missed * (n_components - size + 1) / (missed + 1)
    return 1.0 - in_vain / n_components


def mean_utility(label: np.ndarray, decision: np.ndarray, n_classes: int) -> float:
    """m_utl of DXC'26 over lanes, each fault class being a component.

    At most one is diagnosed and one is true in a lane. As there, the last fault named in a lane
    counts, even if the alarm has ended since.
    """
    components = np.arange(1, n_classes)
    diagnosed, true = (_last(classes)[:, None] == components for classes in (decision, label))
    return float(utility(diagnosed, true).mean())


def scores(
    label: np.ndarray,
    decision: np.ndarray,
    instants: np.ndarray,
    log_probability: np.ndarray,
    n_classes: int,
) -> dict[str, float | None]:
    """All scores by name, None for NaN; label and decision (n_samples, n_lanes).

    FIA is estimated at random `instants` (n_instants, n_lanes), where the whole belief is known:
    log_probability (n_instants, n_lanes, n_classes). The last class, `unknown`, is no component.
    """
    there = instants, np.arange(label.shape[1])
    fdd = fddbenchmark(label, decision, n_classes)
    found = {
        "fddbenchmark TPR": fdd.detection_tpr,
        "fddbenchmark FPR": fdd.detection_fpr,
        "fddbenchmark CDR": fdd.cdr,
        "DX'25 TDR": true_detection_rate(label, decision),
        "DX'25 FAR": false_alarm_rate(label, decision),
        "DX'25 FIA": fault_isolation_accuracy(label[there], decision[there], log_probability),
        "DXC'26 m_utl": mean_utility(label, decision, n_classes - 1),
    }
    return {name: finite(value) for name, value in found.items()}


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")


def _last(classes: np.ndarray) -> np.ndarray:
    """The last class over time that is not normal, (n_lanes,), normal if there is none."""
    ago = (classes[::-1] != NORMAL).argmax(axis=0)
    return classes[len(classes) - 1 - ago, np.arange(classes.shape[1])]
