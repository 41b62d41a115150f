"""Sections of the report on V.D, the network behind the parameter filter: rows and figures."""

from typing import Any

import numpy as np

from auv_fault_env.faults import labels
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import (
    ALPHA_WINDOW,
    BETA_WINDOW,
    MODES_5_2,
    NOMINAL,
    severity,
)
from training.report.sections import figure, table_section
from training.thesis.backpropagation import rms_error
from training.thesis.comparison import (
    ALPHA,
    BETA,
    COLUMNS,
    SPEED_CHANGES,
    Comparison,
    mean_and_std,
    mean_and_std_percent,
)
from training.thesis.kalman_networks import (
    CHECKPOINTS,
    GRID,
    ONSET,
    SIZES,
    TARGETS,
    TRUE_SEVERITY,
    KalmanStudy,
    Response,
    accuracy_by_mode,
    responses,
    severity_error,
    share_normal_before_onset,
    time_to_identification,
)

FEW, ENOUGH = SIZES
WINDOWS = {"alpha": list(ALPHA_WINDOW), "beta": list(BETA_WINDOW)}
INSTANTS = (10.0, 15.0, 19.9, 21.0, 60.0)  # s, marked along the trajectories
MAP_AXIS = np.linspace(0.0, 1.0, GRID).round(4).tolist()
Responses = tuple[Response, Response]  # without and with noise


def sections(comparison: Comparison, study: KalmanStudy) -> list[dict[str, Any]]:
    """All sections of V.D that concern the network."""
    return [
        map_section(comparison, study),
        table_5_2(study),
        run_section(comparison, study),
    ]


def map_section(comparison: Comparison, study: KalmanStudy) -> dict[str, Any]:
    """Figure 5.12 and the two sizes."""
    text = (
        "Two inputs (alpha and beta, normalised as in V.B), five outputs, trained by the same rule "
        f"on {GRID} × {GRID} points of the fault map alone, up to {CHECKPOINTS[-1]:,} "
        "presentations; the weights with the least rms error are used. "
        f"{len(study.outputs[ENOUGH])} networks of each size. The thesis gives the windows of the "
        "map (V.B), but its picture (Fig. 5.1) is lost: our map grades each mode by the severity "
        "of the catalogue's fault. The height of the decision surface is the sum of the four fault "
        "outputs, 0 for normal and 1 for a lost propeller. Where two modes meet, the sum of smooth "
        "outputs is too low or too high."
    )
    rows = [*window_rows(comparison), *map_rows(comparison, study)]
    section = table_section("V.D: the network behind the parameter filter", COLUMNS, rows, text)
    return section | {"figures": [surface_figure(study)]}


def surface_figure(study: KalmanStudy) -> dict[str, Any]:
    """Figure 5.12: the severity over the map, target and mean of the networks of each size."""
    surfaces = {"target: the fault map": _on_map(TRUE_SEVERITY)}
    for size in SIZES:
        mean = severity(study.outputs[size]).mean(axis=0)
        surfaces[f"2-{size}-5, mean of networks"] = _on_map(mean)
    caption = (
        "Thesis Fig. 5.12: decision surface of the severity, target and networks with four and "
        "with eight hidden nodes. Dashed: the window of normal operation."
    )
    data = {"axis": MAP_AXIS, "surfaces": surfaces, "windows": WINDOWS}
    return figure("decision_surfaces", "fig-5-12", caption, data)


def _on_map(heights: np.ndarray) -> list[list[float]]:
    """Heights (n_points,) as a square, (n_alpha, n_beta)."""
    return np.round(heights.reshape(GRID, GRID), 3).tolist()


def window_rows(comparison: Comparison) -> list[list[str]]:
    """Figure 5.1: the windows of normal operation."""
    beta_why = "Taken over. In words the thesis states 25 % less for beta; its numbers are 28 %."
    cases = (
        ("alpha", NOMINAL[ALPHA], ALPHA_WINDOW, "0.5, 0.4 to 0.6", "Taken over."),
        ("beta", NOMINAL[BETA], BETA_WINDOW, "0.9, 0.65 to 1.0", beta_why),
    )
    rows = []
    for name, nominal, window, thesis, why in cases:
        quantity = f"normalised {name}: nominal, normal window"
        ours = f"{nominal}, {window[0]} to {window[1]}"
        row = comparison.row("V.B, Fig. 5.1", quantity, thesis, ours, "-", ours == thesis, why)
        rows.append(row)
    return rows


def map_rows(comparison: Comparison, study: KalmanStudy) -> list[list[str]]:
    """What four and eight hidden nodes can do."""
    error = {size: severity_error(study.outputs[size]) for size in SIZES}
    accuracy = {size: accuracy_by_mode(study.outputs[size]) for size in SIZES}
    rms = {}
    for size in SIZES:
        errors = rms_error(study.outputs[size], TARGETS)
        rms[size] = f"rms {mean_and_std(errors, '.3f')}"
    ratio = error[FEW].mean() / error[ENOUGH].mean()
    weakest = MODES_5_2[accuracy[FEW].mean(axis=0).argmin()]
    least = mean_and_std_percent(accuracy[FEW].min(axis=1))
    few_why = (
        f"Of 1, over the faulty points; {ratio:.1f} times that of eight nodes. Small "
        "severities are underestimated."
    )
    enough_why = (
        "Of 1, over the faulty points; most of it where modes meet and at small severities."
    )
    cases = (
        (
            FEW,
            f"Weakest: {weakest}, {least}; {rms[FEW]}.",
            "not reliable",
            ratio > 1.25,
            few_why,
        ),
        (
            ENOUGH,
            f"{rms[ENOUGH]}.",
            "reliable",
            error[ENOUGH].mean() < 0.05,
            enough_why,
        ),
    )
    where = "V.D.1, Fig. 5.12"
    rows = []
    for size, named_why, reliability, agrees, why in cases:
        quantity = f"2-{size}-5: modes of the map named correctly, mean of modes"
        named = accuracy[size].mean(axis=1)
        ours = (mean_and_std_percent(named), "-", named.mean() > 0.9, named_why)
        rows.append(comparison.row(where, quantity, "detects and isolates", *ours))
        quantity = f"2-{size}-5: mean error of the severity"
        ours = (mean_and_std(error[size], ".3f"), "-", agrees, why)
        rows.append(comparison.row(where, quantity, reliability, *ours))
    return rows


def table_5_2(study: KalmanStudy) -> dict[str, Any]:
    """Table 5.2 beside our classes, with the accuracy of each mode."""
    accuracy = {size: accuracy_by_mode(study.outputs[size]) for size in SIZES}
    rows = []
    for k, mode in enumerate(MODES_5_2):
        classes = [name for name, modes in labels().items() if modes[1] == mode]
        shares = [mean_and_std_percent(accuracy[size][:, k]) for size in SIZES]
        rows.append([mode, f"y{k + 1}", ", ".join(classes), *shares])
    columns = ["operating mode", "fault vector", "our classes"]
    columns += [f"named correctly, 2-{size}-5" for size in SIZES]
    text = (
        "Share of the map's points of each mode for which the output of that mode is the largest. "
        "The fault vectors are those of Table 5.1 with five places; here the place of the fault "
        "holds its severity instead of 1."
    )
    heading = "Table 5.2: operating modes of the Kalman-fed network"
    return table_section(heading, columns, rows, text)


def run_section(comparison: Comparison, study: KalmanStudy) -> dict[str, Any]:
    """Figures 5.14 to 5.20: filter and network together."""
    networks = study.networks[ENOUGH]
    drag = responses(comparison, "drag", networks)
    loss = responses(comparison, "loss", networks)
    rows = [
        normal_row(comparison, responses(comparison, "normal", networks)),
        before_row(comparison, drag),
        identified_row(comparison, drag),
        trajectory_row(comparison, drag),
        severity_row(comparison, drag),
        beta_row(comparison, drag),
        *loss_rows(comparison, loss),
    ]
    text = (
        "The 2-8-5 networks get the estimates of the test runs above: all of them those without "
        "noise, and each those of one noisy run. A mode is identified when its output is the "
        "largest from then on to the end at 60 s."
    )
    drag_caption = "Thesis Fig. 5.16: response of the network to increased drag (+35 % at 10 s)."
    loss_caption = (
        "Thesis Fig. 5.20: response of the network to the loss of the port propeller at 10 s."
    )
    figures = [
        response_figure(drag, "fig-5-16", drag_caption),
        trajectory_figure({"increased drag (5.17)": drag, "port propeller lost": loss}),
        response_figure(loss, "fig-5-20", loss_caption),
    ]
    section = table_section("V.D: filter and network together", COLUMNS, rows, text)
    return section | {"figures": figures}


def normal_row(comparison: Comparison, both: Responses) -> list[str]:
    """A healthy run is named normal throughout."""
    clean, noisy = ((response.outputs.argmax(axis=-1) == 0).mean(axis=1) for response in both)
    why = (
        "The first samples of a noisy run, before the filter knows the speed, can lie outside the "
        "window."
    )
    texts = map(mean_and_std_percent, (clean, noisy))
    quantity = "normal run: samples named normal"
    return comparison.row("V.D, Fig. 5.14", quantity, "all", *texts, clean.mean() > 0.99, why)


def before_row(comparison: Comparison, both: Responses) -> list[str]:
    """Figure 5.16: the first ten seconds."""
    clean, noisy = map(share_normal_before_onset, both)
    texts = map(mean_and_std_percent, (clean, noisy))
    quantity = "alpha +35 %: samples of the first 10 s named normal"
    return comparison.row("V.D, Fig. 5.16", quantity, "all", *texts, clean.mean() > 0.99, "")


def identified_row(comparison: Comparison, both: Responses) -> list[str]:
    """Figure 5.16: when the drag is identified."""
    times = [ONSET + time_to_identification(response, "increased drag") for response in both]
    texts = [mean_and_std(time, ".1f", " s") for time in times]
    agrees = 10.0 < times[0].mean() <= 20.0
    why = (
        "With us the speed change at 20 s decides. While the vehicle accelerates, more drag and "
        "less thrust look much alike, and the estimate lies between both, inside the normal "
        "window. When the command falls, the shafts stop, and drag alone is left. The thesis' "
        "controller and gains are unknown; with other shaft speeds in these ten seconds the two "
        "may be distinguished sooner."
    )
    quantity = "alpha +35 %: identified as increased drag at"
    return comparison.row("V.D, Fig. 5.16", quantity, "10 to 20 s", *texts, agrees, why)


def trajectory_row(comparison: Comparison, both: Responses) -> list[str]:
    """Figure 5.17: where the trajectory ends."""
    clean, noisy = (response.points for response in both)
    end = clean[0, -1]
    noisy_alpha = mean_and_std(noisy[:, -1, ALPHA], ".2f")
    noisy_beta = mean_and_std(noisy[:, -1, BETA], ".2f")
    thesis = "from normal (0.5, 0.9) to increased drag"
    texts = (
        f"from {_point(clean[0, 100])} to {_point(end)}",
        f"to {noisy_alpha}, {noisy_beta}",
    )
    agrees = end[ALPHA] > ALPHA_WINDOW[1] and end[BETA] > BETA_WINDOW[0]
    why = (
        "Alpha, then beta. The text at Fig. 5.17 swaps the two normal values; V.B states alpha 0.5 "
        "and beta 0.9."
    )
    quantity = "alpha +35 %: path of the estimate"
    return comparison.row("V.D, Fig. 5.17", quantity, thesis, *texts, agrees, why)


def _point(point: np.ndarray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f})"


def severity_row(comparison: Comparison, both: Responses) -> list[str]:
    """Figure 5.16: the severity of the drag fault."""
    at_end = [severity(response.outputs)[:, -1] for response in both]
    texts = [mean_and_std(values, ".2f") for values in at_end]
    agrees = abs(at_end[0].mean() - 0.35) < 0.1
    quantity = "alpha +35 %: fault value at 60 s"
    why = "0.35 on our map, on the slope beside the normal window; within 0.1 agrees."
    return comparison.row("V.D, Fig. 5.16", quantity, "graded", *texts, agrees, why)


def beta_row(comparison: Comparison, both: Responses) -> list[str]:
    """Figures 5.15 and 5.17: the excursion of beta, as the network gets it."""
    least = [response.points[:, 100:, BETA].min(axis=1) for response in both]
    last = [response.points[:, -1, BETA] for response in both]
    texts = []
    for low, end in zip(least, last, strict=True):
        texts.append(f"down to {mean_and_std(low, '.2f')}, back to {mean_and_std(end, '.2f')}")
    falls = least[0].mean() < 0.97 * NOMINAL[BETA]
    returns = abs(last[0].mean() / NOMINAL[BETA] - 1) < 0.02
    why = (
        f"It stays inside the normal window, which begins at {BETA_WINDOW[0]}: the window is "
        "meant for this."
    )
    quantity = "alpha +35 %: normalised beta (normal 0.9)"
    thesis = "changes, and returns"
    return comparison.row("V.D, Fig. 5.15", quantity, thesis, *texts, falls and returns, why)


def loss_rows(comparison: Comparison, both: Responses) -> list[list[str]]:
    """Figure 5.20: the fault value, and when it rises."""
    heights = [severity(response.outputs) for response in both]
    at_end = [height[:, -1] for height in heights]
    risen = [_first_above_half(height) for height in heights]
    named = [ONSET + time_to_identification(r, "severe propulsion failure") for r in both]
    end_why = (
        "By construction the map is 1 at a whole propeller lost; the network and the filter "
        "reproduce it."
    )
    named_why = (
        "Before the speed change at 20 s alpha falls with beta, and the fault is named "
        "decreased drag of the highest severity. With noise, beta at 0.45 is near the border "
        "of severe failure (0.5) and crosses it at later changes; the severity stays high."
    )

    def row(quantity, thesis, values, form, agrees, why):
        texts = [mean_and_std(of_networks, *form) for of_networks in values]
        quantity = f"one propeller lost: {quantity}"
        return comparison.row("V.D, Fig. 5.20", quantity, thesis, *texts, agrees, why)

    is_high = at_end[0].mean() > 0.9
    risen_in_time = 10.0 < risen[0].mean() < 20.0
    risen_why = "Half of the thrust leaves at once, and the first readings show it."
    time = (".1f", " s")
    late = named[0].mean() > 10.0
    named_from = "named severe propulsion failure to the end from"
    return [
        row("fault value at 60 s (0 to 1)", "high", at_end, [".2f"], is_high, end_why),
        row(
            "fault value above 0.5 first at",
            "after 10 s",
            risen,
            time,
            risen_in_time,
            risen_why,
        ),
        row(named_from, "after 10 s", named, time, late, named_why),
    ]


def _first_above_half(height: np.ndarray) -> np.ndarray:
    """Time [s] after the onset at which the severity first exceeds 0.5, (n_networks,)."""
    sample = np.argmax(height[:, 101:] > 0.5, axis=1)
    return ONSET + sample / SAMPLE_RATE + 0.1


def response_figure(both: Responses, name: str, caption: str) -> dict[str, Any]:
    """Outputs over time, without and with noise."""
    clean, noisy = map(_lines, both)
    note = "Mean ± standard deviation over networks; dotted: changes of the speed command."
    data = {
        "time": (np.arange(both[0].outputs.shape[1]) / SAMPLE_RATE).tolist(),
        "modes": list(MODES_5_2),
        "panels": {
            "noise-free estimates": clean,
            "estimates under default noise": noisy,
        },
        "onset": ONSET,
        "speed_changes": SPEED_CHANGES,
    }
    return figure("network_response", name, f"{caption} {note}", data)


def _lines(response: Response) -> dict[str, list[list[float]]]:
    """Mean and std of the outputs and, last, of the severity, (n_modes + 1, n_samples)."""
    height = severity(response.outputs)[..., None]
    lines = np.concatenate([response.outputs, height], axis=-1)
    mean = lines.mean(axis=0).T
    std = lines.std(axis=0, ddof=1).T
    return {"mean": np.round(mean, 3).tolist(), "std": np.round(std, 3).tolist()}


def trajectory_figure(runs: dict[str, Responses]) -> dict[str, Any]:
    """Figure 5.17: the path of the estimates over the map, a panel per run."""
    paths = {}
    for title, (clean, noisy) in runs.items():
        paths[title] = {
            "clean": np.round(clean.points[0], 4).tolist(),
            "noisy": np.round(noisy.points[0, 50:], 4).tolist(),
            "marks": [round(time * SAMPLE_RATE) for time in INSTANTS],
        }
    caption = (
        "Thesis Fig. 5.17: path of the estimates over the fault map, the fault beginning at 10 s. "
        "Dashed: normal operation. The noisy run is shown from 5 s on."
    )
    surface = _on_map(TRUE_SEVERITY)
    data = {"axis": MAP_AXIS, "surface": surface, "windows": WINDOWS, "paths": paths}
    return figure("trajectories", "fig-5-17", caption, data | {"instants": list(INSTANTS)})
