"""Report on the thesis' test runs: rows thesis | ours, figures, and why ours differs."""

from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.parameters import FOOT, SAMPLE_RATE
from training.report.sections import figure, table_section
from training.thesis.appendix_a import appendix_section, constants_section
from training.thesis.comparison import (
    ALPHA,
    ALPHA_FT,
    BETA,
    BETA_FT,
    COLUMNS,
    SPEED_CHANGES,
    TRUE_PARAMETERS,
    VEHICLE,
    Comparison,
    error_texts,
    estimate_texts,
)
from training.thesis.summary import summary

END_IV_C = 50.0  # s: the speed command changes at 10, 20, 30 and 40 s
LINES = " Lines: noise-free; bands: mean ± one standard deviation of the noisy runs."
START_SAMPLES = 400  # of the runs from rest, as in Figs 5.3 to 5.6


def report_on_test_runs(comparison: Comparison) -> dict[str, Any]:
    """The report on the test runs as plain data."""
    n_seeds = comparison.noisy.mean.shape[2]
    sections = [
        identification_section(comparison),
        response_section(comparison),
        transient_section(comparison),
        start_section(comparison),
        appendix_section(),
        constants_section(VEHICLE),
    ]
    return {
        "title": "The thesis reproduced, chapters III to VI: its results and ours",
        "command": comparison.command,
        "intro": [
            "Neural network based propulsion system fault diagnostics for the NPS AUV II, Naval "
            "Postgraduate School, June 1992. The plant, both controllers and the parameter filter "
            "repeat the thesis' test runs: without noise, as the thesis must have run them, and "
            "with this project's default sensor noise, mean ± standard deviation over "
            f"{n_seeds} seeds. The vehicle is the nominal one in still water. In the runs without "
            "noise the filter assumes a tenth of the default noise; with noise it assumes the true "
            "one.",
            "Controller gains, the size of the faults of V.C, the propellers' inertia and the "
            "noise are not in the thesis; ours are documented defaults. Transients therefore agree "
            "in kind, not point by point.",
        ],
        "summary": summary(sections),
        "sections": sections,
    }


class Identification(NamedTuple):
    """One parameter that the thesis identifies; nominal value and estimate are in `unit`.

    Attributes
    ----------
    run, parameter
        The test run, and the index of the parameter.
    figure, change
        Number of the thesis' figure, and the change of the parameter as text.
    limit
        The thesis' error at the end [%].
    per_si
        One SI unit in the thesis' unit.
    form
        Format of the numbers.
    """

    run: str
    parameter: int
    figure: str
    change: str
    thesis: float
    limit: float
    nominal: float
    unit: str
    per_si: float
    si_unit: str
    form: str


ALPHA_CASE = ("drag", ALPHA, "4.1", "alpha +35 %", -0.0332, 0.3)
BETA_CASE = ("thrust", BETA, "4.2", "beta -35 %", 2.1945e-7, 0.2)
IDENTIFICATIONS = (
    Identification(*ALPHA_CASE, ALPHA_FT, "1/ft", FOOT, "1/m", ".4f"),
    Identification(*BETA_CASE, BETA_FT, "(ft/s²)/rpm²", 1 / FOOT, "(m/s²)/rpm²", ".4e"),
)


def identification_section(comparison: Comparison) -> dict[str, Any]:
    """Figures 4.1 and 4.2 and the numbers of IV.C."""
    rows = []
    for case in IDENTIFICATIONS:
        rows += identification_rows(comparison, case)
    text = (
        "Normal for ten seconds, then one parameter changes; from 10 s on the speed command "
        "alternates between 0.5 and 1.0 ft/s every ten seconds. Errors are relative to the true "
        "value after the change. The thesis reports no noise, and errors as small as its own lie "
        "far below what a paddle wheel of 1 cm/s and an accelerometer of 2 mm/s² allow (last "
        "column): we take its figures as noise-free. While the vehicle coasts with its shafts "
        "stopped, beta is not observable, and the filter's own variance of it grows."
    )
    drag = "Thesis Fig. 4.1: response of the filter to a 35 % increase of alpha."
    thrust = "Thesis Fig. 4.2: response of the filter to a 35 % decrease of beta."
    figures = [
        response_figure(comparison, "drag", "fig-4-1", drag),
        response_figure(comparison, "thrust", "fig-4-2", thrust),
    ]
    section = table_section("IV.C: parameter identification", COLUMNS, rows, text)
    return section | {"figures": figures}


def identification_rows(comparison: Comparison, case: Identification) -> list[list[str]]:
    """Estimate in both systems of units, and the error at the end and after two speed changes."""
    which = (case.run, case.parameter)
    at_end = comparison.error(*which, END_IV_C)
    after_two = comparison.error(*which, 30.0)
    times = np.arange(30.0, END_IV_C + 0.05, 0.1)
    largest = max(abs(comparison.error(*which, time)[0]) for time in times)
    estimates = comparison.estimate(*which, END_IV_C)
    std = comparison.filter_std(*which, END_IV_C)
    is_met = abs(at_end[0]) < case.limit
    thesis = f"{case.thesis:{case.form}} {case.unit}"
    thesis_si = f"{case.thesis / case.per_si:{case.form}} {case.si_unit}"
    ours = estimate_texts(estimates, case.nominal, case.form)
    ours_si = estimate_texts(estimates, case.nominal / case.per_si, case.form)
    why = f"Noise-free at most {largest:.2f} % from there on. {comparison.filter_std(*which, 30.0)}"
    later = "error after two speed changes (30 s)"

    def row(quantity, thesis, texts, agrees, why):
        where = f"IV.C, Fig. {case.figure}"
        return comparison.row(where, quantity, thesis, *texts, agrees, why)

    return [
        row(f"{case.change}: estimate at 50 s", thesis, ours, is_met, std),
        row("the same in SI units", thesis_si, ours_si, is_met, ""),
        row(
            f"{case.change}: error at 50 s",
            f"{case.limit} %",
            error_texts(*at_end),
            is_met,
            std,
        ),
        row(
            f"{case.change}: {later}",
            "within 2 %",
            error_texts(*after_two),
            largest < 2.0,
            why,
        ),
    ]


def response_section(comparison: Comparison) -> dict[str, Any]:
    """Figures 5.14, 5.15 and 5.19."""
    rows = [normal_row(comparison), *drag_rows(comparison), loss_row(comparison)]
    captions = {
        "fig-5-14": "Thesis Fig. 5.14: response to a normal run, normalised as in V.B.",
        "fig-5-15": "Thesis Fig. 5.15: increased drag (+35 % at 10 s), normalised as in V.B.",
        "fig-5-19": "Thesis Fig. 5.19: port propeller lost at 10 s, normalised as in V.B.",
    }
    text = (
        "The same stimulus, sixty seconds. The text at Fig. 5.17 swaps the normalised values: "
        "normal is alpha 0.5 and beta 0.9 (V.B), as used here."
    )
    figures = [
        response_figure(comparison, run, name, captions[name])
        for run, name in zip(("normal", "drag", "loss"), captions, strict=True)
    ]
    section = table_section("V.D: responses of the parameter filter", COLUMNS, rows, text)
    return section | {"figures": figures}


def normal_row(comparison: Comparison) -> list[str]:
    """Figure 5.14: the estimates of a healthy run stay nominal."""
    times = np.arange(0, 60, 0.1)
    errors = []
    for parameter in (ALPHA, BETA):
        errors += [abs(comparison.error("normal", parameter, time)[0]) for time in times]
    largest = max(errors)
    alpha = comparison.error("normal", ALPHA, 60.0)[1].std(ddof=1)
    beta = comparison.error("normal", BETA, 60.0)[1].std(ddof=1)
    texts = (
        f"{largest:.2f} %",
        f"at 60 s alpha ± {alpha:.1f} %, beta ± {beta:.1f} %",
    )
    quantity = "normal run: largest deviation"
    why = "The thesis' normal window is 20 % for alpha, 25 % for beta."
    return comparison.row("V.D, Fig. 5.14", quantity, "stays normal", *texts, largest < 2, why)


def drag_rows(comparison: Comparison) -> list[list[str]]:
    """Figure 5.15: beta seems to change while only alpha has changed, and returns."""

    def row(quantity, thesis, error, agrees, why):
        quantity = f"alpha +35 %: {quantity}"
        return comparison.row("V.D, Fig. 5.15", quantity, thesis, *error_texts(*error), agrees, why)

    errors = [comparison.error("drag", BETA, time) for time in np.arange(10, 60, 0.1)]
    largest = max(errors, key=lambda error: abs(error[0]))
    is_large = abs(largest[0]) > 1
    why = "Until the speed has changed, nothing distinguishes more drag from less thrust."
    last = comparison.error("drag", BETA, 60.0)
    std = comparison.filter_std("drag", BETA, 60.0)
    return [
        row("largest excursion of beta", "appears to change", largest, is_large, why),
        row("beta at 60 s", "returns to normal", last, abs(last[0]) < 2, std),
    ]


def loss_row(comparison: Comparison) -> list[str]:
    """Figure 5.19: half of the thrust is gone."""
    clean, noisy = comparison.estimate("loss", BETA, 60.0)
    change = 100 * (clean - 1)
    texts = error_texts(change, 100 * (noisy - 1))
    quantity = "one propeller lost: change of beta at 60 s"
    why = (
        "The port shaft, unloaded, responds faster; the filter takes the mean of both shafts. "
        f"{comparison.filter_std('loss', BETA, 60.0)}"
    )
    return comparison.row("V.D, Fig. 5.19", quantity, "-50 %", *texts, abs(change + 50) < 1, why)


def response_figure(comparison: Comparison, run: str, name: str, caption: str) -> dict[str, Any]:
    """Alpha and beta over time: in customary units for chapter IV, normalised for chapter V."""
    if name.startswith("fig-5"):
        units = {"alpha": "normalised", "beta": "normalised"}
        scales = {"alpha": 0.5, "beta": 0.9}
    else:
        units = {"alpha": "1/ft", "beta": "(ft/s²)/rpm²"}
        scales = {"alpha": ALPHA_FT, "beta": BETA_FT}
    row = comparison.runs.index(run)
    clean = comparison.clean.mean[:, row, 0]
    noisy = comparison.noisy.mean[:, row]
    time = np.arange(len(clean)) / SAMPLE_RATE
    lines: dict[str, dict] = {
        "truth": {},
        "clean": {},
        "noisy_mean": {},
        "noisy_std": {},
    }
    for column, (parameter, scale) in enumerate(scales.items()):
        true = np.where(time < 10, 1.0, TRUE_PARAMETERS[run][column]) * scale
        lines["truth"][parameter] = true.tolist()
        lines["clean"][parameter] = (clean[:, column] * scale).tolist()
        lines["noisy_mean"][parameter] = (noisy.mean(axis=1)[:, column] * scale).tolist()
        lines["noisy_std"][parameter] = (noisy.std(axis=1)[:, column] * abs(scale)).tolist()
    caption += " Dotted: changes of the speed command."
    data = {
        "time": time.tolist(),
        **lines,
        "units": units,
        "speed_changes": SPEED_CHANGES,
    }
    return figure("filter_response", name, caption, data)


PANELS = {
    "surge speed [ft/s]": {"speed": "speed", "commanded": "speed_command"},
    "shaft speed [rpm]": {"port": "port_rpm", "starboard": "starboard_rpm"},
    "motor voltage [V]": {"port": "port_voltage", "starboard": "starboard_voltage"},
    "motor current [A]": {"port": "port_current", "starboard": "starboard_current"},
}


def transient_section(comparison: Comparison) -> dict[str, Any]:
    """Figures 5.13 and 5.18."""
    text = (
        "The text gives no numbers for these figures. The steady shaft speeds follow from its "
        "alpha and beta: u/n = sqrt(beta/-alpha) = 3.696e-3 ft/s per rpm."
    )
    normal = "Thesis Fig. 5.13: normal transient between 0.5 and 1.0 ft/s."
    loss = "Thesis Fig. 5.18: port propeller lost at 10 s."
    figures = [
        transient_figure(comparison, "normal", "fig-5-13", normal, onset=None),
        transient_figure(comparison, "loss", "fig-5-18", loss, onset=10.0),
    ]
    heading = "V.D: transients of the propulsion model"
    return table_section(heading, COLUMNS, shaft_rows(comparison), text) | {"figures": figures}


def transient_figure(
    comparison: Comparison, run: str, name: str, caption: str, onset: float | None
) -> dict[str, Any]:
    """Readings of one run, speeds in ft/s."""
    panels = {}
    for label, channels in PANELS.items():
        panels[label] = {
            side: comparison.line(run, channel, label) for side, channel in channels.items()
        }
    time = (np.arange(len(comparison.clean.mean)) / SAMPLE_RATE).tolist()
    data = {"time": time, "panels": panels, "onset": onset}
    return figure("transients", name, caption + LINES, data)


def shaft_rows(comparison: Comparison) -> list[list[str]]:
    """Shaft speeds at 0.5 ft/s, with which the run begins, and at 1.0 ft/s."""
    at_start = comparison.reading("normal", "port_rpm")[0]
    at_1 = 1.0 / np.sqrt(BETA_FT / -ALPHA_FT)
    cases = (
        ("0.5", "135", at_start, "Read in steady motion at the start of the run."),
        ("1", "271", at_1, "Ten seconds are too short for a steady state; computed."),
    )
    rows = []
    for speed, implied, ours, why in cases:
        quantity = f"shaft speed at {speed} ft/s [rpm]"
        verdict = (f"{ours:.1f}", "-", abs(ours - float(implied)) < 1, why)
        rows.append(comparison.row("IV.C, implied", quantity, implied, *verdict))
    return rows


def start_section(comparison: Comparison) -> dict[str, Any]:
    """Figures 5.3 to 5.6."""
    runs = {
        "normal (5.3)": "start_normal",
        "seal friction (5.4)": "start_friction",
        "degraded propeller (5.5)": "start_propeller",
        "increased drag (5.6)": "start_drag",
    }
    channels = {
        "surge speed [ft/s]": "speed",
        "port shaft speed [rpm]": "port_rpm",
        "port voltage [V]": "port_voltage",
        "port current [A]": "port_current",
    }
    panels = {}
    for label, channel in channels.items():
        panels[label] = {
            mode: comparison.line(run, channel, label, START_SAMPLES) for mode, run in runs.items()
        }
    rows = []
    for mode in runs:
        ends = [last_value(panel[mode]) for panel in panels.values()]
        rows.append([mode, *ends])
    columns = ["mode", *(f"{label} at 40 s" for label in channels)]
    text = (
        "From rest to 1.5 ft/s, the fault present from the start, 400 points each; noise-free, and "
        "mean ± standard deviation of the noisy runs. The thesis gives neither numbers nor the "
        "size of the faults. Ours: seal friction at severity 0.5 (Coulomb friction doubled, "
        "viscous friction added), port propeller damaged at severity 1 (half of its thrust, 40 % "
        "less torque), drag +35 %."
    )
    caption = "Thesis Figs 5.3 to 5.6: acceleration from rest in the operating modes of Table 5.1."
    data = {
        "time": (np.arange(START_SAMPLES) / SAMPLE_RATE).tolist(),
        "panels": panels,
    }
    figures = [figure("transients", "fig-5-3-to-5-6", caption + LINES, data)]
    heading = "V.C: transients that trained the raw-data network"
    return table_section(heading, columns, rows, text) | {"figures": figures}


def last_value(line: dict[str, list[float]]) -> str:
    """The last value of a line: without noise, and mean and standard deviation with noise."""
    return f"{line['clean'][-1]:.3g}; {line['mean'][-1]:.3g} ± {line['std'][-1]:.2g}"
