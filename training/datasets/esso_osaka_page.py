"""The page of `auv-fault esso-osaka`: forms, parameters by run, healthy band, and filter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from diagnosers.networks.fault_map import ALPHA_WINDOW, BETA_WINDOW, NOMINAL
from training.datasets.esso_osaka_runs import SOURCE
from training.datasets.surge_fit import LEAST_RMS, UNITS
from training.datasets.surge_track import SPEED_NOISE
from training.report.cells import without_nan
from training.report.lines import line_without_band
from training.report.sections import Section, figure, figure_section, table_section

Findings = Mapping[str, Any]  # plain data of the study
TARGET = 0.011  # m/s rms over ten seconds
PARAMETERS = ("alpha", "beta")
LANES = ("thesis alone", "with turn and wind")
WINDOWS = {
    name: [edge / nominal for edge in window]
    for name, window, nominal in zip(PARAMETERS, (ALPHA_WINDOW, BETA_WINDOW), NOMINAL, strict=True)
}
FORMS_TEXT = (
    "du/dt is a sum of coefficients times terms: alpha u|u|, beta n|n| and gamma u|u| delta² as "
    "in the thesis and the plant; turn v r, the surge that a turning ship loses, absent in a "
    "vehicle on a straight course; astern n² where n < 0; advance u|n|; race n|n| delta²; drift "
    "v²; centre r²; wind w|w| of the relative wind along the ship.",
    "Error of the speed predicted ten seconds ahead, simulated from the measured start; rms over "
    "every start.",
    "The model leaves out the pond's current, waves, the propeller's other thrust when it turns "
    "astern, its loss of thrust with the advance, and the rudder's drag in the propeller's race; "
    "but for the first two, each has its row. Propeller, rudder, sway, yaw rate and wind of the "
    "ten seconds are the measured ones: only the surge speed is predicted. Speeds are over ground, "
    "as the tests' own tracking measured them, with its jumps.",
    "The end of a run, where propeller and rudder stay at zero, is left out: there people tow the "
    "model back with the propeller at rest. The last rows include it.",
)
DROPPED = "dropped"
NONE_DROPPED = "none: the data of every fit excite all its terms"
DROPPED_TEXT = (
    "A term is dropped from a fit whose data do not excite it: the other coefficients are fitted "
    "without it, and predictions leave it out. It is zero, or at most "
    f"{100 * LEAST_RMS:g} % of its rms in all runs, or a combination of the terms before it."
)
SCORED_TEXT = (
    "Error of the speed predicted ten seconds ahead, rms over every start, by the fit to the other "
    "runs, on runs that enter no fit and no interval of this page."
)
BAND_TEXT = (
    "The ship had no fault in any of these runs. A diagnoser with a narrower band than its vehicle "
    "takes health for a fault; one without the wind needs a wider band still. The band has to come "
    "from the vehicle's own healthy logs; where an interval is wide, the run was too short, or its "
    "speed too constant, to identify the parameter."
)


def page(command: str, findings: Findings) -> dict[str, Any]:
    """The report as plain data, from the results of the study."""
    n_whole, n_used = findings["samples"]
    model = findings["fits"]["model"]
    data = (
        f"{len(model['runs'])} runs of a free-running 3 m model, "
        f"{n_used * SAMPLE_TIME / 60:.0f} minutes at 10 Hz, random propeller and rudder; the "
        f"propeller goes astern in {findings['astern']} of {len(model['runs'])} runs. "
        f"{(n_whole - n_used) * SAMPLE_TIME:.0f} s at the runs' ends are left out. Data: {SOURCE}."
    )
    names = findings["model"]
    return {
        "title": "Esso Osaka: the surge equation on a real, healthy ship",
        "command": command,
        "summary": [data, verdict(findings["forms"], findings["headlines"])],
        "intro": [],
        "findings": findings,
        "sections": [
            forms_section(findings["forms"]),
            *scored_sections(findings["scored"]),
            dropped_section(findings["dropped"]),
            parameters_section(names, model),
            band_section(names, findings["fits"]),
            prediction_section(findings["example"]),
            filter_section(names, model, findings["tracks"]),
        ],
    }


def verdict(compared: Sequence[Findings], headlines: Sequence[str]) -> str:
    """Whether the forms of the headlines meet the target."""
    sentences = [f"Ten-second prediction error, target at most {1e3 * TARGET:g} mm/s rms."]
    for form in compared:
        if form["form"] in headlines:
            fitted = f"{1e3 * form['fitted']:.1f} mm/s over every start"
            left_out = f"{1e3 * form['left_out']:.1f} mm/s"
            sentences.append(
                f"Form “{form['form']}”: {fitted} ({target(form['fitted'])}); with each run "
                f"predicted by the others' fit {left_out}."
            )
    return " ".join(sentences)


def target(value: float) -> str:
    """Whether an error [m/s] meets the target, or by how much it misses."""
    return "met" if value <= TARGET else f"missed by {1e3 * (value - TARGET):.1f} mm/s"


def forms_section(compared: Sequence[Findings]) -> Section:
    """Prediction errors by form."""
    rows = [
        [form["form"], f"{1e3 * form['fitted']:.2f}", f"{1e3 * form['left_out']:.2f}"]
        for form in compared
    ]
    columns = [
        "form",
        "fitted to all runs [mm/s]",
        "each run left out of its fit [mm/s]",
    ]
    return table_section("Which form predicts", columns, rows, *FORMS_TEXT)


def scored_sections(scored: Sequence[Findings]) -> list[Section]:
    """Prediction errors of every form on the scored runs, if there are any."""
    if not scored:
        return []
    columns = ["form", *(f"{run['run']} [mm/s]" for run in scored)]
    rows = [
        [form, *(f"{1e3 * run['errors'][form]:.2f}" for run in scored)]
        for form in scored[0]["errors"]
    ]
    missing = [", ".join(run["missing"]) or "none" for run in scored]
    rows.append(["terms of the run that no fit has", *missing])
    return [table_section("Runs scored, in no fit", columns, rows, SCORED_TEXT)]


def dropped_section(dropped_terms: Sequence[Findings]) -> Section:
    """The terms that were dropped, with the reason and the fits concerned."""
    fits: dict[tuple[str, ...], list[str]] = {}
    for entry in dropped_terms:
        key = (entry["term"], entry["reason"], entry["form"])
        fits.setdefault(key, []).append(entry["fitted_to"])
    rows = [[*key, _first(fitted_to)] for key, fitted_to in fits.items()]
    if not rows:
        rows = [[NONE_DROPPED, "", "", ""]]
    columns = ["term", "reason", "dropped from the form", "as fitted to"]
    return table_section("Terms dropped", columns, rows, DROPPED_TEXT)


def _first(names: Sequence[str]) -> str:
    """The first three names, and how many more there are."""
    n_more = len(names) - 3
    return "; ".join(names[:3]) + (f"; and {n_more} more" if n_more > 0 else "")


def parameters_section(model: Sequence[str], fits: Findings) -> Section:
    """The model's parameters by run, with intervals, and its errors."""
    rows = []
    for run in fits["runs"]:
        errors = [f"{1e3 * run['errors'][key]:.1f}" for key in ("own", "pooled", "left_out")]
        rows.append([run["run"], *errors, *coefficient_cells(run)])
    rows.append(["all", "", "", "", *coefficient_cells(fits["pooled"])])
    coefficients = [f"{name} [{UNITS[name]}]" for name in model]
    columns = ["run", "own [mm/s]", "all [mm/s]", "others [mm/s]", *coefficients]
    text = (
        "The ten-second error with the run's own parameters, those of all runs, and those of the "
        "others; then least squares on ten-second increments, with 95 % intervals by resampling "
        "minutes within a run, and runs for all."
    )
    return table_section("Parameters by run", columns, rows, text)


def coefficient_cells(fit: Findings) -> list[str]:
    """Each coefficient with its interval, three digits, or that its term was dropped."""
    pairs = zip(fit["coefficients"], fit["intervals"], strict=True)
    return [
        DROPPED if value is None else f"{value:.3g} ({low:.3g} to {high:.3g})"
        for value, (low, high) in pairs
    ]


def relative(name: str, model: Sequence[str], fits: Findings) -> tuple[np.ndarray, np.ndarray]:
    """A parameter of each run over that of all runs, (n_runs,), and its interval (n_runs, 2).

    NaN where the run does not excite it.
    """
    k = list(model).index(name)
    nominal = fits["pooled"]["coefficients"][k]
    values = np.array([run["coefficients"][k] for run in fits["runs"]], float)
    intervals = np.array([run["intervals"][k] for run in fits["runs"]], float)
    return values / nominal, np.sort(intervals / nominal, axis=1)


def band_section(model: Sequence[str], fits: Mapping[str, Findings]) -> Section:
    """The natural healthy band beside that of this project and the thesis' window."""
    panels = {}
    rows = []
    for name in PARAMETERS:
        default = Vehicle.__dataclass_fields__[name].metadata["band"]
        series = {}
        for form, fit in fits.items():
            values, intervals = relative(name, model, fit)
            series[form] = {
                "values": without_nan(values),
                "intervals": [without_nan(interval) for interval in intervals],
            }
            rows.append([name, form, *range_cells(values, intervals, default)])
        band = [1 - default, 1 + default]
        panels[name] = {"series": series, "band": band, "window": WINDOWS[name]}
    caption = (
        "Parameters of each run relative to all runs, with 95 % intervals; the widest leave the "
        "panel. Shaded: this project's default healthy band; dashed: the thesis' window of normal "
        "operation."
    )
    data = {"runs": [run["run"] for run in fits["model"]["runs"]], "panels": panels}
    columns = ["parameter", "form", "relative to all runs", "default band"]
    columns.append("intervals wholly outside it")
    section = table_section("The natural healthy band", columns, rows, BAND_TEXT)
    return section | {"figures": [figure("healthy_band", "healthy-band", caption, data)]}


def range_cells(values: np.ndarray, intervals: np.ndarray, default: float) -> list[str]:
    """Range of a parameter (n_runs,), and how many intervals (n_runs, 2) leave the default band.

    Of the runs that excite it.
    """
    known = values[~np.isnan(values)]
    is_above = intervals[:, 0] > 1 + default
    is_below = intervals[:, 1] < 1 - default
    n_outside = int(np.sum(is_above | is_below))
    span = f"{known.min():.2f} to {known.max():.2f}" if len(known) else DROPPED
    return [span, f"±{100 * default:g} %", f"{n_outside} of {len(known)}"]


def prediction_section(example: Findings) -> Section:
    """One run with its predictions."""
    panels = {
        "surge speed [m/s]": {"speed": "speed", "predicted 10 s before": "predicted"},
        "prediction error [m/s]": {"error": "error"},
        "propeller [rpm]": {"propeller": "rpm"},
        "rudder [rad]": {"rudder": "rudder"},
    }
    lines = {}
    for label, keys in panels.items():
        lines[label] = {
            name: line_without_band(np.array(example[key])) for name, key in keys.items()
        }
    run = example["run"]
    caption = f"Run {run} from its tenth second, predicted with the parameters of all runs."
    data = {"time": example["time"], "panels": lines}
    return figure_section("One run, predicted", "transients", "prediction", caption, data)


def filter_section(model: Sequence[str], fits: Findings, tracks: Findings) -> Section:
    """The filter's estimates along the runs, and their ends beside each run's own fit."""
    own = [relative(name, model, fits)[0] for name in PARAMETERS]
    rows = []
    for k, (name, track) in enumerate(tracks["runs"].items()):
        own_cells = [DROPPED if np.isnan(values[k]) else f"{values[k]:.2f}" for values in own]
        rows.append([name, *own_cells, *estimate_cells(track)])
    estimates = [f"{name}, {source}" for source in ("own fit", *LANES) for name in PARAMETERS]
    columns = ["run", *estimates, *(f"NIS, {lane}" for lane in LANES)]
    std, memory = tracks["disturbance"]
    text = (
        "The state-and-parameter filter of the thesis' surge equation, one sample at a time, from "
        "surge speed, shaft speed and rudder; the ship has no accelerometer, which the thesis' own "
        "filter needs. Its nominal vehicle has the parameters of all runs. It runs twice: with the "
        "thesis' terms alone, and with the acceleration by turn and wind as well. The disturbance "
        f"of {1e3 * std:.2f} mm/s² over {memory:g} s is as large as the prediction's error.",
        "Estimates at the end of each run, relative, with the filter's own standard deviation; NIS "
        "is the mean squared innovation over its variance, 1 if the filter's uncertainty were "
        "right from sample to sample. It falls far below where the speed's errors are jumps that "
        "last for seconds, modelled here as white noise of their strength. That noise, "
        f"{SPEED_NOISE:g} m/s, was chosen on the runs of the data set themselves.",
    )
    data = {
        "panels": estimate_lines(tracks["runs"]),
        "references": [],
        "labels": ["time in the run [s]", "relative to all runs"],
        "top": 2.0,
    }
    caption = "Estimates along the runs, in the order of the table, by the filter's terms."
    section = table_section("The filter on real readings", columns, rows, *text)
    return section | {"figures": [figure("curves", "filter", caption, data)]}


def estimate_cells(track: Findings) -> list[str]:
    """Last estimates of both lanes with their standard deviation, then the lanes' NIS."""
    cells = []
    for means, stds in zip(track["last"], track["last_std"], strict=True):
        cells += [f"{mean:.2f} ± {std:.2f}" for mean, std in zip(means, stds, strict=True)]
    return cells + [f"{nis:.2f}" for nis in track["nis"]]


def estimate_lines(
    tracks: Mapping[str, Findings],
) -> dict[str, dict[str, dict[str, list[float]]]]:
    """Lines of the estimates along each run, a panel per parameter and lane."""
    panels = {}
    for column, parameter in enumerate(PARAMETERS):
        for lane, lane_name in enumerate(LANES):
            lines = {}
            for k, track in enumerate(tracks.values(), 1):
                values = np.array(track["relative"])[:, lane, column]
                lines[f"run {k}"] = {"x": track["time"], "y": values.tolist()}
            panels[f"{parameter}, {lane_name}"] = lines
    return panels
