"""What `auv-fault reproduce` reports: the rows thesis | ours | command, the figures' data, and why ours differs."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.parameters import FOOT, SAMPLE_RATE
from training.thesis.appendix_a import appendix_section, constants_section
from training.thesis.comparison import (
    ALPHA,
    ALPHA_FT,
    BETA,
    BETA_FT,
    TRUE,
    VEHICLE,
    Comparison,
    percent,
    scaled,
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


def page(view: Comparison) -> dict[str, Any]:
    """The report on the test runs as plain data."""
    return {
        "title": "The thesis reproduced, chapters III to VI: ours beside theirs",
        "command": view.command,
        "intro": [
            "Neural network based propulsion system fault diagnostics for the NPS AUV II, Naval Postgraduate "
            "School, June 1992. The plant, both controllers and the parameter filter run the thesis' test runs "
            "anew: noise-free, as the thesis must have run them, and again with this project's default sensor "
            f"noise, mean ± standard deviation over {view.noisy.mean.shape[2]} seeds. The vehicle is the nominal one "
            "in still water. In the noise-free runs the filter assumes a tenth of the default noise, else it knows "
            "the noise.",
            "Controller gains, the size of the faults of V.C, the propellers' inertia and the noise are not in "
            "the thesis; ours are documented defaults, so transients agree in kind, not point by point.",
        ],
        "sections": [
            identification(view),
            responses(view),
            transient_sections(view),
            start_section(view),
            appendix_section(COLUMNS, view.command),
            constants_section(VEHICLE),
        ],
    }


class Identified(NamedTuple):
    """One of the thesis' two identified parameters: its run, what the thesis found, and in which units."""

    run: str
    parameter: int
    figure: str
    change: str
    found: float
    limit: float  # %
    nominal: float  # in the thesis' unit
    per_si: float  # the thesis' unit in SI units, inverse
    units: tuple[str, str]  # the thesis', SI
    form: str


IDENTIFIED = (
    Identified(
        "drag", ALPHA, "4.1", "alpha +35 %", -0.0332, 0.3, ALPHA_FT, FOOT, ("1/ft", "1/m"), ".4f"
    ),
    Identified(
        "thrust",
        BETA,
        "4.2",
        "beta -35 %",
        2.1945e-7,
        0.2,
        BETA_FT,
        1 / FOOT,
        ("(ft/s²)/rpm²", "(m/s²)/rpm²"),
        ".4e",
    ),
)


def identification(view: Comparison) -> dict[str, Any]:
    """Figures 4.1 and 4.2 and the numbers of IV.C."""
    rows = [row for one in IDENTIFIED for row in identified(view, one)]
    return {
        "heading": "IV.C: parameter identification",
        "text": [
            "Normal for ten seconds, then one parameter changes; the speed command alternates between 0.5 and 1.0 "
            "ft/s every ten seconds from 10 s on. Errors are relative to the true value after the change. The "
            "thesis reports no noise, and errors as small as its lie far below what a paddle wheel of 1 cm/s and "
            "an accelerometer of 2 mm/s² allow (last but one column): its figures are read as noise-free. While "
            "the vehicle coasts, shafts stopped, beta is not observable, and what the filter expects of it grows."
        ],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            response_figure(
                view,
                "drag",
                "fig-4-1",
                "Fig. 4.1: response of the filter to a 35 % increase of alpha.",
            ),
            response_figure(
                view,
                "thrust",
                "fig-4-2",
                "Fig. 4.2: response of the filter to a 35 % decrease of beta.",
            ),
        ],
    }


def identified(view: Comparison, one: Identified) -> list[list[str]]:
    """Rows of one identified parameter: estimate in both systems of units, errors at the end and after two changes."""
    end, two = (view.error(one.run, one.parameter, time) for time in (END_IV_C, 30.0))
    later = np.arange(30.0, END_IV_C + 0.05, 0.1)
    worst = max(abs(view.error(one.run, one.parameter, time)[0]) for time in later)
    estimate = view.estimate(one.run, one.parameter, END_IV_C)
    floor = view.floor(one.run, one.parameter, END_IV_C)
    row = partial(view.row, f"IV.C, Fig. {one.figure}")
    met = abs(end[0]) < one.limit
    name = one.change
    si = scaled(estimate, one.nominal / one.per_si, one.form)
    why = f"Noise-free at most {worst:.2f} % from there on. {view.floor(one.run, one.parameter, 30.0)}"
    customary = f"{one.found:{one.form}} {one.units[0]}"
    in_si = f"{one.found / one.per_si:{one.form}} {one.units[1]}"
    return [
        row(
            f"{name}: estimate at 50 s",
            customary,
            *scaled(estimate, one.nominal, one.form),
            met,
            floor,
        ),
        row("the same in SI units", in_si, *si, met, ""),
        row(f"{name}: error at 50 s", f"{one.limit} %", *percent(*end), met, floor),
        row(
            f"{name}: error after two speed changes (30 s)",
            "within 2 %",
            *percent(*two),
            worst < 2.0,
            why,
        ),
    ]


def normal_row(view: Comparison) -> list[str]:
    """Figure 5.14: a healthy run stays where it is."""
    quiet = max(
        abs(view.error("normal", p, t)[0]) for p in (ALPHA, BETA) for t in np.arange(0, 60, 0.1)
    )
    alpha, beta = (view.error("normal", p, 60.0)[1].std(ddof=1) for p in (ALPHA, BETA))
    quantity = "normal run: largest deviation"
    why = "The thesis' normal window is 20 % for alpha, 25 % for beta."
    scatter = f"at 60 s alpha ± {alpha:.1f} %, beta ± {beta:.1f} %"
    return view.row(
        "V.D, Fig. 5.14", quantity, "stays normal", f"{quiet:.2f} %", scatter, quiet < 2, why
    )


def excursion_row(view: Comparison) -> list[str]:
    """Figure 5.15: beta seems to change while only alpha has."""
    worst = max(
        (view.error("drag", BETA, t) for t in np.arange(10, 60, 0.1)), key=lambda pair: abs(pair[0])
    )
    quantity = "alpha +35 %: beta's largest excursion"
    why = "Until the speed has changed, more drag and less thrust are told apart by nothing."
    return view.row(
        "V.D, Fig. 5.15", quantity, "appears to change", *percent(*worst), abs(worst[0]) > 1, why
    )


def return_row(view: Comparison) -> list[str]:
    """Figure 5.15: beta returns."""
    back = view.error("drag", BETA, 60.0)
    quantity = "alpha +35 %: beta at 60 s"
    why = view.floor("drag", BETA, 60.0)
    return view.row(
        "V.D, Fig. 5.15", quantity, "returns to normal", *percent(*back), abs(back[0]) < 2, why
    )


def loss_row(view: Comparison) -> list[str]:
    """Figure 5.19: half of the thrust is gone."""
    clean, noisy = view.estimate("loss", BETA, 60.0)
    drop = 100 * (clean - 1), 100 * (noisy - 1)
    why = "The port shaft, unloaded, answers faster; the filter takes the mean of both shafts. "
    why += view.floor("loss", BETA, 60.0)
    quantity = "one propeller lost: change of beta at 60 s"
    return view.row(
        "V.D, Fig. 5.19", quantity, "-50 %", *percent(*drop), abs(drop[0] + 50) < 1, why
    )


def responses(view: Comparison) -> dict[str, Any]:
    """Figures 5.14, 5.15 and 5.19."""
    rows = [normal_row(view), excursion_row(view), return_row(view), loss_row(view)]
    captions = {
        "normal": (
            "fig-5-14",
            "Fig. 5.14: response of the filter to a normal run, normalised as in V.B.",
        ),
        "drag": ("fig-5-15", "Fig. 5.15: increased drag (+35 % at 10 s), normalised as in V.B."),
        "loss": ("fig-5-19", "Fig. 5.19: port propeller lost at 10 s, normalised as in V.B."),
    }
    return {
        "heading": "V.D: responses of the parameter filter",
        "text": [
            "The same stimulus, sixty seconds. The text at Fig. 5.17 swaps the normalised values: normal is alpha "
            "0.5 and beta 0.9 (V.B), as used here."
        ],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [response_figure(view, run, *caption) for run, caption in captions.items()],
    }


def response_figure(view: Comparison, run: str, name: str, caption: str) -> dict[str, Any]:
    """Alpha and beta over time: in customary units for chapter IV, normalised for chapter V."""
    chapter_v = name.startswith("fig-5")
    units = (
        {"alpha": "normalised", "beta": "normalised"}
        if chapter_v
        else {"alpha": "1/ft", "beta": "(ft/s²)/rpm²"}
    )
    scale = (0.5, 0.9) if chapter_v else (ALPHA_FT, BETA_FT)
    row = view.runs.index(run)
    names = ("alpha", "beta")
    time = np.arange(len(view.clean.mean)) / SAMPLE_RATE
    true = [np.where(time < 10, 1.0, TRUE[run][p]) * scale[p] for p in (ALPHA, BETA)]
    mean, spread = (
        [getattr(view.noisy.mean[:, row], of)(axis=1)[:, p] * abs(scale[p]) for p in (0, 1)]
        for of in ("mean", "std")
    )
    signs = np.sign(scale)
    return {
        "plot": "filter_response",
        "name": name,
        "caption": caption + " Dotted: changes of the speed command.",
        "data": {
            "time": time.tolist(),
            "truth": dict(zip(names, map(np.ndarray.tolist, true), strict=True)),
            "clean": {
                n: (view.clean.mean[:, row, 0, p] * scale[p]).tolist() for p, n in enumerate(names)
            },
            "noisy_mean": {n: (mean[p] * signs[p]).tolist() for p, n in enumerate(names)},
            "noisy_std": {n: spread[p].tolist() for p, n in enumerate(names)},
            "units": units,
            "speed_changes": SPEED_CHANGES,
        },
    }


PANELS = {
    "surge speed [ft/s]": (("speed", "speed"), ("commanded", "speed_command")),
    "shaft speed [rpm]": (("port", "port_rpm"), ("starboard", "starboard_rpm")),
    "motor voltage [V]": (("port", "port_voltage"), ("starboard", "starboard_voltage")),
    "motor current [A]": (("port", "port_current"), ("starboard", "starboard_current")),
}


def panels(view: Comparison, run: str) -> dict[str, dict[str, dict[str, list[float]]]]:
    """Readings of one run by panel and line; speeds in ft/s."""
    return {
        label: {name: view.line(run, channel, label) for name, channel in lines}
        for label, lines in PANELS.items()
    }


def transient_sections(view: Comparison) -> dict[str, Any]:
    """Figures 5.13 and 5.18."""
    time = (np.arange(len(view.clean.mean)) / SAMPLE_RATE).tolist()
    rows = [steady_row(view, 0.0, 0.5, "135"), steady_row(view, None, 1.0, "271")]
    figure = lambda run, name, onset, caption: {  # noqa: E731
        "plot": "transients",
        "name": name,
        "caption": caption + LINES,
        "data": {"time": time, "panels": panels(view, run), "onset": onset},
    }
    return {
        "heading": "V.D: transients of the propulsion model",
        "text": [
            "The text gives no numbers for these figures. The steady shaft speeds follow from its alpha and beta: "
            "u/n = sqrt(beta/-alpha) = 3.696e-3 ft/s per rpm."
        ],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            figure(
                "normal", "fig-5-13", None, "Fig. 5.13: normal transient between 0.5 and 1.0 ft/s."
            ),
            figure("loss", "fig-5-18", 10.0, "Fig. 5.18: port propeller lost at 10 s."),
        ],
    }


def steady_row(view: Comparison, time: float | None, speed: float, implied: str) -> list[str]:
    """Shaft speed at a steady surge speed: read at `time`, or by proportion where the run has no steady state there."""
    if time is not None:
        k = round(time * SAMPLE_RATE)
        ours = view.reading("normal", "port_rpm")[k]
        why = "Read in steady motion at the start of the run."
    else:
        ours = speed / np.sqrt(BETA_FT / -ALPHA_FT)
        why = "Ten seconds are too short for a steady state; computed."
    quantity = f"shaft speed at {speed:g} ft/s [rpm]"
    return view.row(
        "IV.C, implied", quantity, implied, f"{ours:.1f}", "-", abs(ours - float(implied)) < 1, why
    )


def last(line: dict[str, list[float]]) -> str:
    """The last value of a line: noise-free, and mean and deviation under noise."""
    return f"{line['clean'][-1]:.3g}; {line['mean'][-1]:.3g} ± {line['std'][-1]:.2g}"


def start_section(view: Comparison) -> dict[str, Any]:
    """Figures 5.3 to 5.6."""
    modes = {
        "normal (5.3)": "start_normal",
        "seal friction (5.4)": "start_friction",
        "degraded propeller (5.5)": "start_propeller",
        "increased drag (5.6)": "start_drag",
    }
    lines = {"surge speed [ft/s]": "speed", "port shaft speed [rpm]": "port_rpm"}
    lines |= {"port voltage [V]": "port_voltage", "port current [A]": "port_current"}
    panels = {
        label: {mode: view.line(run, channel, label, 400) for mode, run in modes.items()}
        for label, channel in lines.items()
    }
    columns = ["mode", *(f"{label} at 40 s" for label in lines), "command"]
    rows = [
        [mode, *(last(panel[mode]) for panel in panels.values()), view.command] for mode in modes
    ]
    return {
        "heading": "V.C: transients that trained the raw-data network",
        "text": [
            "From rest to 1.5 ft/s, the fault present from the start, 400 points each; noise-free, and mean ± "
            "standard deviation of the noisy runs. The thesis gives neither numbers nor the size of the faults. "
            "Ours: seal friction at severity 0.5 (Coulomb friction doubled, viscous friction added), port "
            "propeller damaged at severity 1 (half of its thrust, 40 % less torque), drag +35 %."
        ],
        "table": {"columns": columns, "rows": rows},
        "figures": [
            {
                "plot": "transients",
                "name": "fig-5-3-to-5-6",
                "caption": "Figs 5.3 to 5.6: acceleration from rest in the operating modes of Table 5.1."
                + LINES,
                "data": {"time": (np.arange(400) / SAMPLE_RATE).tolist(), "panels": panels},
            }
        ],
    }
