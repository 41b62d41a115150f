"""From the trials of a benchmark to its figures: plain data, all that the page and the tables are made from.

The results, lists instead of arrays, numbers rounded where they only serve a figure. A `stimulus` is a name of
`STIMULI`, a `diagnoser` one of the registry or of a third party, a `rate` is "1 h" or "10 h" (mean time between false
alarms); classes are indices into `classes`, 0 is normal; None stands for infinite, below any number where it is a
threshold. `Times` is {"restricted_mean", "interval", "probability", "median"}, in seconds, censored at
`settings.horizon`; every "..._interval" is [low, high]::

    command         the command line, as text
    suite           name, about, hash, plant {preset, sensor_noise, disturbance, healthy_band}, duration [s],
                    listed (episodes in the file), every (k: each k-th was run; 1 is all)
    seeds           faulty, threshold, counting: [first, last]; bootstrap: seed
    settings        persistence [samples], horizon [s], decided_at [s] (1, 2, 5, 10, 20),
    severity_at [s],
                    hours, counting_hours (asked for, of each diagnoser, all stimuli together),
                    stimuli {stimulus: budget [m/s]}
    classes         names of the classes
    references      names of the diagnosers that are not ranked
    third_parties   {diagnoser: where it comes from}
    failures        {diagnoser: why it is left out}
    versions, revision                 as in manifest.json
    weights         {diagnoser: digest of what it has learnt, None if nothing}
    compute         {diagnoser: {p50_us, p99_us, many_lanes_us, numbers (of learnt weights)}}
    thresholds      {diagnoser: {rate: threshold of log p(normal)}}
    episodes        of the faulty ones run, a list each: seed, fault (class), onset [s], severity
    (full), ramp [s],
                    abrupt (bool)
    decided         {stimulus: true classes at `settings.decided_at`' fourth instant, 10 s, faulty
    lanes and then some
                    healthy ones}: what goes with `decision` below
    bounds          {stimulus: as `training.benchmark.bounds` writes it}, under the standard
    conditions only scores          {stimulus: {diagnoser: score}}, where a score holds

      rates             {rate: {threshold, false_alarms, false_alarm_vehicles, hours,
      false_alarms_per_hour,
                        false_alarms_per_hour_interval, rate_as_set (bool), isolation: Times,
                        detection: Times}}
      isolation, detection               Times at 1 h, once more
      isolation_by_class, detection_by_class   {class name: restricted mean [s]} at 1 h
      macro_f1, macro_f1_interval        10 s after onset, at 1 h
      macro_f1_over_time                 at each of `settings.decided_at`
      severity_mae, severity_mae_interval, severity_coverage   `settings.severity_at` after onset,
      given the true class ece, brier, log_loss               of beliefs at random instants cost
      speed_rms [m/s] (of the true speed from the mission's), energy [J per episode], and both
                        relative to the same diagnoser's run under cruise, None without that:
                        speed_rms_ratio, energy_ratio
      isolation_over_time   {time, share}: share of the faults isolated for good by a time since
      onset amoc              {false_alarms_per_hour, delay, probability}: restricted mean delay [s]
      and share detected
                        against the rate of false alarms, rates ascending, up to 100 points
      confusion         counts, rows true classes, columns decisions, 10 s after onset
      reliability       {share, confidence, accuracy} of the bins that are not empty
      severity_scatter  {truth, estimate} of up to 300 episodes
      compatibility     scores of other benchmarks, {name: value}
      by_lane           {isolation, isolated, detection, detected, decision}: by episode, times in
      seconds at 1 h;
                        decision as in `decided`
      worst             three episodes: {seed, class (index), severity, onset, isolation (time, None
      if never), why,
                        time, log_normal, threshold, alarm (bools), fault (top class), readings
                        {speed, speed_command, port_rpm, starboard_rpm, port_current,
                        starboard_current}}, series at 0.5 s steps
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from training import metrics
from training.benchmark.scoring import Assessment, alarm_summary, assess, mean_by_class, summary
from training.benchmark.trials import FaultyOutcome, LaneTruth
from training.metrics import NORMAL, Edges, compatibility
from training.metrics.records import HORIZON, PERSISTENCE, HealthyOutcome

MEAN_TIMES = {"1 h": 3600.0, "10 h": 36000.0}  # s between false alarms
RANKED_AT = "1 h"
AMOC_RATES = np.geomspace(0.02, 60.0, 41)  # false alarms per hour
POINTS = 61  # of a curve
SCATTERED = 300  # of a scatter
DIGITS = 4


class TrialOutcomes(NamedTuple):
    """What a diagnoser under a stimulus is scored on.

    The healthy lanes that thresholds are set on, under all stimuli; those of this stimulus on which
    false alarms are counted; the faulty ones, and the same ones under `cruise` if that was run.
    """

    setting: HealthyOutcome
    counting: HealthyOutcome
    faulty: FaultyOutcome
    passive: FaultyOutcome | None


def thresholds(setting: HealthyOutcome) -> dict[str, float]:
    """The thresholds of log p(normal) for each mean time between false alarms."""
    seconds = 3600.0 * float(setting.hours.sum())
    found = Edges(setting.low, setting.high)
    return {
        rate: metrics.threshold_within(found, metrics.allowed_alarms(seconds, mean_time))
        for rate, mean_time in MEAN_TIMES.items()
    }


def assess_at_rates(material: TrialOutcomes, truth: LaneTruth) -> dict[str, Assessment]:
    """What the diagnoser did, by mean time between false alarms."""
    levels = thresholds(material.setting)
    record = material.faulty.record
    return {
        rate: assess(level, record, truth.at_instants, material.counting)
        for rate, level in levels.items()
    }


def score(
    material: TrialOutcomes, judged: Mapping[str, Assessment], truth: LaneTruth, seed: int
) -> dict[str, Any]:
    """All figures of a diagnoser under a stimulus but its worst episodes; `seed` is that of the bootstrap intervals."""
    ranked = judged[RANKED_AT]
    faulty = material.faulty
    matrix = metrics.confusion(ranked.label, ranked.decision, len(classes()))
    return {
        **summary(ranked, truth.at_instants, seed),
        "rates": {rate: alarm_summary(one, MEAN_TIMES[rate], seed) for rate, one in judged.items()},
        "detection_by_class": mean_by_class(ranked.detection, truth.at_instants),
        "macro_f1_over_time": f1_over_time(ranked),
        "cost": cost(faulty, material.passive),
        "isolation_over_time": isolation_over_time(ranked),
        "amoc": amoc(material, truth),
        "confusion": matrix.astype(int).tolist(),
        "reliability": reliability(ranked),
        "severity_scatter": severity_scatter(ranked, truth),
        "compatibility": compatible(faulty, ranked.threshold, truth),
        "lane_results": lane_results(ranked),
    }


def f1_over_time(judged: Assessment) -> list[float]:
    """Macro-F1 at each of `DECIDED`."""
    n = len(classes())
    matrices = (metrics.confusion(judged.label, decision, n) for decision in judged.decisions)
    return [float(metrics.macro_f1(matrix)) for matrix in matrices]


def cost(faulty: FaultyOutcome, passive: FaultyOutcome | None) -> dict[str, float | None]:
    """What the mission paid, and how many times what it would have paid without stimulus."""
    paid = mission_cost(faulty)
    ratio = (
        None
        if passive is None
        else {name: paid[name] / value for name, value in mission_cost(passive).items()}
    )
    return paid | {f"{name}_ratio": ratio and ratio[name] for name in paid}


def mission_cost(faulty: FaultyOutcome) -> dict[str, float]:
    """What the mission paid: RMS speed deviation [m/s] and mean energy [J]."""
    return {
        "speed_rms": float(np.sqrt(np.mean(faulty.speed_rms**2))),
        "energy": float(faulty.energy.mean()),
    }


def isolation_over_time(judged: Assessment) -> dict[str, list[float]]:
    """Share isolated for good by a time since onset [s]."""
    time = np.linspace(0.0, HORIZON, POINTS)
    isolated = (judged.isolation.time <= time[:, None]) & ~judged.isolation.censored
    return {"time": rounded(time), "share": rounded(isolated.mean(axis=1))}


def amoc(material: TrialOutcomes, truth: LaneTruth) -> dict[str, list[float]]:
    """Delay and share detected against the false alarms per hour that the threshold was set for."""
    setting = material.setting
    found = Edges(material.setting.low, material.setting.high)
    depth = metrics.running_maximum(material.faulty.log_normal, PERSISTENCE)
    hours = float(setting.hours.sum())
    rows = []
    for allowed in np.unique((AMOC_RATES * hours).astype(int)):
        level = metrics.threshold_within(found, int(allowed))
        if allowed and level <= setting.complete.min():
            delay = metrics.detection_delay(depth < level, truth.at_instants.onset, HORIZON)
            rows.append(
                (allowed / hours, metrics.restricted_mean(delay), metrics.probability(delay))
            )
    names = "false_alarms_per_hour", "delay", "probability"
    return {name: rounded([row[k] for row in rows]) for k, name in enumerate(names)}


def reliability(judged: Assessment) -> dict[str, list[float]]:
    """The bins of the reliability diagram that are not empty."""
    bins = metrics.reliability(judged.confidence, judged.right)
    return {name: rounded(values[bins.share > 0]) for name, values in bins._asdict().items()}


def severity_scatter(judged: Assessment, truth: LaneTruth) -> dict[str, list[float]]:
    """Severity, true and estimated, of some lanes."""
    n = len(truth.at_instants.fault)
    lanes = np.linspace(0, n - 1, min(SCATTERED, n)).astype(np.int64)
    return {
        "truth": rounded(truth.at_instants.severity[0, lanes]),
        "estimate": rounded(judged.severity[lanes]),
    }


def compatible(
    faulty: FaultyOutcome, threshold: float, truth: LaneTruth
) -> dict[str, float | None]:
    """Scores as other benchmarks compute them, on the faulty lanes from the start of the episodes."""
    decision = np.where(
        metrics.alarms(faulty.log_normal, threshold, PERSISTENCE), faulty.fault, NORMAL
    )
    return compatibility.scores(
        truth.label, decision, truth.instants[1:], faulty.log_probability[1:], len(classes())
    )


def lane_results(judged: Assessment) -> dict[str, list[Any]]:
    """What paired comparisons need."""
    return {
        "isolation": rounded(judged.isolation.time),
        "isolated": (~judged.isolation.censored).tolist(),
        "detection": rounded(judged.detection.time),
        "detected": (~judged.detection.censored).tolist(),
        "decision": judged.decision.tolist(),
    }


def rounded(values: Any, digits: int = DIGITS) -> list[float]:
    """The values as a list of plain numbers, no more digits than a figure shows."""
    return np.round(np.asarray(values, np.float64), digits).tolist()
