"""Section V.D of the report, the network behind the parameter filter: rows thesis | ours, tables and figures."""

from typing import Any

import numpy as np

from auv_fault_env.faults import labels
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import ALPHA_WINDOW, BETA_WINDOW, MODES_5_2, NOMINAL, severity
from training.thesis.backpropagation import rms
from training.thesis.comparison import ALPHA, BETA, Comparison, share, spread
from training.thesis.kalman_networks import (
    CHECKPOINTS,
    GRADE,
    GRID,
    ONSET,
    SIZES,
    TARGETS,
    KalmanStudy,
    Response,
    identified_after,
    named_correctly,
    normal_before,
    responses,
    severity_error,
)
from training.thesis.page import SPEED_CHANGES

FEW, ENOUGH = SIZES
WINDOWS = {"alpha": list(ALPHA_WINDOW), "beta": list(BETA_WINDOW)}
INSTANTS = (10.0, 15.0, 19.9, 21.0, 60.0)  # s, marked along the trajectories


def sections(view: Comparison, study: KalmanStudy, columns: list[str]) -> list[dict[str, Any]]:
    """All of V.D that concerns the network."""
    return [
        map_section(view, study, columns),
        table_5_2(view, study),
        run_section(view, study, columns),
    ]


def map_section(view: Comparison, study: KalmanStudy, columns: list[str]) -> dict[str, Any]:
    """Figure 5.12 and the two sizes."""
    axis = np.linspace(0.0, 1.0, GRID)
    square = lambda heights: np.round(heights.reshape(GRID, GRID), 3).tolist()  # noqa: E731
    surfaces = {"target: the fault map": square(GRADE)}
    surfaces |= {
        f"2-{size}-5, mean of networks": square(severity(study.surface[size]).mean(axis=0))
        for size in SIZES
    }
    return {
        "heading": "V.D: the network behind the parameter filter",
        "text": [
            f"Two inputs (alpha and beta, normalised as in V.B), five outputs, trained by the same rule on {GRID} × "
            f"{GRID} points of the fault map alone, up to {CHECKPOINTS[-1]:,} presentations, the weights of the least "
            f"rms error kept; {len(study.surface[ENOUGH])} networks of each size. Of the map the windows are given "
            "(V.B), the picture is lost (Fig. 5.1): ours grades each mode by the severity of the catalogue's fault. "
            "The height of the decision surface is the sum of the four fault outputs, 0 for normal and 1 for a lost "
            "propeller. Where two modes meet, the sum of smooth outputs dips or swells.",
        ],
        "table": {"columns": columns, "rows": [*window_rows(view), *map_rows(view, study)]},
        "figures": [
            {
                "plot": "decision_surfaces",
                "name": "fig-5-12",
                "caption": "Fig. 5.12: decision surface of the severity, target and networks with four and with eight "
                "hidden nodes. Dashed: the window of normal operation.",
                "data": {"axis": axis.round(4).tolist(), "surfaces": surfaces, "windows": WINDOWS},
            }
        ],
    }


def window_rows(view: Comparison) -> list[list[str]]:
    """Figure 5.1: the windows of normal operation."""
    why = "Taken over. In words the thesis gives 25 % less for beta; its numbers are 28 %."
    rows = []
    for name, nominal, given, window in (
        ("alpha", NOMINAL[ALPHA], "0.5, 0.4 to 0.6", ALPHA_WINDOW),
        ("beta", NOMINAL[BETA], "0.9, 0.65 to 1.0", BETA_WINDOW),
    ):
        ours = f"{nominal}, {window[0]} to {window[1]}"
        quantity = f"normalised {name}: nominal, normal window"
        reason = why if name == "beta" else "Taken over."
        rows.append(view.row("V.B, Fig. 5.1", quantity, given, ours, "-", ours == given, reason))
    return rows


def map_rows(view: Comparison, study: KalmanStudy) -> list[list[str]]:
    """What four and eight hidden nodes can do."""
    few, enough = (study.surface[size] for size in SIZES)
    error = {size: severity_error(study.surface[size]) for size in SIZES}
    ratio = error[FEW].mean() / error[ENOUGH].mean()
    isolates = [named_correctly(outputs).mean(axis=1) for outputs in (few, enough)]
    worst = MODES_5_2[named_correctly(few).mean(axis=0).argmin()]
    error_of = lambda size: f"rms {spread(rms(study.surface[size], TARGETS), '.3f')}"  # noqa: E731
    rows = [
        ("2-4-5: modes of the map named correctly, mean of modes", "detects and isolates", share(isolates[0]),
         isolates[0].mean() > 0.9, f"Weakest: {worst}, {share(named_correctly(few).min(axis=1))}; {error_of(FEW)}."),
        ("2-4-5: mean error of the severity", "not reliable", spread(error[FEW], ".3f"), ratio > 1.25,
         f"Of 1, over the faulty points; {ratio:.1f} times that of eight nodes. Small grades are flattened."),
        ("2-8-5: modes of the map named correctly, mean of modes", "detects and isolates", share(isolates[1]),
         isolates[1].mean() > 0.9, f"{error_of(ENOUGH)}."),
        ("2-8-5: mean error of the severity", "reliable", spread(error[ENOUGH], ".3f"), error[ENOUGH].mean() < 0.05,
         "Of 1, over the faulty points; most of it where modes meet and at small grades."),
    ]  # fmt: skip
    return [
        view.row("V.D.1, Fig. 5.12", quantity, thesis, ours, "-", bool(met), why)
        for quantity, thesis, ours, met, why in rows
    ]


def table_5_2(view: Comparison, study: KalmanStudy) -> dict[str, Any]:
    """Table 5.2 beside our classes, with the recall of each mode."""
    rows = []
    for k, mode in enumerate(MODES_5_2):
        classes = ", ".join(name for name, modes in labels().items() if modes[1] == mode)
        recalled = [share(named_correctly(study.surface[size])[:, k]) for size in SIZES]
        rows.append([mode, f"y{k + 1}", classes, *recalled, view.command])
    return {
        "heading": "Table 5.2: operating modes of the Kalman-fed network",
        "text": [
            "Share of the map's points of each mode that the largest output names. The fault vectors are those of "
            "Table 5.1 with five places; here the fault's place holds its severity instead of 1."
        ],
        "table": {
            "columns": [
                "operating mode", "fault vector", "our classes", *(f"named correctly, 2-{size}-5" for size in SIZES),
                "command",
            ],
            "rows": rows,
        },
    }  # fmt: skip


def run_section(view: Comparison, study: KalmanStudy, columns: list[str]) -> dict[str, Any]:
    """Figures 5.14 to 5.20: filter and network together."""
    answers = {
        run: responses(view, run, study.networks[ENOUGH]) for run in ("normal", "drag", "loss")
    }
    rows = [normal_row(view, answers["normal"]), before_row(view, answers["drag"])]
    rows += [identified_row(view, answers["drag"]), trajectory_row(view, answers["drag"])]
    rows += [
        grade_row(view, answers["drag"]),
        beta_row(view, answers["drag"]),
        *loss_rows(view, answers["loss"]),
    ]
    return {
        "heading": "V.D: filter and network together",
        "text": [
            "The 2-8-5 networks read the estimates of the test runs above: all of them the noise-free ones, and each "
            "those of a noisy run of its own. A mode is identified when its output is the largest from then on to the "
            "end at 60 s."
        ],
        "table": {"columns": columns, "rows": rows},
        "figures": [
            response_figure(
                answers["drag"],
                "fig-5-16",
                "Fig. 5.16: response of the network to increased drag (+35 % at 10 s).",
            ),
            trajectory_figure(
                study,
                {"increased drag (5.17)": answers["drag"], "port propeller lost": answers["loss"]},
            ),
            response_figure(
                answers["loss"],
                "fig-5-20",
                "Fig. 5.20: response of the network to the loss of the port propeller at 10 s.",
            ),
        ],
    }


def normal_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """A healthy run is named normal throughout."""
    named = [(answer.outputs.argmax(axis=-1) == 0).mean(axis=1) for answer in answers]
    why = "The first samples of a noisy run, before the filter knows the speed, can lie outside the window."
    quantity = "normal run: samples named normal"
    met = bool(named[0].mean() > 0.99)
    return view.row("V.D, Fig. 5.14", quantity, "all", *map(share, named), met, why)


def before_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """Figure 5.16: the first ten seconds."""
    named = [normal_before(answer) for answer in answers]
    quantity = "alpha +35 %: samples of the first 10 s named normal"
    met = bool(named[0].mean() > 0.99)
    return view.row("V.D, Fig. 5.16", quantity, "all", *map(share, named), met, "")


def identified_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """Figure 5.16: when the drag is identified."""
    times = [ONSET + identified_after(answer, "increased drag") for answer in answers]
    why = (
        "With us the speed change at 20 s decides. While the vehicle accelerates, more drag and less thrust look much "
        "alike, and the estimate lies between both, inside the normal window. When the command falls, the shafts stop, "
        "and drag alone is left. The thesis' controller and gains are unknown; another course of the shafts in these "
        "ten seconds may tell the two apart sooner."
    )
    met = bool(10.0 < times[0].mean() <= 20.0)
    quantity = "alpha +35 %: identified as increased drag at"
    return view.row(
        "V.D, Fig. 5.16", quantity, "10 to 20 s", *(spread(t, ".1f", " s") for t in times), met, why
    )


def trajectory_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """Figure 5.17: where the trajectory ends."""
    clean, noisy = (answer.points for answer in answers)
    text = f"from {_place(clean[0, 100])} to {_place(clean[0, -1])}"
    noise = f"to {noisy[:, -1, ALPHA].mean():.2f} ± {noisy[:, -1, ALPHA].std(ddof=1):.2f}, "
    noise += f"{noisy[:, -1, BETA].mean():.2f} ± {noisy[:, -1, BETA].std(ddof=1):.2f}"
    why = "Alpha, then beta. The text at Fig. 5.17 swaps the two normal values; V.B gives alpha 0.5 and beta 0.9."
    met = bool(clean[0, -1, ALPHA] > ALPHA_WINDOW[1] and clean[0, -1, BETA] > BETA_WINDOW[0])
    thesis = "from normal (0.5, 0.9) to increased drag"
    return view.row(
        "V.D, Fig. 5.17", "alpha +35 %: way of the estimate", thesis, text, noise, met, why
    )


def _place(point: np.ndarray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f})"


def grade_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """Figure 5.16: the severity of the drag fault."""
    height = [severity(answer.outputs)[:, -1] for answer in answers]
    quantity = "alpha +35 %: fault value at 60 s"
    why = "0.35 on our map, on the slope beside the normal window; within 0.1 agrees."
    met = bool(abs(height[0].mean() - 0.35) < 0.1)
    return view.row(
        "V.D, Fig. 5.16", quantity, "graded", *(spread(h, ".2f") for h in height), met, why
    )


def beta_row(view: Comparison, answers: tuple[Response, Response]) -> list[str]:
    """Figures 5.15 and 5.17: the excursion of beta, as the network sees it."""
    lowest = [answer.points[:, 100:, BETA].min(axis=1) for answer in answers]
    last = [answer.points[:, -1, BETA] for answer in answers]
    text = [
        f"down to {spread(low, '.2f')}, back to {spread(end, '.2f')}"
        for low, end in zip(lowest, last, strict=True)
    ]
    low = lowest[0].mean()
    end = last[0].mean()
    met = bool(low < 0.97 * NOMINAL[1] and abs(end / NOMINAL[1] - 1) < 0.02)
    why = f"It stays inside the normal window, which begins at {BETA_WINDOW[0]}: what the thesis gives the window for."
    return view.row(
        "V.D, Fig. 5.15",
        "alpha +35 %: normalised beta (normal 0.9)",
        "changes, and returns",
        *text,
        met,
        why,
    )


def loss_rows(view: Comparison, answers: tuple[Response, Response]) -> list[list[str]]:
    """Figure 5.20: the fault value, and when."""
    height = [severity(answer.outputs)[:, -1] for answer in answers]
    first = [
        ONSET + np.argmax(severity(a.outputs)[:, 101:] > 0.5, axis=1) / SAMPLE_RATE + 0.1
        for a in answers
    ]
    times = [ONSET + identified_after(answer, "severe propulsion failure") for answer in answers]
    where = "V.D, Fig. 5.20"
    met = height[0].mean() > 0.9
    why = (
        "Before the speed change at 20 s alpha falls with beta, and the fault is called decreased drag of the highest "
        "grade. With noise, beta at 0.45 is near the border of severe failure (0.5) and crosses it at later changes; "
        "the severity stays high."
    )

    def row(quantity, thesis, text, met, why):
        return view.row(where, quantity, thesis, *text, bool(met), why)

    return [
        row("one propeller lost: fault value at 60 s (0 to 1)", "high", [spread(h, ".2f") for h in height], met,
            "The map gives 1 at a whole propeller lost, by construction; the network and the filter keep to it."),
        row("one propeller lost: fault value above 0.5 first at", "after 10 s", [spread(t, ".1f", " s") for t in first],
            10.0 < first[0].mean() < 20.0, "Half of the thrust leaves at once, and the first readings show it."),
        row("one propeller lost: named severe propulsion failure to the end from", "after 10 s",
            [spread(t, ".1f", " s") for t in times], times[0].mean() > 10.0, why),
    ]  # fmt: skip


def response_figure(answers: tuple[Response, Response], name: str, caption: str) -> dict[str, Any]:
    """Outputs over time, noise-free and with noise."""
    titles = ("noise-free estimates", "estimates under default noise")
    n_samples = answers[0].outputs.shape[1]
    return {
        "plot": "network_response",
        "name": name,
        "caption": f"{caption} Mean ± standard deviation over networks; dotted: changes of the speed command.",
        "data": {
            "time": (np.arange(n_samples) / SAMPLE_RATE).tolist(),
            "modes": list(MODES_5_2),
            "panels": dict(zip(titles, map(_lines, answers), strict=True)),
            "onset": ONSET,
            "speed_changes": SPEED_CHANGES,
        },
    }


def _lines(answer: Response) -> dict[str, list[list[float]]]:
    """Mean and std of the outputs and, last, of the severity, (n_modes + 1, n_samples)."""
    lines = np.concatenate([answer.outputs, severity(answer.outputs)[..., None]], axis=-1)
    compact = lambda values: np.round(values.T, 3).tolist()  # noqa: E731
    return {"mean": compact(lines.mean(axis=0)), "std": compact(lines.std(axis=0, ddof=1))}


def trajectory_figure(
    study: KalmanStudy, runs: dict[str, tuple[Response, Response]]
) -> dict[str, Any]:
    """Figure 5.17: the way of the estimates over the map."""
    paths = {
        title: {
            "clean": np.round(clean.points[0], 4).tolist(),
            "noisy": np.round(noisy.points[0, 50:], 4).tolist(),
            "marks": [round(time * SAMPLE_RATE) for time in INSTANTS],
        }
        for title, (clean, noisy) in runs.items()
    }
    return {
        "plot": "trajectories",
        "name": "fig-5-17",
        "caption": "Fig. 5.17: way of the estimates over the fault map, the fault beginning at 10 s; dashed: normal "
        "operation. The noisy run is drawn from 5 s on.",
        "data": {
            "axis": np.linspace(0.0, 1.0, GRID).round(4).tolist(),
            "surface": np.round(GRADE.reshape(GRID, GRID), 3).tolist(),
            "windows": WINDOWS,
            "paths": paths,
            "instants": list(INSTANTS),
        },
    }
