"""The page of `auv-fault esso-osaka`: forms compared, parameters per run, the healthy band, and the filter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from diagnosers.networks.fault_map import ALPHA_WINDOW, BETA_WINDOW, NOMINAL
from training.datasets.esso_osaka_runs import SOURCE
from training.datasets.surge_fit import UNITS
from training.report.lines import line_without_band

TARGET = 0.011  # m/s rms over ten seconds
PARAMETERS = ("alpha", "beta")
LANES = ("thesis alone", "told of turn and wind")
WINDOWS = {
    name: [edge / nominal for edge in window]
    for name, window, nominal in zip(PARAMETERS, (ALPHA_WINDOW, BETA_WINDOW), NOMINAL, strict=True)
}
LEFT_OUT = (
    "The model leaves out the pond's current, waves, the propeller's other thrust when it turns astern, its loss of "
    "thrust with the advance, and the rudder's drag in the propeller's race; but for the first two, each has its row. "
    "Propeller, rudder, sway, yaw rate and wind of the ten seconds are the measured ones: only the surge speed is "
    "predicted. Speeds are over ground, as the tests' own tracking gives them, with its jumps.",
    "The end of a run, where propeller and rudder are at zero for good, is left out: there people bring the model "
    "back, towing it at up to 0.2 m/s with the propeller at rest. The last rows show what keeping it would do.",
)


def page(command: str, findings: Mapping[str, Any]) -> dict[str, Any]:
    """The report as plain data; `findings` are those of `training.commands.esso_osaka.study`."""
    whole, used = findings["samples"]
    model = findings["fits"]["model"]
    return {
        "title": "Esso Osaka: the surge equation on a real, healthy ship",
        "command": command,
        "intro": [
            f"{len(model['runs'])} runs of a free-running 3 m model, {used * SAMPLE_TIME / 60:.0f} minutes at 10 Hz, "
            f"random propeller (ahead and astern) and rudder; {(whole - used) * SAMPLE_TIME:.0f} s at the runs' ends "
            f"are left out. Data: {SOURCE}.",
            verdict(findings["forms"], findings["headlines"]),
        ],
        "findings": findings,
        "sections": [
            forms(findings["forms"]),
            parameters(findings["model"], model),
            band(findings["model"], findings["fits"]),
            prediction(findings["example"]),
            tracking(findings["model"], model, findings["tracks"]),
        ],
    }


def verdict(compared: Sequence[Mapping[str, Any]], headlines: Sequence[str]) -> str:
    """Whether the forms that matter meet the target."""
    said = [
        f"Form “{one['form']}”: {1e3 * one['fitted']:.1f} mm/s over every start ({target(one['fitted'])}); with each "
        f"run predicted by the others' fit {1e3 * one['left_out']:.1f} mm/s."
        for one in compared
        if one["form"] in headlines
    ]
    return f"Ten-second prediction error, target at most {1e3 * TARGET:g} mm/s rms. " + " ".join(
        said
    )


def target(value: float) -> str:
    """Whether an error [m/s] meets the target, or by how much it misses."""
    return "met" if value <= TARGET else f"missed by {1e3 * (value - TARGET):.1f} mm/s"


def forms(compared: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Prediction errors by form."""
    rows = [
        [one["form"], *(f"{1e3 * one[key]:.2f}" for key in ("fitted", "left_out"))]
        for one in compared
    ]
    return {
        "heading": "Which form predicts",
        "text": [
            "du/dt is a sum of coefficients times terms: alpha u|u|, beta n|n| and gamma u|u| delta² as in the thesis "
            "and the plant; turn v r, the surge that a turning ship loses and a straight-running vehicle does not "
            "know; astern n² where n < 0; advance u|n|; race n|n| delta²; drift v²; centre r²; wind w|w| of the "
            "relative wind along the ship.",
            "Error of the speed predicted ten seconds ahead, simulated from the measured start; rms over every start.",
            *LEFT_OUT,
        ],
        "table": {
            "columns": ["form", "fitted to all runs [mm/s]", "each run left out of its fit [mm/s]"],
            "rows": rows,
        },
    }


def parameters(model: Sequence[str], fits: Mapping[str, Any]) -> dict[str, Any]:
    """The model's parameters by run, with intervals, and its errors."""
    rows = [
        [
            run["run"],
            *(f"{1e3 * run['errors'][key]:.1f}" for key in ("own", "pooled", "left_out")),
            *fitted(run),
        ]
        for run in fits["runs"]
    ]
    rows.append(["all", "", "", "", *fitted(fits["pooled"])])
    columns = [
        "run",
        "own [mm/s]",
        "all [mm/s]",
        "others [mm/s]",
        *(f"{name} [{UNITS[name]}]" for name in model),
    ]
    return {
        "heading": "Parameters by run",
        "text": [
            "The ten-second error with the run's own parameters, those of all runs, and those of the others; then "
            "least squares on ten-second increments, with 95 % intervals by resampling minutes within a run, and runs "
            "for all.",
        ],
        "table": {"columns": columns, "rows": rows},
    }


def fitted(fit: Mapping[str, Any]) -> list[str]:
    """Each coefficient with its interval, three digits."""
    return [
        f"{value:.3g} ({low:.3g} to {high:.3g})"
        for value, (low, high) in zip(fit["coefficients"], fit["intervals"], strict=True)
    ]


def relative(
    name: str, model: Sequence[str], fits: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """A parameter of each run over that of all runs, (n_runs,), and its interval (n_runs, 2)."""
    k = list(model).index(name)
    nominal = fits["pooled"]["coefficients"][k]
    values = np.array([run["coefficients"][k] for run in fits["runs"]]) / nominal
    return values, np.sort(
        np.array([run["intervals"][k] for run in fits["runs"]]) / nominal, axis=1
    )


def band(model: Sequence[str], fits: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The natural healthy band beside that of this project and the thesis' window."""
    panels = {}
    rows = []
    for name in PARAMETERS:
        default = Vehicle.__dataclass_fields__[name].metadata["band"]
        series = {how: relative(name, model, fit) for how, fit in fits.items()}
        panels[name] = {
            "series": {
                how: {"values": v.tolist(), "intervals": e.tolist()}
                for how, (v, e) in series.items()
            },
            "band": [1 - default, 1 + default],
            "window": WINDOWS[name],
        }
        rows += [[name, how, *spread(*found, default)] for how, found in series.items()]
    caption = (
        "Parameters of each run relative to all runs, with 95 % intervals; the widest leave the panel. Shaded: this "
        "project's default healthy band; dashed: the thesis' window of normal operation."
    )
    figure = {
        "plot": "healthy_band",
        "name": "healthy-band",
        "caption": caption,
        "data": {"runs": [run["run"] for run in fits["model"]["runs"]], "panels": panels},
    }
    return {
        "heading": "The natural healthy band",
        "text": [
            "Nothing was broken between these runs. A diagnoser whose band is narrower than its vehicle's calls health "
            "a fault; one that is not told of the wind needs a wider band still. The band has to come from the "
            "vehicle's own healthy logs; where an interval is wide, the run was too short, or too steady, to tell.",
        ],
        "table": {
            "columns": [
                "parameter",
                "form",
                "relative to all runs",
                "default band",
                "intervals wholly outside it",
            ],
            "rows": rows,
        },
        "figures": [figure],
    }


def spread(values: np.ndarray, ends: np.ndarray, default: float) -> list[str]:
    """How far a parameter (n_runs,) with intervals (n_runs, 2) spreads, and how many runs leave the default band."""
    apart = int(np.sum((ends[:, 0] > 1 + default) | (ends[:, 1] < 1 - default)))
    return [
        f"{values.min():.2f} to {values.max():.2f}",
        f"±{100 * default:g} %",
        f"{apart} of {len(values)}",
    ]


def prediction(example: Mapping[str, Any]) -> dict[str, Any]:
    """One run with its predictions."""
    panels = {
        "surge speed [m/s]": {"speed": "speed", "predicted 10 s before": "predicted"},
        "prediction error [m/s]": {"error": "error"},
        "propeller [rpm]": {"propeller": "rpm"},
        "rudder [rad]": {"rudder": "rudder"},
    }
    lines = {
        label: {name: line_without_band(np.array(example[key])) for name, key in names.items()}
        for label, names in panels.items()
    }
    figure = {
        "plot": "transients",
        "name": "prediction",
        "caption": f"Run {example['run']} from its tenth second, predicted with the parameters of all runs.",
        "data": {"time": example["time"], "panels": lines},
    }
    return {"heading": "One run, predicted", "text": [], "figures": [figure]}


def tracking(
    model: Sequence[str], fits: Mapping[str, Any], tracks: Mapping[str, Any]
) -> dict[str, Any]:
    """The filter's estimates at the end of each run beside the run's own fit, and along the runs."""
    own = np.stack([relative(name, model, fits)[0] for name in PARAMETERS], axis=1)
    rows = [
        [name, *(f"{value:.2f}" for value in values), *estimates(track)]
        for values, (name, track) in zip(own, tracks["runs"].items(), strict=True)
    ]
    head = [f"{name}, {how}" for how in ("own fit", *LANES) for name in PARAMETERS]
    figure = {
        "plot": "curves",
        "name": "filter",
        "caption": "Estimates along the runs, in the order of the table, by what the filter is told.",
        "data": {
            "panels": curves(tracks["runs"]),
            "references": [],
            "labels": ["time in the run [s]", "relative to all runs"],
            "top": 2.0,
        },
    }
    std, memory = tracks["disturbance"]
    return {
        "heading": "The filter on real readings",
        "text": [
            "The state-and-parameter filter of the thesis' surge equation, one sample at a time, from surge speed, "
            "shaft speed and rudder; the ship has no accelerometer, which the thesis' own filter needs. Its nominal "
            "vehicle has the parameters of all runs. It runs twice: knowing the thesis' terms alone, and told what "
            f"turn and wind do. Disturbance of {1e3 * std:.2f} mm/s² over {memory:g} s, as large as the prediction's "
            "error asks.",
            "Estimates at the end of each run, relative, with the filter's own standard deviation; NIS is the mean "
            "squared innovation over its variance, 1 if the filter's confidence were right from sample to sample. It "
            "is far below: the speed's errors are jumps that last for seconds, taken here as white noise of their "
            "strength there.",
        ],
        "table": {"columns": ["run", *head, *(f"NIS, {how}" for how in LANES)], "rows": rows},
        "figures": [figure],
    }


def estimates(track: Mapping[str, Any]) -> list[str]:
    """Last estimates of both lanes with their standard deviation, then the lanes' NIS."""
    lanes = zip(track["last"], track["last_std"], strict=True)
    cells = [
        f"{value:.2f} ± {std:.2f}"
        for means, stds in lanes
        for value, std in zip(means, stds, strict=True)
    ]
    return cells + [f"{nis:.2f}" for nis in track["nis"]]


def curves(tracks: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, dict[str, list[float]]]]:
    """Lines of the estimates along each run, a panel per parameter and lane."""
    panels = {}
    for column, parameter in enumerate(PARAMETERS):
        for lane, how in enumerate(LANES):
            panels[f"{parameter}, {how}"] = {
                f"run {k}": {
                    "x": track["time"],
                    "y": np.array(track["relative"])[:, lane, column].tolist(),
                }
                for k, track in enumerate(tracks.values(), 1)
            }
    return panels
