"""All figures of the reports by name."""

from collections.abc import Callable, Mapping
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from training.report.figures import (
    ablation,
    advisory,
    benchmark,
    bounds,
    datasets,
    excitations,
    field,
    learning,
    runs,
    scores,
    speed,
    stimuli,
    stimulus_front,
    thesis,
)
from training.report.figures.style import STYLE

PLOTS: dict[str, Callable[..., Figure]] = {
    "ablation_scores": ablation.ablation_scores,
    "ablation_curves": ablation.ablation_curves,
    "filter_response": runs.filter_response,
    "transients": runs.transients,
    "consistency": runs.consistency,
    "learning_curve": learning.learning_curve,
    "isolation_curves": scores.isolation_curves,
    "confusion_matrix": scores.confusion_matrix,
    "reliability_diagrams": scores.reliability_diagrams,
    "severities": scores.severities,
    "curves": benchmark.curves,
    "cost_delay": benchmark.cost_delay,
    "class_delays": benchmark.class_delays,
    "episodes": benchmark.episodes,
    "isolability_maps": bounds.isolability_maps,
    "sensor_removal": bounds.sensor_removal,
    "cramer_rao": bounds.cramer_rao,
    "rank_histograms": bounds.rank_histograms,
    "network_outputs": thesis.network_outputs,
    "confusion_by_size": thesis.confusion_by_size,
    "decision_surfaces": thesis.decision_surfaces,
    "network_response": thesis.network_response,
    "trajectories": thesis.trajectories,
    "speed_ups": stimuli.speed_ups,
    "delay_cost_plane": stimuli.delay_cost_plane,
    "around_onset": stimuli.around_onset,
    "active_episodes": stimuli.active_episodes,
    "speed_history": speed.speed_history,
    "stimulus_front": stimulus_front.stimulus_front,
    "evidence_energy": excitations.evidence_energy,
    "outcome_shares": advisory.outcome_shares,
    "confusion_grid": datasets.confusion_grid,
    "healthy_band": datasets.healthy_band,
    "diagnosed_log": field.diagnosed_log,
    "measured_and_simulated": field.measured_and_simulated,
    "mission_estimates": field.mission_estimates,
}


def draw(plot: str, data: Mapping[str, Any]) -> Figure:
    """The figure of a name in `PLOTS`, in the common style."""
    with matplotlib.rc_context(STYLE):
        return PLOTS[plot](**data)
