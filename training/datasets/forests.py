"""Classifiers of scikit-learn by trees, and their cross-validation; randomness is from the seed."""

from collections.abc import Callable
from typing import Any

import numpy as np

from training.extras import import_from_extra

EXTRA = "data"
USER = "`haizhe`"
TREES = 300  # of a forest
ROUNDS = 100  # of boosting, a tree per class each


def forest(seed: int) -> Any:
    """A random forest to be fitted, in which every class has the same weight."""
    ensemble = import_from_extra("sklearn.ensemble", EXTRA, USER)
    return ensemble.RandomForestClassifier(TREES, class_weight="balanced", random_state=seed)


def boosting(seed: int) -> Any:
    """Gradient boosting to be fitted, in which every class has the same weight.

    The settings are scikit-learn's own. With them no step is random: the seed changes nothing.
    """
    ensemble = import_from_extra("sklearn.ensemble", EXTRA, USER)
    return ensemble.HistGradientBoostingClassifier(
        max_iter=ROUNDS, class_weight="balanced", random_state=seed
    )


CLASSIFIERS: dict[str, Callable[[int], Any]] = {"forest": forest, "boosting": boosting}


def shuffled_folds(label: np.ndarray, n_folds: int, seed: int) -> np.ndarray:
    """A fold for each run (n_runs,), at random; every fold has its share of each label."""
    selection = import_from_extra("sklearn.model_selection", EXTRA, USER)
    splitter = selection.StratifiedKFold(n_folds, shuffle=True, random_state=seed)
    folds = np.empty(len(label), np.int64)
    for fold, (_, members) in enumerate(splitter.split(folds, label)):
        folds[members] = fold
    return folds


def cross_decide(
    classifier: Any, inputs: np.ndarray, label: np.ndarray, folds: np.ndarray
) -> np.ndarray:
    """Decision on each run, (n_runs,), of the classifier fitted to the other folds.

    `inputs` are (n_runs, n_inputs). Misleads where the folds share a cause that new data would not
    share, such as the day in the pool.
    """
    selection = import_from_extra("sklearn.model_selection", EXTRA, USER)
    splits = selection.PredefinedSplit(folds)
    return selection.cross_val_predict(classifier, inputs, label, cv=splits)
