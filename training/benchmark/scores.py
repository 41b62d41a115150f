"""The score of a diagnoser under a stimulus, as a table of metrics.

`METRICS` is the only list of what a score holds: scores are computed from it, the columns of the
leaderboard and of results.csv are taken from it, and the page prints its meanings. A new metric is
one entry here, and a figure on the page if it needs one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from training import metrics
from training.benchmark import score_series
from training.benchmark.assessment import DECISION_TIME, Assessment, assess
from training.benchmark.trials import FaultyOutcome, LaneTruth
from training.metrics import Edges, Times, naming
from training.metrics.healthy_time import CountedAlarms
from training.metrics.intervals import Interval, f1_interval, interval, poisson_interval
from training.metrics.plain import finite, rounded
from training.metrics.records import HIGHEST_THRESHOLD, HORIZON, SEVERITY_AT, HealthyOutcome
from training.report.cells import number, percent, seconds, with_interval

MEAN_TIMES = {
    "1 h": 3600.0,
    "10 h": 36000.0,
}  # s between false alarms that thresholds are set for
RANKED_AT = "1 h"
Score = Mapping[str, Any]


class TrialOutcomes(NamedTuple):
    """What a diagnoser under a stimulus is scored on."""

    threshold: HealthyOutcome  # lanes that its thresholds are set on, under all stimuli
    counting: HealthyOutcome  # lanes of this stimulus on which false alarms are counted
    faulty: FaultyOutcome  # lanes of this stimulus
    cruise: FaultyOutcome | None  # the same lanes under `cruise`, None if that was not run


class RateInputs(NamedTuple):
    """What the metrics at one rate of false alarms are computed from."""

    assessment: Assessment
    truth: LaneTruth
    mean_time: float  # s between false alarms that the threshold is set for
    seed: int  # of the bootstrap


class ScoreInputs(NamedTuple):
    """What the metrics of a score are computed from."""

    assessments: Mapping[str, Assessment]  # by rate
    truth: LaneTruth
    outcomes: TrialOutcomes
    worst: list[dict[str, Any]]  # the worst episodes as plain data
    seed: int  # of the bootstrap

    @property
    def ranked(self) -> Assessment:
        """The assessment at the rate that diagnosers are ranked at."""
        return self.assessments[RANKED_AT]

    def at_rate(self, rate: str) -> RateInputs:
        """What the metrics at a rate of `MEAN_TIMES` are computed from."""
        return RateInputs(self.assessments[rate], self.truth, MEAN_TIMES[rate], self.seed)


class Column(NamedTuple):
    """A column of the leaderboard: its heading, and the text of its cell from a score."""

    heading: str
    cell: Callable[[Score], str]


@dataclass(frozen=True)
class Metric:
    """One entry of a score."""

    key: str  # in results.json
    compute: Callable[[Any], Any]  # plain data from `ScoreInputs`, or from `RateInputs`
    meaning: str  # what it is, with its unit
    misleads: str = ""  # and beside what it must be read; empty for what is no merit
    csv: tuple[str, ...] = ()  # columns in results.csv; of a dictionary its keys after the metric's
    columns: tuple[Column, ...] = ()  # in the leaderboard


def false_alarm_rate_interval(inputs: RateInputs) -> tuple[float, float]:
    """Poisson interval of the false alarms per hour."""
    return poisson_interval(inputs.assessment.false_alarms, inputs.assessment.hours)


def is_rate_as_set(inputs: RateInputs) -> bool:
    """Whether the interval of the rate holds the rate that the threshold is set for."""
    low, high = false_alarm_rate_interval(inputs)
    return low <= 3600.0 / inputs.mean_time <= high


def time_figures(times: Times, seed: int) -> dict[str, Any]:
    """Figures of times [s] that are censored at the horizon."""
    return {
        "restricted_mean": metrics.restricted_mean(times),
        "interval": interval(times.time, seed),
        "probability": metrics.probability(times),
        "median": finite(metrics.kaplan_meier_median(times)),
    }


def alarms_by_age(counted: CountedAlarms) -> dict[str, list[Any]]:
    """False alarms by age of the mission as plain data; an age without end is given as None."""
    pairs = zip(counted.alarms.tolist(), counted.hours.tolist(), strict=True)
    return {
        "from": rounded(counted.first),
        "to": [finite(minutes) for minutes in counted.last.tolist()],
        "alarms": counted.alarms.tolist(),
        "hours": rounded(counted.hours),
        "per_hour_interval": [poisson_interval(*pair) for pair in pairs],
    }


def alarms_by_quarter(assessment: Assessment) -> dict[str, Any]:
    """False alarms by quarter of the missions as plain data."""
    counts = assessment.by_quarter.tolist()
    hours = assessment.hours / len(counts)
    intervals = [poisson_interval(count, hours) for count in counts]
    return {"alarms": counts, "hours": hours, "per_hour_interval": intervals}


def times_by_onset(
    times: Times, is_abrupt: np.ndarray, seed: int
) -> dict[str, dict[str, Any] | None]:
    """Figures of the times of abrupt and of ramped faults, None for a kind without a lane."""
    figures: dict[str, dict[str, Any] | None] = {}
    for kind, chosen in (("abrupt", is_abrupt), ("ramped", ~is_abrupt)):
        of_kind = Times(times.time[chosen], times.censored[chosen])
        figures[kind] = time_figures(of_kind, seed) if chosen.any() else None
    return figures


def macro_f1(assessment: Assessment) -> float:
    """Macro-F1 of the decisions at `DECISION_TIME`."""
    matrix = metrics.confusion(assessment.label, assessment.decision, len(classes()))
    return float(metrics.macro_f1(matrix))


def macro_f1_interval(inputs: ScoreInputs) -> tuple[float, float]:
    """Bootstrap interval of `macro_f1`."""
    ranked = inputs.ranked
    return f1_interval(ranked.label, ranked.decision, len(classes()), inputs.seed)


def severity_error(inputs: ScoreInputs) -> Any:
    """Error of the severity by lane whose fault is a known one, (n_known,)."""
    known = score_series.known_faults(inputs.truth.at_instants)
    truth = inputs.truth.at_instants.severity[0, known]
    return metrics.severity_error(inputs.ranked.severity[known], truth)


def severity_mae(inputs: ScoreInputs) -> float | None:
    """Mean of `severity_error`; None without known faults."""
    error = severity_error(inputs)
    return float(error.mean()) if error.size else None


def severity_mae_interval(inputs: ScoreInputs) -> Interval | None:
    """Bootstrap interval of `severity_mae`; None without known faults."""
    error = severity_error(inputs)
    return interval(error, inputs.seed) if error.size else None


def severity_coverage(inputs: ScoreInputs, share: float) -> float | None:
    """Share of the true severities of known faults in the intervals that should hold `share`.

    None without known faults.
    """
    known = score_series.known_faults(inputs.truth.at_instants)
    ranked = inputs.ranked
    truth = inputs.truth.at_instants.severity[0, known]
    inside = metrics.covered(ranked.severity[known], ranked.severity_std[known], truth, share)
    return float(inside.mean()) if inside.size else None


def calibration_error(assessment: Assessment) -> float:
    """Expected calibration error of beliefs at random instants."""
    return metrics.expected_calibration_error(assessment.confidence, assessment.right)


def _interval_column(heading: str, key: str, digits: int) -> Column:
    """The column of a metric that has an interval under `key`_interval."""

    def cell(score: Score) -> str:
        value = score[key]
        return "–" if value is None else with_interval(value, score[f"{key}_interval"], digits)

    return Column(heading, cell)


def _isolation_cell(score: Score) -> str:
    isolation = score["isolation"]
    return with_interval(isolation["restricted_mean"], isolation["interval"], 2)


def _coverage_cell(score: Score) -> str:
    share = score["severity_coverage"]
    return "–" if share is None else percent(share)


def _detection_cell(score: Score) -> str:
    return f"{score['detection']['restricted_mean']:.2f}"


TIMES = "{restricted_mean, interval, probability, median} in seconds, censored at the horizon"
RATE_METRICS = (
    Metric(
        "threshold",
        lambda at: finite(at.assessment.threshold),
        "log p(normal) below which the alarm condition holds; null for minus infinity: no alarm",
        csv=("threshold",),
    ),
    Metric(
        "false_alarms",
        lambda at: at.assessment.false_alarms,
        "alarms on the healthy lanes on which they are counted",
        "An alarm that never ends counts once.",
        csv=("false_alarms",),
    ),
    Metric(
        "false_alarm_vehicles",
        lambda at: at.assessment.false_alarm_vehicles,
        "how many of these lanes had an alarm",
    ),
    Metric(
        "hours",
        lambda at: at.assessment.hours,
        "healthy operation on which they are counted [h]",
        csv=("hours",),
    ),
    Metric(
        "false_alarms_per_hour",
        lambda at: at.assessment.false_alarms / at.assessment.hours,
        "false alarms per hour",
        "From few alarms: read it with its interval.",
        csv=("false_alarms_per_hour",),
    ),
    Metric(
        "false_alarms_per_hour_interval",
        false_alarm_rate_interval,
        "its 95 % interval (Poisson)",
        "Takes alarms as independent; those that flicker are not, and the true interval is wider.",
    ),
    Metric(
        "time_in_alarm",
        lambda at: at.assessment.alarm_hours / at.assessment.hours,
        "share of the healthy operation during which an alarm stands",
        "Does not say how often: an hour may be one alarm or sixty.",
        csv=("time_in_alarm",),
    ),
    Metric(
        "false_alarms_by_age",
        lambda at: alarms_by_age(at.assessment.by_age),
        "{from, to, alarms, hours, per_hour_interval}: false alarms by the age of the mission "
        "[min] at their beginning",
        "Only long missions reach great ages; few hours scatter widely.",
    ),
    Metric(
        "false_alarms_by_quarter",
        lambda at: alarms_by_quarter(at.assessment),
        "{alarms, hours, per_hour_interval}: false alarms by quarter of the mission",
        "Adds quarters of short and of long missions: read it beside the ages.",
    ),
    Metric(
        "rate_as_set",
        is_rate_as_set,
        "whether that interval holds the rate that the threshold is set for",
        "From few hours almost any rate is as set.",
    ),
    Metric(
        "isolation",
        lambda at: time_figures(at.assessment.isolation, at.seed),
        f"time from onset to the last interval with the right class: {TIMES}",
        "A right answer one sample before the horizon counts; read the mean beside the share.",
        csv=(
            "isolation_restricted_mean",
            "isolation_probability",
            "isolation_median",
        ),
        columns=(
            Column("isolation, restricted mean [s]", _isolation_cell),
            Column("isolated", lambda score: percent(score["isolation"]["probability"])),
            Column(
                "median [s]",
                lambda score: seconds(score["isolation"]["median"], HORIZON),
            ),
        ),
    ),
    Metric(
        "detection",
        lambda at: time_figures(at.assessment.detection, at.seed),
        f"time from onset to the first alarm after it: {TIMES}",
        "An alarm for the wrong reason counts; read it beside the rate of false alarms.",
        csv=(
            "detection_restricted_mean",
            "detection_probability",
            "detection_median",
        ),
        columns=(Column("detection, restricted mean [s]", _detection_cell),),
    ),
    Metric(
        "isolation_by_onset",
        lambda at: times_by_onset(at.assessment.isolation, at.truth.abrupt, at.seed),
        "isolation of abrupt and of ramped faults apart, as `isolation`; null if there are none",
        "Of a ramped fault the time counts from its beginning, when there is nothing to see.",
    ),
    Metric(
        "detection_by_onset",
        lambda at: times_by_onset(at.assessment.detection, at.truth.abrupt, at.seed),
        "detection of abrupt and of ramped faults apart, as `detection`; null if there are none",
        "As `isolation_by_onset`.",
    ),
)


def rate_score(inputs: RateInputs) -> dict[str, Any]:
    """All metrics at one rate of false alarms."""
    return {metric.key: metric.compute(inputs) for metric in RATE_METRICS}


def scores_by_rate(inputs: ScoreInputs) -> dict[str, dict[str, Any]]:
    """`rate_score` for every rate."""
    return {rate: rate_score(inputs.at_rate(rate)) for rate in inputs.assessments}


def at_ranked_rate(metric: Metric) -> Metric:
    """The metric of `RATE_METRICS` at the rate that diagnosers are ranked at."""

    def compute(inputs: ScoreInputs) -> Any:
        return metric.compute(inputs.at_rate(RANKED_AT))

    meaning = f"as in `rates` at {RANKED_AT}"
    return replace(metric, compute=compute, meaning=meaning, csv=())


METRICS = (
    Metric(
        "rates",
        scores_by_rate,
        "by mean time between false alarms ('1 h', '10 h') what depends on the threshold",
    ),
    *map(at_ranked_rate, RATE_METRICS),
    Metric(
        "isolation_by_class",
        lambda score: score_series.mean_by_class(score.ranked.isolation, score.truth.at_instants),
        "restricted mean isolation time [s] by class",
        "From few episodes of each class.",
    ),
    Metric(
        "detection_by_class",
        lambda score: score_series.mean_by_class(score.ranked.detection, score.truth.at_instants),
        "restricted mean detection delay [s] by class",
        "From few episodes of each class.",
    ),
    Metric(
        "macro_f1",
        lambda score: macro_f1(score.ranked),
        f"macro-F1 of the decisions {DECISION_TIME:g} s after onset, over the classes and normal, "
        "one healthy lane to four faulty ones",
        "Depends on the share of healthy lanes; an early instant punishes caution.",
        csv=("macro_f1",),
        columns=(_interval_column(f"macro-F1 at {DECISION_TIME:g} s", "macro_f1", 2),),
    ),
    Metric(
        "macro_f1_interval",
        macro_f1_interval,
        "its 95 % bootstrap interval over lanes",
    ),
    Metric(
        "macro_f1_over_time",
        lambda score: score_series.f1_over_time(score.ranked),
        "macro-F1 at each of `settings.decided_at`",
    ),
    Metric(
        "severity_mae",
        severity_mae,
        f"mean absolute error of the severity {SEVERITY_AT:g} s after onset, given the true class, "
        "of known faults; null without them",
        "Says nothing of whether the class is found; the middle of all severities has 0.2.",
        csv=("severity_mae",),
        columns=(_interval_column(f"severity MAE at {SEVERITY_AT:g} s", "severity_mae", 3),),
    ),
    Metric(
        "severity_mae_interval",
        severity_mae_interval,
        "its 95 % bootstrap interval over lanes",
    ),
    Metric(
        "severity_coverage",
        lambda score: severity_coverage(score, 0.9),
        "share of the true severities of known faults inside the 90 % interval of the estimate",
        "Wide intervals cover everything: read it beside the error.",
        csv=("severity_coverage",),
        columns=(Column("90 % covers", _coverage_cell),),
    ),
    Metric(
        "severity_coverage_95",
        lambda score: severity_coverage(score, 0.95),
        "the same for the 95 % interval",
        "As `severity_coverage`.",
        csv=("severity_coverage_95",),
    ),
    Metric(
        "ece",
        lambda score: calibration_error(score.ranked),
        "expected calibration error of beliefs at random instants",
        "Useless beliefs can be calibrated: read it beside the log loss.",
        csv=("ece",),
        columns=(Column("ECE", lambda score: f"{score['ece']:.3f}"),),
    ),
    Metric(
        "brier",
        lambda score: metrics.brier(score.ranked.log_probability, score.ranked.truth),
        "Brier score of beliefs at random instants, 0 to 2",
        "Forgives a truth held impossible.",
        csv=("brier",),
    ),
    Metric(
        "log_loss",
        lambda score: finite(metrics.log_loss(score.ranked.log_probability, score.ranked.truth)),
        "mean of -log p(true class) of beliefs at random instants [nat]; null for infinite",
        "A few confident errors decide it; a single truth held impossible makes it infinite.",
        csv=("log_loss",),
        columns=(Column("log loss [nat]", lambda score: number(score["log_loss"], 2)),),
    ),
    Metric(
        "abstention",
        lambda score: score_series.abstention(score.ranked, naming.unknown_class()),
        "{area, risk, coverage, risk_at}: area under risk against coverage if the least sure "
        "beliefs at random instants are withheld, risk of all, and the curve",
        "Depends on how difficult the beliefs are: compare on the same suite only.",
        csv=("abstention_area", "abstention_risk"),
    ),
    Metric(
        "declared",
        lambda score: score_series.declared(
            score.outcomes.faulty, score.truth, naming.unknown_class(), score.seed
        ),
        "{right, wrong, unknown, never, time_to_right}: shares of the faulty lanes by their first "
        "declaration, a class with p of 0.9 or more for 1 s, within the horizon; `unknown` of a "
        "known fault is neither right nor wrong; one before the onset is wrong",
        "A wrong declaration that is taken back soon counts as one that stays.",
        csv=("declared_right", "declared_wrong", "declared_unknown", "declared_never"),
        columns=(
            Column(
                "declared right, wrong, never",
                lambda score: ", ".join(
                    percent(score["declared"][key]) for key in ("right", "wrong", "never")
                ),
            ),
        ),
    ),
    Metric(
        "naming",
        lambda score: score_series.naming_of_unexplained(
            score.outcomes.faulty,
            score.ranked,
            score.truth,
        ),
        "{lanes, alarmed, right, unknown, surely_wrong} of faults outside the catalogue and of "
        "double faults, null without them: how many, share with an alarm; of these, at the "
        "horizon, the shares whose most probable fault is `unknown` or belongs to a component "
        "that fails, is `unknown`, belongs to another component with p above 0.9",
        "To call everything `unknown` is never wrong: read it beside the isolation of known ones.",
    ),
    Metric(
        "cost",
        lambda score: score_series.mission_cost(score.outcomes.faulty, score.outcomes.cruise),
        "speed_rms [m/s] of the true speed from the mission's, energy [J per episode], and the "
        "ratio of both to the same diagnoser's run under cruise, null without that",
        "Of faulty vehicles: a broken one needs another energy than a healthy one.",
        csv=("speed_rms", "energy", "speed_rms_ratio", "energy_ratio"),
    ),
    Metric(
        "isolation_over_time",
        lambda score: score_series.isolation_over_time(score.ranked),
        "{time, share}: share isolated for good by a time since onset [s]",
    ),
    Metric(
        "amoc",
        lambda score: score_series.amoc(
            score.outcomes.threshold,
            score.outcomes.faulty,
            score.truth.at_instants.onset,
        ),
        "{false_alarms_per_hour, delay, probability}: restricted mean delay [s] and share detected "
        "against the rate of false alarms that the threshold is set for",
        "The rate on other lanes can differ: see `false_alarms_per_hour`.",
    ),
    Metric(
        "confusion",
        lambda score: score_series.confusion(score.ranked),
        f"counts {DECISION_TIME:g} s after onset, rows true classes, columns decisions",
        "An early instant punishes caution: read it beside the isolation times.",
    ),
    Metric(
        "reliability",
        lambda score: score_series.reliability(score.ranked),
        "{share, confidence, accuracy} of the bins of beliefs that are not empty",
        "Bins with a small share scatter widely.",
    ),
    Metric(
        "severity_scatter",
        lambda score: score_series.severity_scatter(score.ranked, score.truth.at_instants),
        "{truth, estimate} of up to 300 episodes with known faults",
    ),
    Metric(
        "compatibility",
        lambda score: score_series.compatible_scores(
            score.outcomes.faulty, score.ranked.threshold, score.truth
        ),
        "scores of other benchmarks by name",
        "They count samples or runs and do not know how soon a fault was found.",
    ),
    Metric(
        "by_lane",
        lambda score: score_series.lane_results(score.ranked),
        "{isolation [s], isolated, detection [s], detected} by episode, and decision as `decided`",
    ),
    Metric(
        "worst",
        lambda score: score.worst,
        "the three episodes isolated last: seed, class (index), severity, onset, isolation (null "
        "if never), why, and series at steps of 0.5 s",
    ),
)


def thresholds(setting: HealthyOutcome) -> dict[str, float]:
    """Thresholds of log p(normal) for each mean time between false alarms, set on these lanes."""
    seconds_run = 3600.0 * float(setting.hours.sum())
    alarms = Edges(setting.low, setting.high)
    return {
        rate: min(
            HIGHEST_THRESHOLD,
            metrics.threshold_within(alarms, metrics.allowed_alarms(seconds_run, mean_time)),
        )
        for rate, mean_time in MEAN_TIMES.items()
    }


def assess_at_rates(outcomes: TrialOutcomes, truth: LaneTruth) -> dict[str, Assessment]:
    """What the diagnoser did, by mean time between false alarms."""
    record = outcomes.faulty.record
    return {
        rate: assess(threshold, record, truth.at_instants, outcomes.counting)
        for rate, threshold in thresholds(outcomes.threshold).items()
    }


def score(inputs: ScoreInputs) -> dict[str, Any]:
    """All metrics of a diagnoser under a stimulus."""
    return {metric.key: metric.compute(inputs) for metric in METRICS}


def csv_cells(all_metrics: tuple[Metric, ...], of_score: Score) -> dict[str, Any]:
    """The cells of these metrics in a row of results.csv, by column."""
    cells = {}
    for metric in all_metrics:
        value = of_score[metric.key]
        for column in metric.csv:
            is_group = isinstance(value, Mapping)
            cells[column] = value[column.removeprefix(f"{metric.key}_")] if is_group else value
    return cells
