"""``auv-fault esso-osaka``: the surge equation and the thesis' filter on a real, healthy ship."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SAMPLE_TIME
from training.arguments import EssoOsaka
from training.datasets.esso_osaka_page import page
from training.datasets.esso_osaka_runs import ShipRun, free_running, load
from training.datasets.surge_fit import (
    TERMS,
    acceleration,
    intervals,
    normal_equations,
    prediction_error,
    rms,
    solve,
    together,
)
from training.datasets.surge_track import ship, track
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

THESIS = ("alpha", "beta", "gamma")
TURNING = (*THESIS, "turn")
MODEL = (*TURNING, "wind")
TURNING_NAME = "thesis, turn"
MODEL_NAME = "model: thesis, turn, wind"
FORMS: dict[str, tuple[str, ...]] = {
    "alpha, beta": THESIS[:2],
    "thesis: alpha, beta, gamma": THESIS,
    TURNING_NAME: TURNING,
    MODEL_NAME: MODEL,
    **{f"model, {name}": (*MODEL, name) for name in TERMS if name not in MODEL},
    "all terms": tuple(TERMS),
}
SHOWN_EVERY = 20  # samples of a figure: one point in two seconds


def main(arguments: EssoOsaka) -> None:
    """Fit every form, the model to every run, run the filter, and write the report."""
    whole = load(arguments.folder)
    if len(whole) < 2:
        raise refusal(
            "runs",
            len(whole),
            "two or more, to leave one out",
            "get the whole data set",
        )
    with run_folder(arguments.output, "esso-osaka", arguments) as folder:
        findings = study(whole, arguments.seed)
        results = page(
            f"auv-fault esso-osaka {arguments.folder} --seed {arguments.seed}",
            findings,
        )
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"])
    print(f"\nReport: {arguments.output / 'index.html'}")


def study(whole: Sequence[ShipRun], seed: int) -> dict[str, Any]:
    """All results of the page, from the runs with their ends."""
    runs = [free_running(run) for run in whole]
    fits = {
        "without wind": fit_runs(runs, TURNING, seed),
        "model": fit_runs(runs, MODEL, seed),
    }
    pooled = np.array(fits["model"]["pooled"]["coefficients"])
    return {
        "model": MODEL,
        "headlines": [MODEL_NAME, TURNING_NAME],
        "samples": [n_samples(whole), n_samples(runs)],
        "forms": compare_forms(whole, runs),
        "fits": fits,
        "tracks": follow(runs, pooled),
        "example": example(runs[0], pooled),
    }


def n_samples(runs: Sequence[ShipRun]) -> int:
    """Number of samples of all runs."""
    return sum(len(run.speed) for run in runs)


def compare_forms(whole: Sequence[ShipRun], runs: Sequence[ShipRun]) -> list[dict[str, Any]]:
    """Ten-second prediction error of every form [m/s rms over all starts].

    `fitted` is the error of the fit to all runs, `left_out` that of the fit to the other runs. The
    first entry is a constant speed; the last are two forms on whole runs.
    """
    constant = error(("alpha",), [np.zeros(1)] * len(runs), runs)
    compared = [{"form": "speed stays as it is", "fitted": constant, "left_out": constant}]
    cases = [(name, form, runs) for name, form in FORMS.items()]
    cases += [(f"{name}, ends kept", FORMS[name], whole) for name in (TURNING_NAME, MODEL_NAME)]
    for name, form, case_runs in tqdm(cases, desc="forms", unit="form"):
        pooled, others = fit(case_runs, form)
        fitted_error = error(form, [pooled] * len(case_runs), case_runs)
        left_out_error = error(form, others, case_runs)
        compared.append({"form": name, "fitted": fitted_error, "left_out": left_out_error})
    return compared


def fit(runs: Sequence[ShipRun], form: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients fitted to all runs (n_terms,), and to all runs but each (n_runs, n_terms)."""
    pooled = together([normal_equations(run, form) for run in runs])
    return solve(pooled), solve(pooled, 1.0 - np.eye(len(runs)))


def error(
    form: Sequence[str], coefficients: Sequence[np.ndarray], runs: Sequence[ShipRun]
) -> float:
    """Prediction error over all starts of all runs, each with its coefficients [m/s rms]."""
    errors = [
        prediction_error(form, run_coefficients, run)
        for run_coefficients, run in zip(coefficients, runs, strict=True)
    ]
    return rms(np.concatenate(errors))


def fit_runs(runs: Sequence[ShipRun], form: Sequence[str], seed: int) -> dict[str, Any]:
    """A form fitted to all runs and to each run alone.

    The intervals are from resampled runs, and from resampled minutes of a run.
    """
    normals = [normal_equations(run, form) for run in runs]
    pooled, others = fit(runs, form)
    alone = []
    for run, normal, other in zip(runs, normals, others, strict=True):
        own = solve(normal)
        errors = {
            "own": error(form, [own], [run]),
            "pooled": error(form, [pooled], [run]),
            "left_out": error(form, [other], [run]),
        }
        run_fit = {
            "run": run.name,
            "coefficients": own.tolist(),
            "intervals": intervals(normal, seed).tolist(),
            "errors": errors,
        }
        alone.append(run_fit)
    pooled_fit = {
        "coefficients": pooled.tolist(),
        "intervals": intervals(together(normals), seed).tolist(),
    }
    return {"pooled": pooled_fit, "runs": alone}


def follow(runs: Sequence[ShipRun], pooled: np.ndarray) -> dict[str, Any]:
    """The filter along every run; its nominal vehicle has the parameters of all runs.

    The second lane receives the acceleration by turn and wind.
    """
    vehicle = ship(MODEL, pooled, error(MODEL, [pooled] * len(runs), runs))
    known_terms = MODEL[len(THESIS) :]
    known_coefficients = pooled[len(THESIS) :]
    tracks = {}
    for run in tqdm(runs, desc="filter", unit="run"):
        inputs = run.inputs.sample_means()
        known = acceleration(known_terms, known_coefficients, run.speed[1:], inputs)
        estimates = track(run, vehicle, known)
        tracks[run.name] = {
            "time": shown_times(len(run.speed)),
            "relative": estimates.relative[::SHOWN_EVERY].round(4).tolist(),
            "last": estimates.relative[-1].tolist(),
            "last_std": estimates.std[-1].tolist(),
            "nis": estimates.nis.tolist(),
        }
    return {
        "disturbance": [vehicle.disturbance_std, vehicle.disturbance_time],
        "runs": tracks,
    }


def example(run: ShipRun, pooled: np.ndarray) -> dict[str, Any]:
    """One run as measured, and its speed as predicted ten seconds before."""
    errors = prediction_error(MODEL, pooled, run)
    skipped = len(run.speed) - len(errors)
    speed = run.speed[skipped:]
    series = {
        "speed": speed,
        "predicted": speed - errors,
        "rpm": run.inputs.rpm[skipped:],
        "rudder": run.inputs.rudder[skipped:],
        "error": errors,
    }
    shown = {name: values[::SHOWN_EVERY].round(6).tolist() for name, values in series.items()}
    return {"run": run.name, "time": shown_times(len(errors)), **shown}


def shown_times(n_samples: int) -> list[float]:
    """Time [s] of the samples that a figure shows."""
    return (np.arange(0, n_samples, SHOWN_EVERY) * SAMPLE_TIME).round(6).tolist()
