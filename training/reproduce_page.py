"""What `auv-fault reproduce` reports: the rows thesis | ours | command, the figures' data, and why ours differs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import FOOT, PRESETS, SAMPLE_RATE
from training.appendix_a import appendix_section, constants_section
from training.thesis_runs import Recording

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
ALPHA, BETA = 0, 1
VEHICLE = PRESETS["thesis1992"]
ALPHA_FT, BETA_FT = VEHICLE.alpha * FOOT, VEHICLE.beta / FOOT  # 1/ft, (ft/s^2)/rpm^2
END_IV_C = 50.0  # s: the speed command changes at 10, 20, 30 and 40 s
SPEED_CHANGES = [10.0, 20.0, 30.0, 40.0, 50.0]
TRUE = {"normal": (1.0, 1.0), "drag": (1.35, 1.0), "thrust": (1.0, 0.65), "loss": (1.0, 0.5)}


class Page:
    """Reads the recordings by run, parameter and time."""

    def __init__(self, clean: Recording, noisy: Recording, runs: Sequence[str], command: str):
        self.clean, self.noisy, self.runs, self.command = clean, noisy, list(runs), command

    def estimate(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Noise-free estimate and those of every seed (n_seeds,), relative to nominal."""
        k, row = round(time * SAMPLE_RATE), self.runs.index(run)
        return float(self.clean.mean[k, row, 0, parameter]), self.noisy.mean[k, row, :, parameter]

    def error(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Relative errors of the estimates [%]."""
        true = TRUE[run][parameter]
        clean, noisy = self.estimate(run, parameter, time)
        return 100 * (clean / true - 1), 100 * (noisy / true - 1)

    def floor(self, run: str, parameter: int, time: float) -> str:
        """What the filter itself expects under noise: its standard deviation relative to the true value."""
        std = self.noisy.std[round(time * SAMPLE_RATE), self.runs.index(run), :, parameter].mean()
        return f"With noise the filter itself expects ± {100 * std / TRUE[run][parameter]:.1f} %."

    def row(self, where: str, quantity: str, thesis: str, clean: str, noisy: str, met: bool, why: str) -> list[str]:
        """One row of the comparison."""
        return [where, quantity, thesis, clean, noisy, "agrees" if met else "differs", why, self.command]

    def reading(self, run: str, channel: str) -> np.ndarray:
        """Noise-free reading over time (n_samples,)."""
        return self.clean.readings[:, self.runs.index(run), 0, list(CHANNELS).index(channel)]


def page(clean: Recording, noisy: Recording, runs: Sequence[str], command: str) -> dict[str, Any]:
    """The whole report as plain data."""
    view = Page(clean, noisy, runs, command)
    return {
        "title": "Test runs of the thesis, chapters III to V: ours beside theirs",
        "command": command,
        "intro": [
            "Neural network based propulsion system fault diagnostics for the NPS AUV II, Naval Postgraduate School, "
            "June 1992. The plant, both controllers and the parameter filter run the thesis' test runs anew: "
            "noise-free, as the thesis must have run them, and again with this project's default sensor noise, mean "
            f"± standard deviation over {noisy.mean.shape[2]} seeds. The vehicle is the nominal one in still water. "
            "In the noise-free runs the filter assumes a tenth of the default noise, else it knows the noise.",
            "Controller gains, the size of the faults of V.C, the propellers' inertia and the noise are not in the "
            "thesis; ours are documented defaults, so transients agree in kind, not point by point.",
        ],
        "sections": [
            identification(view),
            responses(view),
            transient_sections(view),
            start_section(view),
            appendix_section(COLUMNS, command),
            constants_section(VEHICLE),
        ],
    }


def percent(clean: float, noisy: np.ndarray) -> tuple[str, str]:
    """Both errors as text."""
    return f"{clean:+.2f} %", f"{noisy.mean():+.1f} ± {noisy.std(ddof=1):.1f} %"


def scaled(estimates: tuple[float, np.ndarray], unit: float, form: str) -> tuple[str, str]:
    """Both estimates in the thesis' unit as text."""
    clean, noisy = estimates[0] * unit, estimates[1] * unit
    return format(clean, form), f"{noisy.mean():{form}} ± {noisy.std(ddof=1):{form}}"


def identification(view: Page) -> dict[str, Any]:
    """Figures 4.1 and 4.2 and the numbers of IV.C."""
    rows = [
        *identified(view, "drag", ALPHA, "4.1", "alpha +35 %", "-0.0332 1/ft", 0.3, (ALPHA_FT, ".4f")),
        *identified(view, "thrust", BETA, "4.2", "beta -35 %", "2.1945e-7 (ft/s²)/rpm²", 0.2, (BETA_FT, ".4e")),
    ]
    return {
        "heading": "IV.C: parameter identification",
        "text": [
            "Normal for ten seconds, then one parameter changes; the speed command alternates between 0.5 and 1.0 "
            "ft/s every ten seconds from 10 s on. Errors are relative to the true value after the change. The thesis "
            "reports no noise, and errors as small as its lie far below what a paddle wheel of 1 cm/s and an "
            "accelerometer of 2 mm/s² allow (last but one column): its figures are read as noise-free. While the "
            "vehicle coasts, shafts stopped, beta is not observable, and what the filter expects of it grows."
        ],
        "table": {"columns": COLUMNS, "rows": rows},
        "figures": [
            response_figure(view, "drag", "fig-4-1", "Fig. 4.1: response of the filter to a 35 % increase of alpha."),
            response_figure(view, "thrust", "fig-4-2", "Fig. 4.2: response of the filter to a 35 % decrease of beta."),
        ],
    }


def identified(view, run, parameter, figure, quantity, thesis, limit, unit) -> list[list[str]]:
    """The three rows of one identified parameter: estimate, error at the end, error after two speed changes."""
    end, two = view.error(run, parameter, END_IV_C), view.error(run, parameter, 30.0)
    where = f"IV.C, Fig. {figure}"
    worst = max(abs(view.error(run, parameter, t)[0]) for t in np.arange(30.0, END_IV_C + 0.05, 0.1))
    estimate = scaled(view.estimate(run, parameter, END_IV_C), *unit)
    floor = view.floor(run, parameter, END_IV_C)
    return [
        view.row(where, f"{quantity}: estimate at 50 s", thesis, *estimate, abs(end[0]) < limit, floor),
        view.row(where, f"{quantity}: error at 50 s", f"{limit} %", *percent(*end), abs(end[0]) < limit, floor),
        view.row(
            where,
            f"{quantity}: error after two speed changes (30 s)",
            "within 2 %",
            *percent(*two),
            worst < 2.0,
            f"Noise-free at most {worst:.2f} % from there on. {view.floor(run, parameter, 30.0)}",
        ),
    ]


def normal_row(view: Page) -> list[str]:
    """Figure 5.14: a healthy run stays where it is."""
    quiet = max(abs(view.error("normal", p, t)[0]) for p in (ALPHA, BETA) for t in np.arange(0, 60, 0.1))
    alpha, beta = (view.error("normal", p, 60.0)[1].std(ddof=1) for p in (ALPHA, BETA))
    quantity, why = "normal run: largest deviation", "The thesis' normal window is 20 % for alpha, 25 % for beta."
    scatter = f"at 60 s alpha ± {alpha:.1f} %, beta ± {beta:.1f} %"
    return view.row("V.D, Fig. 5.14", quantity, "stays normal", f"{quiet:.2f} %", scatter, quiet < 2, why)


def excursion_row(view: Page) -> list[str]:
    """Figure 5.15: beta seems to change while only alpha has."""
    worst = max((view.error("drag", BETA, t) for t in np.arange(10, 60, 0.1)), key=lambda pair: abs(pair[0]))
    quantity = "alpha +35 %: beta's largest excursion"
    why = "Until the speed has changed, more drag and less thrust are told apart by nothing."
    return view.row("V.D, Fig. 5.15", quantity, "appears to change", *percent(*worst), abs(worst[0]) > 1, why)


def return_row(view: Page) -> list[str]:
    """Figure 5.15: beta returns."""
    back = view.error("drag", BETA, 60.0)
    quantity, why = "alpha +35 %: beta at 60 s", view.floor("drag", BETA, 60.0)
    return view.row("V.D, Fig. 5.15", quantity, "returns to normal", *percent(*back), abs(back[0]) < 2, why)


def loss_row(view: Page) -> list[str]:
    """Figure 5.19: half of the thrust is gone."""
    clean, noisy = view.estimate("loss", BETA, 60.0)
    drop = 100 * (clean - 1), 100 * (noisy - 1)
    why = "The port shaft, unloaded, answers faster; the filter takes the mean of both shafts. "
    why += view.floor("loss", BETA, 60.0)
    quantity = "one propeller lost: change of beta at 60 s"
    return view.row("V.D, Fig. 5.19", quantity, "-50 %", *percent(*drop), abs(drop[0] + 50) < 1, why)


def responses(view: Page) -> dict[str, Any]:
    """Figures 5.14, 5.15 and 5.19."""
    rows = [normal_row(view), excursion_row(view), return_row(view), loss_row(view)]
    captions = {
        "normal": ("fig-5-14", "Fig. 5.14: response of the filter to a normal run, normalised as in V.B."),
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


def response_figure(view: Page, run: str, name: str, caption: str) -> dict[str, Any]:
    """Alpha and beta over time: in customary units for chapter IV, normalised for chapter V."""
    chapter_v = name.startswith("fig-5")
    units = {"alpha": "normalised", "beta": "normalised"} if chapter_v else {"alpha": "1/ft", "beta": "(ft/s²)/rpm²"}
    scale = (0.5, 0.9) if chapter_v else (ALPHA_FT, BETA_FT)
    row, names = view.runs.index(run), ("alpha", "beta")
    time = np.arange(len(view.clean.mean)) / SAMPLE_RATE
    true = [np.where(time < 10, 1.0, TRUE[run][p]) * scale[p] for p in (ALPHA, BETA)]
    mean, spread = (
        [getattr(view.noisy.mean[:, row], of)(axis=1)[:, p] * abs(scale[p]) for p in (0, 1)] for of in ("mean", "std")
    )
    signs = np.sign(scale)
    return {
        "plot": "filter_response",
        "name": name,
        "caption": caption + " Dotted: changes of the speed command.",
        "data": {
            "time": time.tolist(),
            "truth": dict(zip(names, map(np.ndarray.tolist, true), strict=True)),
            "clean": {n: (view.clean.mean[:, row, 0, p] * scale[p]).tolist() for p, n in enumerate(names)},
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


def panels(view: Page, run: str) -> dict[str, dict[str, list[float]]]:
    """Readings of one run by panel and line; speeds in ft/s."""
    unit = {label: 1 / FOOT if "ft/s" in label else 1.0 for label in PANELS}
    return {
        label: {name: (view.reading(run, channel) * unit[label]).tolist() for name, channel in lines}
        for label, lines in PANELS.items()
    }


def transient_sections(view: Page) -> dict[str, Any]:
    """Figures 5.13 and 5.18."""
    time = (np.arange(len(view.clean.mean)) / SAMPLE_RATE).tolist()
    rows = [steady_row(view, 0.0, 0.5, "135"), steady_row(view, None, 1.0, "271")]
    figure = lambda run, name, onset, caption: {  # noqa: E731
        "plot": "transients",
        "name": name,
        "caption": caption,
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
            figure("normal", "fig-5-13", None, "Fig. 5.13: normal transient between 0.5 and 1.0 ft/s, noise-free."),
            figure("loss", "fig-5-18", 10.0, "Fig. 5.18: port propeller lost at 10 s, noise-free."),
        ],
    }


def steady_row(view: Page, time: float | None, speed: float, implied: str) -> list[str]:
    """Shaft speed at a steady surge speed: read at `time`, or by proportion where the run has no steady state there."""
    if time is not None:
        k = round(time * SAMPLE_RATE)
        ours, why = view.reading("normal", "port_rpm")[k], "Read in steady motion at the start of the run."
    else:
        ours, why = speed / np.sqrt(BETA_FT / -ALPHA_FT), "Ten seconds are too short for a steady state; computed."
    quantity = f"shaft speed at {speed:g} ft/s [rpm]"
    return view.row("IV.C, implied", quantity, implied, f"{ours:.1f}", "-", abs(ours - float(implied)) < 1, why)


def start_section(view: Page) -> dict[str, Any]:
    """Figures 5.3 to 5.6."""
    modes = {
        "normal (5.3)": "start_normal",
        "seal friction (5.4)": "start_friction",
        "degraded propeller (5.5)": "start_propeller",
        "increased drag (5.6)": "start_drag",
    }
    lines = {"surge speed [ft/s]": "speed", "port shaft speed [rpm]": "port_rpm"}
    lines |= {"port voltage [V]": "port_voltage", "port current [A]": "port_current"}
    samples = slice(0, 400)
    data = {
        mode: {
            label: (view.reading(run, channel)[samples] / (FOOT if channel == "speed" else 1)).tolist()
            for label, channel in lines.items()
        }
        for mode, run in modes.items()
    }
    columns = ["mode", *(f"{label} at 40 s" for label in lines), "command"]
    rows = [[mode, *(f"{series[-1]:.3g}" for series in values.values()), view.command] for mode, values in data.items()]
    return {
        "heading": "V.C: transients that trained the raw-data network",
        "text": [
            "From rest to 1.5 ft/s, the fault present from the start, 400 points each. The thesis gives neither "
            "numbers nor the size of the faults. Ours: seal friction at severity 0.5 (Coulomb friction doubled, "
            "viscous friction added), port propeller damaged at severity 1 (half of its thrust, 40 % less torque), "
            "drag +35 %."
        ],
        "table": {"columns": columns, "rows": rows},
        "figures": [
            {
                "plot": "starts",
                "name": "fig-5-3-to-5-6",
                "caption": "Figs 5.3 to 5.6: acceleration from rest in the four operating modes of Table 5.1, "
                "noise-free.",
                "data": {"time": (np.arange(400) / SAMPLE_RATE).tolist(), "modes": data},
            }
        ],
    }
