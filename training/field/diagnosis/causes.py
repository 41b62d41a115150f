"""Which rule raised which alarm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from auv_fault_env.faults import classes
from diagnosers import Belief
from diagnosers.residuals import COUNTS, PERSISTENT, Residuals
from training.field.diagnosis.indicators import LogCourse, rules_in_words, signs_in_words
from training.field.logs.log import Log
from training.report.cells import percent, signed_percent

PROBABILITY = "probability"  # p(normal) below the threshold
LOAD_LIMIT = "load limit"  # the load of a shaft beyond that of the healthy logs


@dataclass(frozen=True)
class Cause:
    """An alarm and the rule that raised it."""

    begin: float  # s from the log's start
    end: float
    rule: str
    fault: str  # most probable class at the end
    # of a rule of `residuals`: medians over the windows of the alarm that are beyond the limit
    value: float | None = None  # relative to what is predicted, or a share
    limit: float | None = None  # of the absolute value

    @property
    def text(self) -> str:
        """The rule, with value and limit in per cent where it has them."""
        if self.value is None or self.limit is None:
            return self.rule
        return rule_text(self.rule, self.value, self.limit)


def rule_text(rule: str, value: float, limit: float) -> str:
    """A rule of `residuals` with value and limit in per cent.

    >>> rule_text("port load", 0.62, 0.15)
    'port load +62 % (limit ±15 %)'
    >>> rule_text("zeros of port_rpm", 0.5, 0.3)
    'zeros of port_rpm 50 % (limit 30 %)'
    """
    if rule.startswith(COUNTS):
        return f"{rule} {percent(value)} (limit {percent(limit)})"
    return f"{rule} {signed_percent(value)} (limit ±{percent(limit)})"


def strongest_rule(diagnoser: Residuals) -> str:
    """What is farthest beyond its limit on the first lane now."""
    state = diagnoser.running.state
    rule = int(diagnoser.strongest(state)[0])
    value = signs_in_words(diagnoser)[rule] * state.value[0, rule]
    return rule_text(rules_in_words(diagnoser)[rule], value, state.limit[0, rule])


def causes(
    log: Log,
    alarms: Sequence[tuple[float, float]],
    belief: Belief,
    is_improbable: np.ndarray,
    course: LogCourse | None = None,
) -> tuple[Cause, ...]:
    """The cause of each alarm; the course is that of `residuals`, None for other diagnosers.

    `is_improbable` (n_samples,) is where p(normal) alone raises an alarm.
    """
    names = classes()
    found = []
    for begin, end in alarms:
        first, last = np.searchsorted(log.time, (begin, end))
        fault = names[1 + int(belief.log_probability[last, 1:].argmax())]
        if course is None:
            rule = PROBABILITY if is_improbable[first] else LOAD_LIMIT
            found.append(Cause(begin, end, rule, fault))
        else:
            found.append(by_rule(begin, end, fault, course))
    return tuple(found)


def by_rule(begin: float, end: float, fault: str, course: LogCourse) -> Cause:
    """The cause of an alarm of `residuals`: the rule that was strongest at its begin."""
    first = int(np.searchsorted(course.time, begin, side="right")) - 1
    last = int(np.searchsorted(course.time, end, side="right")) - 1
    rule = int(course.strength[first].argmax())
    chosen = slice(max(first - PERSISTENT + 1, 0), last + 1)
    value = course.value[chosen, rule]
    limit = course.limit[chosen, rule]
    beyond = np.abs(value) > limit
    return Cause(
        begin=begin,
        end=end,
        rule=course.rules[rule],
        fault=fault,
        value=float(np.median(value[beyond])),
        limit=float(np.median(limit[beyond])),
    )
