"""Episodes of a fleet, simulated without a diagnoser in the loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.episodes import severities_over_time
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.layout import EpisodePlan
from auv_fault_env.missions import Mission, follow_mission
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import Events, Schedule, first_onset, profile_of
from auv_fault_env.unmodelled import plant_faults

TIME_TOLERANCE = 1e-9  # s, by which a sample time may miss an onset at that time


class Rollout(NamedTuple):
    """Episodes of many lanes, time first."""

    observations: np.ndarray  # (n_samples, n_lanes, n_channels) float32
    label: np.ndarray  # (n_samples, n_lanes) index in `classes()` of the worst fault present
    severity: np.ndarray  # (n_samples, n_lanes) of that fault
    onset: np.ndarray  # (n_lanes,) of the first fault [s], infinite if there is none
    healthy: np.ndarray  # (n_lanes, n_parameters) the vehicle without its faults


def roll_out(
    fleet: Fleet,
    seeds: Sequence[int],
    n_samples: int,
    actions: np.ndarray | None = None,
    schedules: Sequence[Schedule] | Events | None = None,
    missions: Sequence[Mission] | None = None,
) -> Rollout:
    """Run an episode of n_samples, the reading at the start included, on every lane.

    Seeds, schedules and missions are one per lane, as for `Fleet.reset`. Actions (n_samples,
    n_lanes, 3) are added to (mission speed [m/s], rudder 0, stern plane 0); None follows the
    mission.
    """
    observation = fleet.reset(seeds, schedules=schedules, missions=missions)
    observations = np.empty((n_samples, fleet.n_lanes, len(CHANNELS)), np.float32)
    observations[0] = observation
    for k in range(1, n_samples):
        action = follow_mission(observation)
        observation = fleet.step(action if actions is None else action + actions[k])
        observations[k] = observation
    label, severity = label_and_severity(fleet.plan, n_samples, fleet.diagnoses)
    onset = first_onset(fleet.plan)
    return Rollout(observations, label, severity, onset, fleet.plan.healthy.copy())


def label_and_severity(
    plan: EpisodePlan | Events, n_samples: int, diagnoses: Sequence[str] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Label and severity over time of the worst fault present, each (n_samples, n_lanes).

    The plan's faults are rows of `diagnoses`, by default those of `plant_faults`.

    An intermittent fault counts as present between its bursts: a vehicle with a loose contact is
    not healthy.
    """
    # a sample shows the severities of the step that led to it
    time = np.arange(-1, n_samples - 1) * SAMPLE_TIME + TIME_TOLERANCE
    if diagnoses is None:
        diagnoses = [fault.diagnosis for fault in plant_faults().values()]
    names = classes()
    of_fault = np.array([names.index(diagnosis) for diagnosis in diagnoses])
    permanent = profile_of(plan)._replace(period=np.zeros(plan.fault.shape))
    profiles = np.stack(permanent, axis=-1)
    label = np.zeros((n_samples, len(plan.fault)), np.int64)
    worst = np.zeros(label.shape, np.float32)
    for event, fault in enumerate(plan.fault.T):
        severity = severities_over_time(time, profiles[:, [event]])
        label = np.where(severity > worst, of_fault[fault], label)
        worst = np.maximum(worst, severity.astype(np.float32))
    return label, worst


def manoeuvres(seed: int, n_samples: int, n_lanes: int) -> np.ndarray:
    """Random square waves of speed offset, rudder and stern plane, (n_samples, n_lanes, 3).

    Half of the lanes follow the mission as it is; the others swing by up to 0.15 m/s with
    half-periods of 2 to 12 s. A third of them uses rudder and stern plane as well, up to 0.3 rad.
    """
    random = np.random.default_rng(seed)
    half_period = random.uniform(2.0, 12.0, (n_lanes, 3))
    phase = random.uniform(0.0, 24.0, (n_lanes, 3))
    amplitude = random.uniform(0.0, 1.0, (n_lanes, 3)) * [0.15, 0.3, 0.3]
    amplitude *= random.uniform(size=(n_lanes, 3)) < [0.5, 0.3, 0.3]
    return square_waves(amplitude, half_period, phase, np.arange(n_samples))


def square_waves(
    amplitude: np.ndarray, half_period: np.ndarray, phase: np.ndarray, samples: np.ndarray
) -> np.ndarray:
    """Square waves (n_samples, n_lanes, n_inputs); half-periods and phases in seconds.

    samples (n_samples,) are their numbers from the start.
    """
    time = samples[:, None, None] * SAMPLE_TIME
    n_halves = np.floor((time + phase) / half_period)
    return amplitude * np.where(n_halves % 2 == 0, 1.0, -1.0)
