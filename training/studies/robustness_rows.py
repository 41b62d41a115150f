"""The rows of the study of robustness: each measures one thing, and says what is to be reached."""

import math
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import classes, fault_of
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from auv_fault_env.realism import EFFECTS
from auv_fault_env.schedules import FaultEvent, Schedule
from auv_fault_env.unmodelled import UNMODELLED
from diagnosers import make
from training import metrics
from training.benchmark import score_series, scores, suites, timing
from training.benchmark.assessment import Assessment, assess
from training.benchmark.suites import ONE_FAULT, Conditions
from training.benchmark.whole_missions import WholeMissionSampler
from training.metrics import healthy_time, naming
from training.metrics.healthy_time import is_raised
from training.metrics.intervals import interval, poisson_interval
from training.metrics.plain import finite
from training.metrics.records import HORIZON, PERSISTENCE, HealthyOutcome
from training.report.cells import percent, with_interval
from training.rollouts import roll_out
from training.studies.robustness_runs import FaultyLanes, Runs, believed, conditions, constant_lanes

PER_HOUR, PER_10_HOURS = scores.MEAN_TIMES
# of the hours with one effect: shorter missions, so that there are more vehicles
SHORTER = WholeMissionSampler(duration=(60.0, 1800.0))
CRUISE_SPEED = 0.4  # m/s
N_CRUISING = 24
N_RESTING = 8
HOUR = 3600.0  # s
N_PADDED = 32  # vehicles on a mission between rests
RESTS = (30.0, 240.0)  # s
PER_FAULT = 24  # lanes of a fault outside the catalogue
# of faults outside the catalogue that come and go [s]
TEMPORARY = {"ventilating_propeller": {"period": 4.0, "duty": 0.5}}
PER_PAIR = 48  # lanes of a double fault
PAIRS = ("seal_friction", "propeller_loss")
SEVERITY = (0.4, 1.0)  # of double faults
ONSET = (8.0, 25.0)  # s
PER_REPAIR = 32
REPAIRED = ("seal_friction:port", "increased_drag")
REPAIRED_SEVERITY = 0.6
REPAIRED_ONSET = 15.0  # s
REPAIRED_AFTER = 10.0  # s
NORMAL_WITHIN = 20.0  # s after the repair
N_FAULTY = 1026  # lanes of calibration and isolation with seeds of the study


class Finding(NamedTuple):
    """One line of the table."""

    case: str
    measured: str
    to_reach: str
    reached: bool | None  # None where nothing is to be reached
    figures: dict[str, Any]  # as plain data


class Study(NamedTuple):
    """What a row measures with."""

    runs: Runs
    effect_hours: float
    row: int  # number of the row, by which it has its seeds


Measure = Callable[[Study], list[Finding]]


def alarm_finding(
    case: str,
    outcome: HealthyOutcome,
    threshold: float,
    most_per_hour: float,
    most_time: float | None = None,
) -> Finding:
    """False alarms per hour and time in alarm, and whether both are low enough."""
    begun = is_raised(outcome.low, outcome.high, threshold)
    ended = is_raised(outcome.end_low, outcome.end_high, threshold)
    begin = outcome.begin[begun]
    hours = float(outcome.hours.sum())
    count = int(begun.sum())
    share = healthy_time.time_in_alarm(begin, outcome.end[ended]) / (3600.0 * hours)
    rate = count / hours
    rate_interval = poisson_interval(count, hours)
    measured = f"{with_interval(rate, rate_interval, 2)} per hour, {100 * share:.2f} % of the time"
    to_reach = f"≤ {most_per_hour:g} per hour"
    is_reached = rate <= most_per_hour
    if most_time is not None:
        to_reach += f", ≤ {100 * most_time:g} %"
        is_reached &= share <= most_time
    figures = {
        "alarms": count,
        "hours": hours,
        "per_hour": rate,
        "per_hour_interval": rate_interval,
        "time_in_alarm": share,
        "by_quarter": healthy_time.by_quarter(outcome.quarter[begun]).tolist(),
        "by_age": scores.alarms_by_age(healthy_time.by_age(begin, outcome.hours)),
    }
    return Finding(case, measured, to_reach, is_reached, figures)


def each_effect(study: Study) -> list[Finding]:
    """Healthy vehicles with one imperfection each."""
    found = []
    for name in EFFECTS:
        of = conditions(SHORTER, realism=1.0, imperfections=(name,))
        outcome = study.runs.healthy(of, study.row, study.effect_hours)
        found.append(alarm_finding(name, outcome, study.runs.thresholds[PER_HOUR], 2.0, 0.01))
    return found


def all_effects(study: Study) -> list[Finding]:
    """Healthy vehicles with all imperfections."""
    outcome = study.runs.healthy(conditions(realism=1.0), study.row, study.runs.hours)
    finding = alarm_finding("all effects", outcome, study.runs.thresholds[PER_HOUR], math.inf)
    low, high = finding.figures["per_hour_interval"]
    to_reach = "1 per hour inside the interval"
    return [finding._replace(to_reach=to_reach, reached=low <= 1.0 <= high)]


def twice(study: Study) -> list[Finding]:
    """Healthy vehicles with twice the imperfections."""
    outcome = study.runs.healthy(conditions(realism=2.0), study.row, study.runs.hours / 2.0)
    return [alarm_finding("twice", outcome, study.runs.thresholds[PER_HOUR], 4.0)]


def constant_speed(study: Study) -> list[Finding]:
    """Vehicles at a constant speed for an hour, at one false alarm per ten hours, by quarter."""
    found = []
    lanes = constant_lanes(study.runs.seeds(study.row, N_CRUISING), CRUISE_SPEED, HOUR)
    for realism in (0.0, 1.0):
        outcome = study.runs.healthy_lanes(conditions(realism=realism), lanes)
        case = f"{N_CRUISING} vehicles, 1 h at {CRUISE_SPEED} m/s, realism {realism:g}"
        finding = alarm_finding(case, outcome, study.runs.thresholds[PER_10_HOURS], math.inf)
        first, *_, last = quarters = finding.figures["by_quarter"]
        count = finding.figures["alarms"]
        measured = f"{count} alarms, by quarter {', '.join(map(str, quarters))}"
        to_reach = "≤ 6, the last quarter at most twice the first + 1"
        is_reached = count <= 6 and last <= 2 * first + 1
        found.append(finding._replace(measured=measured, to_reach=to_reach, reached=is_reached))
    return found


def rest(study: Study) -> list[Finding]:
    """Vehicles at rest for an hour, and zeros in all readings before and after a mission."""
    threshold = study.runs.thresholds[PER_HOUR]
    found = []
    lanes = constant_lanes(study.runs.seeds(study.row, N_RESTING), 0.0, HOUR)
    for realism in (0.0, 1.0):
        outcome = study.runs.healthy_lanes(conditions(realism=realism), lanes)
        finding = alarm_finding(f"at rest, realism {realism:g}", outcome, threshold, math.inf)
        found.append(_few_alarms(finding, finding.figures["alarms"], 1))
    n_samples = round(HOUR * SAMPLE_RATE)
    zeros = [np.zeros((N_RESTING, len(CHANNELS)), np.float32)] * n_samples
    found.append(_zeros_finding(study, "1 h of zeros in all readings", zeros, 1))
    for duration in RESTS:
        observations = list(_between_rests(study, duration))
        case = f"{N_PADDED} missions between rests of {duration:g} s of zeros"
        found.append(_zeros_finding(study, case, observations, 0))
    return found


def _few_alarms(finding: Finding, count: int, most: int) -> Finding:
    to_reach = "at most one alarm" if most else "no alarm"
    noun = "alarm" if count == 1 else "alarms"
    measured = f"{count} {noun}, {finding.measured}"
    return finding._replace(measured=measured, to_reach=to_reach, reached=count <= most)


def _zeros_finding(
    study: Study, case: str, observations: Sequence[np.ndarray], most: int
) -> Finding:
    log_normal = believed(make(study.runs.diagnoser), observations)
    alarm = metrics.alarms(log_normal, study.runs.thresholds[PER_HOUR], PERSISTENCE)
    count = int(metrics.rising(alarm).sum())
    standing = int(alarm[-1].sum())
    measured = f"{percent(alarm.mean())} of the time, {standing} standing at the end"
    lowest = finite(float(log_normal.min()))
    figures = {"alarms": count, "standing": standing, "lowest_log_normal": lowest}
    return _few_alarms(Finding(case, measured, "", None, figures), count, most)


def _between_rests(study: Study, duration: float) -> chain[np.ndarray]:
    """Observations of missions from rest to rest, all zero before and after for a duration [s]."""
    zeros = [np.zeros((N_PADDED, len(CHANNELS)), np.float32)] * round(duration * SAMPLE_RATE)
    mission = Mission(((0.0, 0.3), (40.0, 0.45), (80.0, 0.25), (120.0, 0.0)), 0.0)
    rollout = roll_out(
        Fleet(N_PADDED, **conditions(realism=1.0).plant),
        study.runs.seeds(study.row, N_PADDED),
        2400,
        schedules=[()] * N_PADDED,
        missions=[mission] * N_PADDED,
    )
    return chain(zeros, rollout.observations, zeros)


def outside(study: Study) -> list[Finding]:
    """Faults outside the catalogue."""
    random = np.random.default_rng(study.runs.seeds(study.row, 1)[0])
    names = [name for name in UNMODELLED for _ in range(PER_FAULT)]
    onset = random.uniform(*ONSET, len(names)).round(1)
    schedules = [
        (FaultEvent(name, begin, 1.0, **TEMPORARY.get(name.partition(":")[0], {})),)
        for name, begin in zip(names, onset, strict=True)
    ]
    of_fault = {name: np.array([one == name for one in names]) for name in UNMODELLED}
    return _named(study, schedules, of_fault)


def double(study: Study) -> list[Finding]:
    """Both seals, and both propellers, at fault at once."""
    random = np.random.default_rng(study.runs.seeds(study.row, 1)[0])
    schedules: list[Schedule] = []
    for kind in PAIRS:
        for _ in range(PER_PAIR):
            severity = random.uniform(*SEVERITY)
            onset = round(random.uniform(*ONSET), 1)
            schedules.append(both_sides(kind, onset, severity))
    kinds = np.repeat(PAIRS, PER_PAIR)
    return _named(study, schedules, {f"both sides: {kind}": kinds == kind for kind in PAIRS})


def both_sides(kind: str, onset: float, severity: float) -> Schedule:
    """The fault on both sides, as severe as it can be where it is only whole."""
    names = [f"{kind}:{side}" for side in SIDES]
    severity = max(severity, fault_of(names[0]).least_severity)
    return tuple(FaultEvent(name, onset, round(severity, 4)) for name in names)


def _named(
    study: Study, schedules: Sequence[Schedule], groups: dict[str, np.ndarray]
) -> list[Finding]:
    """What is named of lanes with these faults, all together and by group (n_lanes,) bool."""
    of = conditions(realism=1.0)
    lanes = study.runs.faulty(of, study.runs.episodes(of, study.row, schedules))
    found = []
    everything = {"all": np.ones(len(schedules), bool)}
    for case, chosen in (everything | groups).items():
        named = _naming_of(lanes, np.flatnonzero(chosen), study.runs.thresholds[PER_HOUR])
        found.append(Finding(case, _naming_text(named), "", None, named))
    return [_judged_by_names(found[0]), *found[1:]]


def _judged_by_names(finding: Finding) -> Finding:
    """The finding of all lanes with what is to be reached; without alarms nothing is judged."""
    to_reach = "≥ 70 % `unknown` or right component, ≤ 5 % wrong with p > 0.9"
    named = finding.figures
    if named["right"] is None:
        return finding._replace(to_reach=to_reach)
    is_reached = named["right"] >= 0.7 and named["surely_wrong"] <= 0.05
    return finding._replace(to_reach=to_reach, reached=is_reached)


def _naming_of(lanes: FaultyLanes, chosen: np.ndarray, threshold: float) -> dict[str, Any]:
    record = lanes.record
    onset = lanes.truth.at_instants.onset[chosen]
    alarm = metrics.alarms(record.log_normal[:, chosen], threshold, PERSISTENCE)
    detection = metrics.detection_delay(alarm, onset, HORIZON)
    at_horizon = metrics.sample_at(onset + HORIZON), chosen
    named = naming.name_of(
        ~detection.censored,
        record.fault[at_horizon],
        record.log_fault[at_horizon],
        lanes.truth.right_classes[chosen],
        naming.unknown_class(),
    )
    best, counts = np.unique(record.fault[at_horizon][named.alarmed], return_counts=True)
    shares = {
        key: finite(naming.share_of_alarmed(named, getattr(named, key)))
        for key in ("right", "unknown", "surely_wrong")
    }
    return {
        "lanes": chosen.size,
        "alarmed": float(named.alarmed.mean()),
        **shares,
        "names": {classes()[k]: int(n) for k, n in zip(best, counts, strict=True)},
    }


def _naming_text(named: dict[str, Any]) -> str:
    if named["right"] is None:
        return f"no alarm on {named['lanes']} vehicles"
    names = sorted(named["names"].items(), key=lambda item: -item[1])[:3]
    listed = ", ".join(f"{name} {count}" for name, count in names)
    return (
        f"{percent(named['alarmed'])} alarmed; of these {percent(named['right'])} right or unknown "
        f"({percent(named['unknown'])} unknown), {percent(named['surely_wrong'])} surely wrong; "
        f"{listed}"
    )


def repaired(study: Study) -> list[Finding]:
    """Faults that are repaired after ten seconds."""
    end = REPAIRED_ONSET + REPAIRED_AFTER
    faults = [name for name in REPAIRED for _ in range(PER_REPAIR)]
    schedules = [(FaultEvent(name, REPAIRED_ONSET, REPAIRED_SEVERITY, end=end),) for name in faults]
    found = []
    for realism in (0.0, 1.0):
        of = conditions(realism=realism)
        lanes = study.runs.faulty(of, study.runs.episodes(of, study.row, schedules))
        log_normal = lanes.record.log_normal
        is_normal = log_normal[metrics.sample_at(end + NORMAL_WITHIN)] > math.log(0.5)
        was_found = (log_normal[: metrics.sample_at(end)] < math.log(0.5)).any(axis=0)
        for name in REPAIRED:
            chosen = np.array([fault == name for fault in faults])
            share = float(is_normal[chosen].mean())
            figures = {"normal": share, "was_found": float(was_found[chosen].mean())}
            found.append(
                Finding(
                    f"{name} {REPAIRED_SEVERITY:g}, realism {realism:g}",
                    f"{percent(share)} normal {NORMAL_WITHIN:g} s after the repair "
                    f"({percent(figures['was_found'])} had been found)",
                    "≥ 90 %",
                    share >= 0.9,
                    figures,
                )
            )
    return found


def isolation(study: Study) -> list[Finding]:
    """Isolation under the thesis' stimulus without imperfections, and with them."""
    found = []
    for realism, most in ((0.0, 4.5), (1.0, math.inf)):
        lanes = _lanes_at(study, realism)
        for is_merged in (True, False):
            times = _isolation_times(lanes, study.runs.thresholds[PER_HOUR], is_merged)
            mean = metrics.restricted_mean(times)
            mean_interval = interval(times.time, study.runs.seed)
            case = f"realism {realism:g}" + (", propeller classes merged" if is_merged else "")
            is_judged = is_merged and realism == 0.0
            figures = {
                "restricted_mean": mean,
                "interval": mean_interval,
                "probability": metrics.probability(times),
                "by_onset": scores.times_by_onset(times, lanes.truth.abrupt, study.runs.seed),
                "by_class": score_series.mean_by_class(times, lanes.truth.at_instants),
            }
            found.append(
                Finding(
                    case,
                    f"{with_interval(mean, mean_interval, 2)} s, "
                    f"{percent(figures['probability'])} isolated",
                    f"≤ {most:g} s" if is_judged else "",
                    mean <= most if is_judged else None,
                    figures,
                )
            )
    return found


def _lanes_at(study: Study, realism: float) -> FaultyLanes:
    """Faulty lanes: of tests those of the frozen suites, else lanes like those of `standard`."""
    if study.runs.purpose != "test":
        return _standard_lanes(study, conditions(realism=realism))
    suite = suites.load(suites.STANDARD if realism else suites.IDEAL)
    return study.runs.faulty(suite.conditions, suite.episodes)


def _standard_lanes(study: Study, of: Conditions) -> FaultyLanes:
    """Faulty lanes like those of the standard suite, with seeds of the study."""
    schedules = [ONE_FAULT.sample(seed) for seed in study.runs.seeds(study.row, N_FAULTY)]
    return study.runs.faulty(of, study.runs.episodes(of, study.row, schedules))


def _isolation_times(lanes: FaultyLanes, threshold: float, is_merged: bool) -> metrics.Times:
    truth = lanes.truth.at_instants
    alarm = metrics.alarms(lanes.record.log_normal, threshold, PERSISTENCE)
    one_of = np.arange(len(classes()))
    if is_merged:
        one_of = np.array([_merged(name) for name in classes()])
    decision = np.where(alarm, one_of[lanes.record.fault], metrics.NORMAL)
    return metrics.isolation_time(decision, one_of[truth.fault], truth.onset, HORIZON)


def _merged(name: str) -> int:
    """Class of the propeller of that side for all classes of a propeller, else its own."""
    same = name.replace("propeller_loss", "propeller_damage")
    return classes().index(same if same in classes() else name)


def calibration(study: Study) -> list[Finding]:
    """Calibration error and coverage of the severity's interval, with imperfections."""
    lanes = _lanes_at(study, 1.0)
    healthy = study.runs.healthy(conditions(realism=1.0), study.row, study.effect_hours)
    truth = lanes.truth.at_instants
    assessment = assess(study.runs.thresholds[PER_HOUR], lanes.record, truth, healthy)
    error = scores.calibration_error(assessment)
    coverage = _coverage(assessment, truth.severity[0])
    return [
        Finding("ECE", f"{error:.4f}", "≤ 0.03", error <= 0.03, {"ece": error}),
        Finding(
            "severity, coverage of the 95 % interval",
            f"{coverage:.3f}",
            "0.90 to 0.98",
            0.90 <= coverage <= 0.98,
            {"coverage": coverage},
        ),
    ]


def _coverage(assessment: Assessment, truth: np.ndarray) -> float:
    covered = metrics.covered(assessment.severity, assessment.severity_std, truth, 0.95)
    return float(covered.mean())


def latency(study: Study) -> list[Finding]:
    """What an update of one lane costs."""
    cost = timing.compute_cost(make(study.runs.diagnoser), study.runs.seeds(study.row, 1)[0])
    milliseconds = cost["p99_us"] / 1000.0
    measured = f"{milliseconds:.2f} ms, median {cost['p50_us'] / 1000.0:.2f} ms"
    is_reached = milliseconds < 1.0
    return [Finding("one lane, p99 of update", measured, "< 1 ms", is_reached, cost)]


# in the order of their seeds: append new ones
ROWS: dict[str, Measure] = {
    "effects": each_effect,
    "all": all_effects,
    "twice": twice,
    "constant": constant_speed,
    "rest": rest,
    "outside": outside,
    "double": double,
    "repair": repaired,
    "isolation": isolation,
    "calibration": calibration,
    "latency": latency,
}
