"""Report on the thesis' test runs: rows thesis | ours | command, figures, and why ours differs."""

from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.parameters import FOOT, SAMPLE_RATE
from training.thesis.appendix_a import appendix_section, constants_section
from training.thesis.comparison import (
    ALPHA,
    ALPHA_FT,
    BETA,
    BETA_FT,
    TRUE_PARAMETERS,
    VEHICLE,
    Comparison,
    error_texts,
    estimate_texts,
)

COLUMNS = [
    "where",
    "quantity",
    "thesis",
    "ours, noise-free",
    "ours, default noise",
    "verdict (noise-free)",
    "why",
    "command",
]
END_IV_C = 50.0  # s: the speed command changes at 10, 20, 30 and 40 s
SPEED_CHANGES = [10.0, 20.0, 30.0, 40.0, 50.0]
LINES = " Lines: noise-free; bands: mean ± one standard deviation of the noisy runs."
START_SAMPLES = 400  # of the runs from rest, as in Figs 5.3 to 5.6


def report_on_test_runs(comparison: Comparison) -> dict[str, Any]:
    """The report on the test runs as plain data."""
    n_seeds = comparison.noisy.mean.shape[2]
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
        "sections": [
            identification_section(comparison),
            response_section(comparison),
            transient_section(comparison),
            start_section(comparison),
            appendix_section(COLUMNS, comparison.command),
            constants_section(VEHICLE),
        ],
    }


class Identification(NamedTuple):
    """One parameter that the thesis identifies.

    Attributes
    ----------
    run, parameter
        The test run, and the index of the parameter.
    figure, change
        Number of the thesis' figure, and the change of the parameter as text.
    thesis
        The thesis' estimate, in its unit.
    limit
        The thesis' error at the end [%].
    nominal
        Nominal value in the thesis' unit.
    per_si
        One SI unit in the thesis' unit.
    units
        The thesis' unit and the SI unit.
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
    per_si: float
    units: tuple[str, str]
    form: str


IDENTIFICATIONS = (
    Identification(
        run="drag",
        parameter=ALPHA,
        figure="4.1",
        change="alpha +35 %",
        thesis=-0.0332,
        limit=0.3,
        nominal=ALPHA_FT,
        per_si=FOOT,
        units=("1/ft", "1/m"),
        form=".4f",
    ),
    Identification(
        run="thrust",
        parameter=BETA,
        figure="4.2",
        change="beta -35 %",
        thesis=2.1945e-7,
        limit=0.2,
        nominal=BETA_FT,
        per_si=1 / FOOT,
        units=("(ft/s²)/rpm²", "(m/s²)/rpm²"),
        form=".4e",
    ),
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
        "far below what a paddle wheel of 1 cm/s and an accelerometer of 2 mm/s² allow (last but "
        "one column): we take its figures as noise-free. While the vehicle coasts with its shafts "
        "stopped, beta is not observable, and the filter's own variance of it grows."
    )
    captions = {
        "drag": "Fig. 4.1: response of the filter to a 35 % increase of alpha.",
        "thrust": "Fig. 4.2: response of the filter to a 35 % decrease of beta.",
    }
    return {
        "heading": "IV.C: parameter identification",
        "text": [text],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            response_figure(comparison, "drag", "fig-4-1", captions["drag"]),
            response_figure(comparison, "thrust", "fig-4-2", captions["thrust"]),
        ],
    }


def identification_rows(comparison: Comparison, case: Identification) -> list[list[str]]:
    """Estimate in both systems of units, and the error at the end and after two speed changes."""
    run = case.run
    parameter = case.parameter
    where = f"IV.C, Fig. {case.figure}"
    at_end = comparison.error(run, parameter, END_IV_C)
    after_two = comparison.error(run, parameter, 30.0)
    times = np.arange(30.0, END_IV_C + 0.05, 0.1)
    largest = max(abs(comparison.error(run, parameter, time)[0]) for time in times)
    estimates = comparison.estimate(run, parameter, END_IV_C)
    std_at_end = comparison.filter_std(run, parameter, END_IV_C)
    std_after_two = comparison.filter_std(run, parameter, 30.0)
    is_met = abs(at_end[0]) < case.limit
    unit, si_unit = case.units
    thesis = f"{case.thesis:{case.form}} {unit}"
    thesis_si = f"{case.thesis / case.per_si:{case.form}} {si_unit}"
    ours = estimate_texts(estimates, case.nominal, case.form)
    ours_si = estimate_texts(estimates, case.nominal / case.per_si, case.form)

    def row(quantity, thesis, texts, agrees, why):
        return comparison.row(where, quantity, thesis, *texts, agrees, why)

    return [
        row(f"{case.change}: estimate at 50 s", thesis, ours, is_met, std_at_end),
        row("the same in SI units", thesis_si, ours_si, is_met, ""),
        row(
            f"{case.change}: error at 50 s",
            f"{case.limit} %",
            error_texts(*at_end),
            is_met,
            std_at_end,
        ),
        row(
            f"{case.change}: error after two speed changes (30 s)",
            "within 2 %",
            error_texts(*after_two),
            largest < 2.0,
            f"Noise-free at most {largest:.2f} % from there on. {std_after_two}",
        ),
    ]


def response_section(comparison: Comparison) -> dict[str, Any]:
    """Figures 5.14, 5.15 and 5.19."""
    rows = [
        normal_row(comparison),
        excursion_row(comparison),
        return_row(comparison),
        loss_row(comparison),
    ]
    captions = {
        "fig-5-14": "Fig. 5.14: response of the filter to a normal run, normalised as in V.B.",
        "fig-5-15": "Fig. 5.15: increased drag (+35 % at 10 s), normalised as in V.B.",
        "fig-5-19": "Fig. 5.19: port propeller lost at 10 s, normalised as in V.B.",
    }
    text = (
        "The same stimulus, sixty seconds. The text at Fig. 5.17 swaps the normalised values: "
        "normal is alpha 0.5 and beta 0.9 (V.B), as used here."
    )
    return {
        "heading": "V.D: responses of the parameter filter",
        "text": [text],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            response_figure(comparison, run, name, captions[name])
            for run, name in zip(("normal", "drag", "loss"), captions, strict=True)
        ],
    }


def normal_row(comparison: Comparison) -> list[str]:
    """Figure 5.14: the estimates of a healthy run stay nominal."""
    times = np.arange(0, 60, 0.1)
    errors = []
    for parameter in (ALPHA, BETA):
        errors += [abs(comparison.error("normal", parameter, time)[0]) for time in times]
    largest = max(errors)
    alpha = comparison.error("normal", ALPHA, 60.0)[1].std(ddof=1)
    beta = comparison.error("normal", BETA, 60.0)[1].std(ddof=1)
    return comparison.row(
        "V.D, Fig. 5.14",
        "normal run: largest deviation",
        "stays normal",
        f"{largest:.2f} %",
        f"at 60 s alpha ± {alpha:.1f} %, beta ± {beta:.1f} %",
        largest < 2,
        "The thesis' normal window is 20 % for alpha, 25 % for beta.",
    )


def excursion_row(comparison: Comparison) -> list[str]:
    """Figure 5.15: beta seems to change while only alpha has changed."""
    errors = [comparison.error("drag", BETA, time) for time in np.arange(10, 60, 0.1)]
    largest = max(errors, key=lambda error: abs(error[0]))
    return comparison.row(
        "V.D, Fig. 5.15",
        "alpha +35 %: largest excursion of beta",
        "appears to change",
        *error_texts(*largest),
        abs(largest[0]) > 1,
        "Until the speed has changed, nothing distinguishes more drag from less thrust.",
    )


def return_row(comparison: Comparison) -> list[str]:
    """Figure 5.15: beta returns."""
    error = comparison.error("drag", BETA, 60.0)
    return comparison.row(
        "V.D, Fig. 5.15",
        "alpha +35 %: beta at 60 s",
        "returns to normal",
        *error_texts(*error),
        abs(error[0]) < 2,
        comparison.filter_std("drag", BETA, 60.0),
    )


def loss_row(comparison: Comparison) -> list[str]:
    """Figure 5.19: half of the thrust is gone."""
    clean, noisy = comparison.estimate("loss", BETA, 60.0)
    change = 100 * (clean - 1)
    noisy_change = 100 * (noisy - 1)
    why = "The port shaft, unloaded, responds faster; the filter takes the mean of both shafts. "
    return comparison.row(
        "V.D, Fig. 5.19",
        "one propeller lost: change of beta at 60 s",
        "-50 %",
        *error_texts(change, noisy_change),
        abs(change + 50) < 1,
        why + comparison.filter_std("loss", BETA, 60.0),
    )


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
    lines: dict[str, dict] = {"truth": {}, "clean": {}, "noisy_mean": {}, "noisy_std": {}}
    for column, (parameter, scale) in enumerate(scales.items()):
        true = np.where(time < 10, 1.0, TRUE_PARAMETERS[run][column]) * scale
        lines["truth"][parameter] = true.tolist()
        lines["clean"][parameter] = (clean[:, column] * scale).tolist()
        lines["noisy_mean"][parameter] = (noisy.mean(axis=1)[:, column] * scale).tolist()
        lines["noisy_std"][parameter] = (noisy.std(axis=1)[:, column] * abs(scale)).tolist()
    return {
        "plot": "filter_response",
        "name": name,
        "caption": caption + " Dotted: changes of the speed command.",
        "data": {"time": time.tolist(), **lines, "units": units, "speed_changes": SPEED_CHANGES},
    }


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
    normal = "Fig. 5.13: normal transient between 0.5 and 1.0 ft/s."
    loss = "Fig. 5.18: port propeller lost at 10 s."
    rows = [slow_shaft_row(comparison), fast_shaft_row(comparison)]
    return {
        "heading": "V.D: transients of the propulsion model",
        "text": [text],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            transient_figure(comparison, "normal", "fig-5-13", normal, onset=None),
            transient_figure(comparison, "loss", "fig-5-18", loss, onset=10.0),
        ],
    }


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
    return {"plot": "transients", "name": name, "caption": caption + LINES, "data": data}


def slow_shaft_row(comparison: Comparison) -> list[str]:
    """Shaft speed at 0.5 ft/s, with which the run begins in steady motion."""
    ours = comparison.reading("normal", "port_rpm")[0]
    why = "Read in steady motion at the start of the run."
    return _shaft_row(comparison, "0.5", "135", ours, why)


def fast_shaft_row(comparison: Comparison) -> list[str]:
    """Shaft speed at 1.0 ft/s, which the run does not reach in steady motion."""
    ours = 1.0 / np.sqrt(BETA_FT / -ALPHA_FT)
    why = "Ten seconds are too short for a steady state; computed."
    return _shaft_row(comparison, "1", "271", ours, why)


def _shaft_row(
    comparison: Comparison, speed: str, implied: str, ours: float, why: str
) -> list[str]:
    quantity = f"shaft speed at {speed} ft/s [rpm]"
    agrees = abs(ours - float(implied)) < 1
    return comparison.row("IV.C, implied", quantity, implied, f"{ours:.1f}", "-", agrees, why)


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
        rows.append([mode, *ends, comparison.command])
    columns = ["mode", *(f"{label} at 40 s" for label in channels), "command"]
    text = (
        "From rest to 1.5 ft/s, the fault present from the start, 400 points each; noise-free, and "
        "mean ± standard deviation of the noisy runs. The thesis gives neither numbers nor the "
        "size of the faults. Ours: seal friction at severity 0.5 (Coulomb friction doubled, "
        "viscous friction added), port propeller damaged at severity 1 (half of its thrust, 40 % "
        "less torque), drag +35 %."
    )
    caption = "Figs 5.3 to 5.6: acceleration from rest in the operating modes of Table 5.1."
    time = (np.arange(START_SAMPLES) / SAMPLE_RATE).tolist()
    figure = {
        "plot": "transients",
        "name": "fig-5-3-to-5-6",
        "caption": caption + LINES,
        "data": {"time": time, "panels": panels},
    }
    return {
        "heading": "V.C: transients that trained the raw-data network",
        "text": [text],
        "table": {"columns": columns, "rows": rows},
        "figures": [figure],
    }


def last_value(line: dict[str, list[float]]) -> str:
    """The last value of a line: without noise, and mean and standard deviation with noise."""
    return f"{line['clean'][-1]:.3g}; {line['mean'][-1]:.3g} ± {line['std'][-1]:.2g}"
