"""``auv-fault esso-osaka``: the surge equation and the thesis' filter on a real, healthy ship."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SAMPLE_TIME
from training.arguments import EssoOsaka
from training.datasets.esso_osaka_page import page
from training.datasets.esso_osaka_runs import ShipRun, free_running, load, read_run
from training.datasets.surge_fit import (
    TERMS,
    Fit,
    Normal,
    acceleration,
    dropped,
    intervals,
    normal_equations,
    prediction_error,
    rms,
    solve,
    term_rms,
    together,
)
from training.datasets.surge_track import ship, track
from training.report.cells import without_nan
from training.report.markdown import write_markdown
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

THESIS = ("alpha", "beta", "gamma")
TURNING = (*THESIS, "turn")
MODEL = (*TURNING, "wind")
TURNING_NAME = "thesis, turn"
MODEL_NAME = "model: thesis, turn, wind"
CONSTANT_NAME = "speed stays as it is"
ALL_TERMS = "all terms"
ALL_RUNS = "all runs"
FORMS: dict[str, tuple[str, ...]] = {
    "alpha, beta": THESIS[:2],
    "thesis: alpha, beta, gamma": THESIS,
    TURNING_NAME: TURNING,
    MODEL_NAME: MODEL,
    **{f"model, {name}": (*MODEL, name) for name in TERMS if name not in MODEL},
    ALL_TERMS: tuple(TERMS),
}
SHOWN_EVERY = 20  # samples of a figure: one point in two seconds


def main(arguments: EssoOsaka) -> None:
    """Fit every form, the model to every run, run the filter, and write the report."""
    whole = load(arguments.folder, arguments.score)
    if len(whole) < 2:
        raise refusal(
            "runs to fit",
            len(whole),
            "two or more, to leave one out",
            "get the whole data set, or score fewer of its runs",
        )
    scored = [free_running(read_run(path)) for path in arguments.score]
    with run_folder(arguments.output, "esso-osaka", arguments) as folder:
        findings = study(whole, scored, arguments.seed)
        results = page(command(arguments), findings)
        write_json(folder / "results.json", results)
        write_report(results, folder)
        write_markdown(results, folder)
    print_tables(results["sections"], whole=True)
    print(f"\nReport: {arguments.output / 'index.html'}")


def command(arguments: EssoOsaka) -> str:
    """The command that gives these results."""
    scored = " ".join(["--score", *map(str, arguments.score), ""]) if arguments.score else ""
    return f"auv-fault esso-osaka {arguments.folder} {scored}--seed {arguments.seed}"


def study(whole: Sequence[ShipRun], scored: Sequence[ShipRun], seed: int) -> dict[str, Any]:
    """All results of the page, from the runs with their ends; `scored` ones enter no fit."""
    runs = [free_running(run) for run in whole]
    coefficients = pooled_model(runs)
    forms, dropped_terms = compare_forms(whole, runs)
    fits = {}
    for name, form_name in (("without wind", TURNING_NAME), ("model", MODEL_NAME)):
        fits[name], dropped_of_runs = fit_runs(runs, form_name, seed)
        dropped_terms += dropped_of_runs
    return {
        "model": MODEL,
        "headlines": [MODEL_NAME, TURNING_NAME],
        "samples": [n_samples(whole), n_samples(runs)],
        "astern": sum(bool(np.any(run.inputs.rpm < 0.0)) for run in runs),
        "forms": forms,
        "dropped": dropped_terms,
        "scored": score(runs, scored),
        "fits": fits,
        "tracks": follow(runs, coefficients),
        "example": example(runs[0], coefficients),
    }


def pooled_model(runs: Sequence[ShipRun]) -> np.ndarray:
    """The model's coefficients by all runs, (n_terms,).

    Raises `InputError` if the runs do not excite alpha and beta, the parameters of the filter.
    """
    pooled = fit(runs, MODEL)[0]
    for name, reason in dropped(MODEL, pooled):
        if name in THESIS[:2]:
            allowed = "runs that excite alpha and beta"
            remedy = "add runs in which propeller and speed change"
            raise refusal(f"term {name} of {len(runs)} runs", reason, allowed, remedy)
    return pooled.coefficients


def n_samples(runs: Sequence[ShipRun]) -> int:
    """Number of samples of all runs."""
    return sum(len(run.speed) for run in runs)


def compare_forms(
    whole: Sequence[ShipRun], runs: Sequence[ShipRun]
) -> tuple[list[dict[str, Any]], list[dict[str, str]]]:
    """Ten-second prediction error of every form [m/s rms over all starts], and terms dropped.

    `fitted` is the error of the fit to all runs, `left_out` that of the fit to the other runs. The
    first entry is a constant speed; the last are two forms on whole runs.
    """
    constant = constant_error(runs)
    compared = [{"form": CONSTANT_NAME, "fitted": constant, "left_out": constant}]
    dropped_terms = []
    cases = [(name, form, runs) for name, form in FORMS.items()]
    cases += [(f"{name}, ends kept", FORMS[name], whole) for name in (TURNING_NAME, MODEL_NAME)]
    for name, form, case_runs in tqdm(cases, desc="forms", unit="form"):
        pooled, others = fit(case_runs, form)
        fitted_error = error(form, [pooled.coefficients] * len(case_runs), case_runs)
        left_out_error = error(form, others.coefficients, case_runs)
        compared.append({"form": name, "fitted": fitted_error, "left_out": left_out_error})
        dropped_terms += entries(name, form, ALL_RUNS, pooled)
        for k, run in enumerate(case_runs):
            dropped_terms += entries(name, form, f"{ALL_RUNS} but {run.name}", others.of(k))
    return compared, dropped_terms


def entries(name: str, form: Sequence[str], fitted_to: str, fit: Fit) -> list[dict[str, str]]:
    """The terms dropped from one fit of a form of this name, as plain data."""
    return [
        {"form": name, "fitted_to": fitted_to, "term": term, "reason": reason}
        for term, reason in dropped(form, fit)
    ]


def score(runs: Sequence[ShipRun], scored: Sequence[ShipRun]) -> list[dict[str, Any]]:
    """Prediction error of every form, fitted to `runs`, on each scored run [m/s rms].

    `missing` are the terms that the scored run excites and no fitted run does.
    """
    fits = {name: fit(runs, form)[0] for name, form in FORMS.items()}
    is_missing = fits[ALL_TERMS].is_small
    scores = []
    for run in scored:
        errors = {CONSTANT_NAME: constant_error([run])}
        for name, form in FORMS.items():
            errors[name] = error(form, [fits[name].coefficients], [run])
        is_excited = term_rms(normal_equations(run, FORMS[ALL_TERMS])) > 0.0
        missing = [FORMS[ALL_TERMS][k] for k in np.flatnonzero(is_missing & is_excited)]
        scores.append({"run": run.name, "errors": errors, "missing": missing})
    return scores


def constant_error(runs: Sequence[ShipRun]) -> float:
    """Error if the speed is predicted to stay as it is [m/s rms]."""
    return error(("alpha",), [np.zeros(1)] * len(runs), runs)


def fit(runs: Sequence[ShipRun], form: Sequence[str]) -> tuple[Fit, Fit]:
    """The form fitted to all runs (n_terms,), and to all runs but each (n_runs, n_terms)."""
    pooled = together([normal_equations(run, form) for run in runs])
    usual = term_rms(pooled)
    return solve(pooled, usual=usual), solve(pooled, 1.0 - np.eye(len(runs)), usual)


def error(
    form: Sequence[str], coefficients: Sequence[np.ndarray], runs: Sequence[ShipRun]
) -> float:
    """Prediction error over all starts of all runs, each with its coefficients [m/s rms]."""
    errors = [
        prediction_error(form, run_coefficients, run)
        for run_coefficients, run in zip(coefficients, runs, strict=True)
    ]
    return rms(np.concatenate(errors))


def fit_runs(
    runs: Sequence[ShipRun], name: str, seed: int
) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """The form of this name fitted to all runs and to each run alone, and the terms dropped.

    The intervals are from resampled runs, and from resampled minutes of a run. None stands for the
    coefficient of a term that was dropped.
    """
    form = FORMS[name]
    normals = [normal_equations(run, form) for run in runs]
    all_runs = together(normals)
    usual = term_rms(all_runs)
    pooled, others = fit(runs, form)
    alone = []
    dropped_terms = []
    for k, (run, normal) in enumerate(zip(runs, normals, strict=True)):
        own = solve(normal, usual=usual)
        errors = {
            "own": error(form, [own.coefficients], [run]),
            "pooled": error(form, [pooled.coefficients], [run]),
            "left_out": error(form, [others.coefficients[k]], [run]),
        }
        alone.append({"run": run.name, "errors": errors, **plain(own, normal, seed, usual)})
        dropped_terms += entries(name, form, run.name, own)
    return {"pooled": plain(pooled, all_runs, seed, usual), "runs": alone}, dropped_terms


def plain(fit: Fit, normal: Normal, seed: int, usual: np.ndarray) -> dict[str, list]:
    """Coefficients and intervals of a fit as plain data, None where a term is dropped."""
    coefficients = np.where(fit.is_dropped, np.nan, fit.coefficients)
    ends = intervals(normal, seed, usual=usual)
    return {
        "coefficients": without_nan(coefficients),
        "intervals": [without_nan(interval) for interval in ends],
    }


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
