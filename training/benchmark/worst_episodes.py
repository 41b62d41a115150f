"""The episodes that a diagnoser isolated last, with its beliefs and the readings."""

from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from training import metrics
from training.benchmark.assessment import Assessment
from training.benchmark.trials import FaultyOutcome, LaneTruth, Trial, simulate_trial
from training.benchmark.workers import call_for
from training.metrics import NORMAL
from training.metrics.plain import DIGITS, finite, rounded
from training.metrics.records import HORIZON, PERSISTENCE

N_WORST = 3
# channels whose readings are shown
SHOWN = (
    "speed",
    "speed_command",
    "port_rpm",
    "starboard_rpm",
    "port_current",
    "starboard_current",
)
STRIDE = 5  # samples from one shown to the next


def worst_episodes(
    trial: Trial, faulty: FaultyOutcome, assessment: Assessment, truth: LaneTruth
) -> list[dict[str, Any]]:
    """The episodes with the longest isolation times, the first of equals.

    `trial` has all lanes; it runs again on these. Raises what the diagnoser raises.
    """
    lanes = np.argsort(-assessment.isolation.time, kind="stable")[:N_WORST]
    worst_trial = trial._replace(episodes=tuple(trial.episodes[lane] for lane in lanes))
    observations = call_for(trial.entrant, observed, worst_trial)["observations"]
    columns = [INDEX[name] for name in SHOWN]
    readings = observations[::STRIDE, :, columns]
    alarm = metrics.alarms(faulty.log_normal[:, lanes], assessment.threshold, PERSISTENCE)
    return [
        _episode(lane, trial, faulty, assessment, truth, alarm[:, k], readings[:, k])
        for k, lane in enumerate(lanes)
    ]


def observed(trial: Trial) -> dict[str, np.ndarray]:
    """The observations of a trial (n_samples, n_lanes, n_channels)."""
    return {"observations": simulate_trial(trial).observations}


def _episode(
    lane: int,
    trial: Trial,
    faulty: FaultyOutcome,
    assessment: Assessment,
    truth: LaneTruth,
    alarm: np.ndarray,
    readings: np.ndarray,
) -> dict[str, Any]:
    """One episode as plain data, from alarm (n_samples,) and readings (n_shown, n_channels)."""
    time = assessment.isolation.time[lane]
    is_isolated = not assessment.isolation.censored[lane]
    log_normal = np.maximum(faulty.log_normal[::STRIDE, lane], np.finfo(np.float32).min)
    return {
        "seed": trial.episodes[lane].seed,
        "class": int(truth.at_instants.fault[lane]),
        "severity": round(float(truth.full_severity[lane]), DIGITS),
        "onset": round(float(truth.at_instants.onset[lane]), DIGITS),
        "isolation": round(float(time), DIGITS) if is_isolated else None,
        "why": explanation(alarm, faulty.fault[:, lane], truth, lane),
        "time": rounded(np.arange(0, len(alarm), STRIDE) * SAMPLE_TIME),
        "log_normal": rounded(log_normal),
        "threshold": finite(assessment.threshold),
        "alarm": alarm[::STRIDE].tolist(),
        "fault": faulty.fault[::STRIDE, lane].tolist(),
        "readings": {name: rounded(readings[:, column]) for column, name in enumerate(SHOWN)},
    }


def explanation(alarm: np.ndarray, fault: np.ndarray, truth: LaneTruth, lane: int) -> str:
    """What went wrong in an episode, from alarms and most probable faults (n_samples,)."""
    onset = truth.at_instants.onset[lane]
    true_fault = truth.at_instants.fault[lane]
    begin = int(np.ceil(onset / SAMPLE_TIME - 1e-6))
    end = int(metrics.sample_at(onset + HORIZON))
    decision = np.where(alarm, fault, NORMAL)[begin : end + 1]
    is_right = decision == true_fault
    if is_right.all():
        return "right from before the onset on"
    if is_right[-1]:
        return "right for good only late"
    named = f"taken for {classes()[fault[end]]}" if alarm[end] else "no alarm"
    lost = ", after it had been right" if is_right.any() else ""
    return f"{named} {HORIZON:g} s after onset{lost}"
