"""Physical indicators along a log: the residuals of the vehicle's own relations, in words.

Each is relative to what the relation predicts. The drag is the net force that lacks, relative to
the drag of the relations: lost thrust looks the same.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from diagnosers.relations.model import RelationModel
from diagnosers.relations.names import name_of, sign_of
from diagnosers.residuals import Residuals
from training.field.logs.log import Log

LARGEST_LIMIT = 5.0  # relative; a wider one belongs to a window that tells nothing


class LogCourse(NamedTuple):
    """The windows of all segments of a log, see `diagnosers.residuals.Course`."""

    rules: tuple[str, ...]  # in words
    n_residuals: int  # the first rules are the residuals
    time: np.ndarray  # (n,), of the last reading [s from the log's start]
    value: np.ndarray  # (n, n_rules), relative, or a share; the drag instead of the net force
    limit: np.ndarray  # (n, n_rules)
    std: np.ndarray  # (n, n_residuals)
    strength: np.ndarray  # (n, n_rules), 1 at the limit
    step: float  # from one window to the next [s]


class Indicator(NamedTuple):
    """One indicator in the windows that tell about it, relative; the healthy band is ± limit."""

    time: np.ndarray  # (n,) [s from the log's start]
    value: np.ndarray  # (n,)
    std: np.ndarray  # (n,), of a healthy vehicle in one window
    limit: np.ndarray  # (n,)


def course_of(log: Log, model: RelationModel) -> LogCourse:
    """The windows of a log, judged segment by segment."""
    diagnoser = Residuals(model)
    courses = [diagnoser.course(log.observation[segment]) for segment in log.segments]
    times = [
        log.time[segment][course.last]
        for segment, course in zip(log.segments, courses, strict=True)
    ]
    value, limit, std, strength = (
        np.concatenate([getattr(course, field) for course in courses])
        for field in ("value", "limit", "std", "strength")
    )
    return LogCourse(
        rules=rules_in_words(diagnoser),
        n_residuals=len(model.layout.residuals),
        time=np.concatenate(times),
        value=signs_in_words(diagnoser) * value,
        limit=limit,
        std=std,
        strength=strength,
        step=model.layout.every / model.layout.sample_rate,
    )


def rules_in_words(diagnoser: Residuals) -> tuple[str, ...]:
    """The rules of `residuals` with the residuals in words."""
    words = [name_of(name) for name in diagnoser.model.layout.residuals]
    lasting = [f"lasting {name}" for name in words]
    counts = diagnoser.rules[2 * len(words) :]
    return (*words, *lasting, *counts)


def signs_in_words(diagnoser: Residuals) -> np.ndarray:
    """The sign of the value of each rule in words, (n_rules,)."""
    residuals = diagnoser.model.layout.residuals
    signs = np.ones(len(diagnoser.rules))
    signs[: 2 * len(residuals)] = np.tile([sign_of(name) for name in residuals], 2)
    return signs


def indicators(course: LogCourse) -> dict[str, Indicator]:
    """The residuals by name that any window tells about."""
    found = {}
    for k, name in enumerate(course.rules[: course.n_residuals]):
        tells = course.limit[:, k] < LARGEST_LIMIT
        if tells.any():
            columns = (course.value[:, k], course.std[:, k], course.limit[:, k])
            found[name] = Indicator(course.time[tells], *(column[tells] for column in columns))
    return found


def indicators_during(
    course: LogCourse, begin: float, end: float
) -> dict[str, Mapping[str, float]]:
    """Medians of value, std and limit of each indicator over an alarm [s], where it has any."""
    found = {}
    for name, indicator in indicators(course).items():
        within = (indicator.time > begin - course.step) & (indicator.time <= end)
        if within.any():
            columns = {"value": indicator.value, "std": indicator.std, "limit": indicator.limit}
            found[name] = {key: float(np.median(of[within])) for key, of in columns.items()}
    return found
