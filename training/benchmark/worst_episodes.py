"""The episodes that a diagnoser found hardest, with what it believed and what the vehicle read."""

from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from training import metrics
from training.benchmark.scores import rounded
from training.benchmark.scoring import Assessment, finite
from training.benchmark.trials import FaultyOutcome, LaneTruth, Trial, simulate_trial
from training.metrics import NORMAL
from training.metrics.records import HORIZON, PERSISTENCE

WORST = 3
READ = ("speed", "speed_command", "port_rpm", "starboard_rpm", "port_current", "starboard_current")
EVERY = 5  # samples from one shown to the next


def worst_episodes(
    trial: Trial, faulty: FaultyOutcome, judged: Assessment, truth: LaneTruth
) -> list[dict[str, Any]]:
    """Those with the largest isolation times, the first of equals; `trial` has all lanes, and runs again on these."""
    lanes = np.argsort(-judged.isolation.time, kind="stable")[:WORST]
    observations, *_ = simulate_trial(
        trial._replace(episodes=tuple(trial.episodes[lane] for lane in lanes))
    )
    shown = observations[::EVERY, :, [INDEX[name] for name in READ]]
    alarm = metrics.alarms(faulty.log_normal[:, lanes], judged.threshold, PERSISTENCE)
    return [
        {
            "seed": trial.episodes[lane].seed,
            "class": int(truth.at_instants.fault[lane]),
            "severity": round(float(truth.full_severity[lane]), 4),
            "onset": round(float(truth.at_instants.onset[lane]), 4),
            "isolation": None
            if judged.isolation.censored[lane]
            else round(float(judged.isolation.time[lane]), 4),
            "why": why(alarm[:, k], faulty.fault[:, lane], truth, lane),
            "time": rounded(np.arange(0, len(alarm), EVERY) * SAMPLE_TIME),
            "log_normal": rounded(
                np.maximum(faulty.log_normal[::EVERY, lane], np.finfo(np.float32).min)
            ),
            "threshold": finite(judged.threshold),
            "alarm": alarm[::EVERY, k].tolist(),
            "fault": faulty.fault[::EVERY, lane].tolist(),
            "readings": {name: rounded(shown[:, k, column]) for column, name in enumerate(READ)},
        }
        for k, lane in enumerate(lanes)
    ]


def why(alarm: np.ndarray, fault: np.ndarray, truth: LaneTruth, lane: int) -> str:
    """What went wrong in an episode, from alarms and named faults (n_samples,)."""
    names = classes()
    onset = truth.at_instants.onset[lane]
    true = truth.at_instants.fault[lane]
    end = int(metrics.sample_at(onset + HORIZON))
    begin = int(np.ceil(onset / SAMPLE_TIME - 1e-6))
    right = np.where(alarm, fault, NORMAL)[begin : end + 1] == true
    if right[-1]:
        return "right from before the onset on" if right.all() else "right for good only late"
    lost = ", after it had been right" if right.any() else ""
    return (
        f"taken for {names[fault[end]]}" if alarm[end] else "no alarm"
    ) + f" {HORIZON:g} s after onset{lost}"
