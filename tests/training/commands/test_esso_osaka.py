import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from auv_fault_env import physics
from auv_fault_env.errors import InputError
from training import cli
from training.commands import esso_osaka
from training.datasets import surge_fit
from training.datasets.esso_osaka_runs import COLUMNS, Inputs, ShipRun, free_running, load
from training.datasets.surge_fit import AHEAD
from training.datasets.surge_track import ship, track

FORM = esso_osaka.MODEL
TRUTH = np.array([-0.03, 1.0e-8, -0.1, 1.0, -4e-4])  # about those of the real ship
STEP = 0.1  # s
WIDE = 1000  # characters of a terminal in which no cell is broken


def steps(random, n_samples, values, hold=150):
    """A random value of `values` every `hold` samples."""
    return np.repeat(random.choice(values, n_samples // hold + 1), hold)[:n_samples]


ANY_RPM = (-400.0, 0.0, 300.0, 600.0)
AHEAD_RPM = (150.0, 300.0, 600.0)  # a propeller that never goes astern


def made_run(seed, seconds=400, noise=0.0, coefficients=TRUTH, name=None, speeds=ANY_RPM):
    """A ship with these coefficients, driven at random at these shaft speeds [rpm].

    noise [m/s^2] is that of an acceleration that lasts five seconds.
    """
    random = np.random.default_rng(seed)
    n_samples = round(seconds / STEP)
    rpm = steps(random, n_samples, speeds)
    rudder = steps(random, n_samples, [-0.5, 0.0, 0.5])
    share = STEP / 8.0
    memory = np.exp(-STEP / 5.0)
    yaw_rate = lfilter([share], [1.0, share - 1.0], -0.06 * rudder)
    push = lfilter(
        [noise * (1.0 - memory**2) ** 0.5], [1.0, -memory], random.normal(size=n_samples)
    )
    wind = 1.0 + lfilter([0.1], [1.0, -0.995], random.normal(size=n_samples))
    inputs = Inputs(-1.2 * yaw_rate, yaw_rate, rpm, rudder, wind)
    speed = np.full(n_samples, 0.1)
    driven = inputs.sample_means()
    for k in range(n_samples - 1):
        rate = surge_fit.acceleration(FORM, coefficients, speed[k], driven.at(k)) + push[k]
        speed[k + 1] = speed[k] + STEP * rate
    return ShipRun(name or f"made {seed}", speed, inputs)


def write_run(path, run, start=100.0):
    time = start + STEP * np.arange(len(run.speed))
    x = run.inputs
    columns = (
        time,
        run.speed,
        x.sway,
        x.yaw_rate,
        x.rpm / 60.0,
        x.rudder,
        np.abs(x.wind),
        np.pi * (x.wind < 0),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=",".join(COLUMNS), comments="")


def test_a_run_is_read_in_the_units_of_this_project(tmp_path):
    run = made_run(0, seconds=70)
    write_run(tmp_path / "random" / "random_01-Jan-2020.csv", run)
    (read,) = load(tmp_path)
    assert read.name == "01-Jan-2020"
    np.testing.assert_allclose(read.speed, run.speed, rtol=1e-6)
    for name, values, expected in zip(Inputs._fields, read.inputs, run.inputs, strict=True):
        np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-9, err_msg=name)


def test_the_first_terms_are_the_plants_own_equation():
    alpha, beta, gamma = TRUTH[:3]
    shaft = physics.Motor(0.0, 0.0, 0.0, 0.0, 0.5 * beta * physics.RPM**2)
    spin = 500.0 / physics.RPM
    rudder = 0.3
    speed = 0.4
    expected = physics.surge_acceleration(
        speed, spin, spin, alpha + gamma * rudder**2, 0.0, shaft, shaft
    )
    inputs = Inputs(*np.array([0.1, 0.1, 500.0, rudder, 1.0]))
    assert surge_fit.acceleration(esso_osaka.THESIS, TRUTH[:3], speed, inputs) == pytest.approx(
        expected, rel=1e-12
    )


def test_a_run_without_disturbance_gives_its_coefficients_back():
    run = made_run(1)
    np.testing.assert_allclose(
        surge_fit.solve(surge_fit.normal_equations(run, FORM)).coefficients, TRUTH, rtol=0.01
    )
    assert surge_fit.rms(surge_fit.prediction_error(FORM, TRUTH, run)) < 1e-4


def test_a_term_that_is_not_there_costs_little_and_one_that_is_missing_much():
    run = made_run(2)
    errors = {}
    for form in (FORM, (*FORM, "drift"), FORM[:3]):
        fitted = surge_fit.solve(surge_fit.normal_equations(run, form)).coefficients
        errors[form] = surge_fit.rms(surge_fit.prediction_error(form, fitted, run))
    assert errors[(*FORM, "drift")] < 2 * errors[FORM] < 0.1 * errors[FORM[:3]]


def test_the_prediction_is_that_of_an_exact_integrator():
    run = made_run(3, seconds=80)
    x = run.inputs
    time = STEP * np.arange(len(run.speed))

    def rate(t, u):
        now = Inputs(*(np.interp(t, time, values) for values in x))
        return surge_fit.acceleration(FORM, TRUTH, u, now)

    predicted = surge_fit.predict(FORM, TRUTH, run)
    for start in (0, 333, 600):
        span = (time[start], time[start + AHEAD])
        exact = solve_ivp(
            rate, span, run.speed[start : start + 1], rtol=1e-9, atol=1e-12, max_step=STEP / 2
        )
        assert predicted[start] == pytest.approx(exact.y[0, -1], abs=1e-4)


def test_leaving_a_run_out_by_weights_is_leaving_it_out():
    runs = [made_run(seed, noise=1e-3) for seed in range(3)]
    others = esso_osaka.fit(runs, FORM)[1].coefficients
    without = surge_fit.together([surge_fit.normal_equations(run, FORM) for run in runs[1:]])
    np.testing.assert_allclose(others[0], surge_fit.solve(without).coefficients, rtol=1e-9)
    assert not np.allclose(others[0], others[1], rtol=1e-3)


def test_a_term_that_a_run_does_not_excite_is_dropped_by_name_and_the_others_are_fitted():
    run = made_run(4, speeds=AHEAD_RPM)
    fit = surge_fit.solve(surge_fit.normal_equations(run, (*FORM, "astern")))
    reason = "zero in the runs fitted to"
    assert surge_fit.dropped((*FORM, "astern"), fit) == [("astern", reason)]
    np.testing.assert_allclose(fit.coefficients[:5], TRUTH, rtol=0.01)
    assert fit.coefficients[5] == 0.0


def test_a_term_that_repeats_an_earlier_one_is_dropped():
    run = made_run(5, speeds=(-500.0, -300.0, -150.0))  # only astern: n|n| is minus astern
    form = ("alpha", "astern", "beta", "gamma", "turn", "wind")
    fit = surge_fit.solve(surge_fit.normal_equations(run, form))
    ((name, reason),) = surge_fit.dropped(form, fit)
    assert (name, reason) == ("beta", "a combination of the terms before it")
    assert fit.coefficients[1] == pytest.approx(-TRUTH[1], rel=0.01)


def test_a_reading_that_rests_a_little_below_zero_does_not_excite_the_thrust_astern():
    whole = made_run(6)
    ahead = made_run(7, speeds=AHEAD_RPM)
    ahead.inputs.rpm[:300] = -0.5  # rpm: an offset of the reading at rest
    form = (*FORM, "astern")
    normals = [surge_fit.normal_equations(run, form) for run in (whole, ahead)]
    usual = surge_fit.term_rms(surge_fit.together(normals))
    fit = surge_fit.solve(normals[1], usual=usual)
    reason = "below 1 % of its rms in all runs"
    assert surge_fit.dropped(form, fit) == [("astern", reason)]
    assert surge_fit.dropped(form, surge_fit.solve(normals[0], usual=usual)) == []


def test_the_interval_of_a_term_that_few_minutes_excite_is_of_the_resamples_that_excite_it():
    run = made_run(8, seconds=700, noise=1e-4, speeds=AHEAD_RPM)
    run.inputs.rpm[1000:1100] = -300.0
    form = (*FORM, "astern")
    found = surge_fit.intervals(surge_fit.normal_equations(run, form), 0, n=200)
    assert np.isfinite(found).all()
    still = run.inputs._replace(rudder=np.zeros(len(run.speed)))
    found = surge_fit.intervals(surge_fit.normal_equations(run._replace(inputs=still), form), 0)
    assert np.isnan(found[2]).all() and np.isfinite(np.delete(found, 2, axis=0)).all()


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    held = []
    width = []
    for seed in range(25):
        normal = surge_fit.normal_equations(made_run(100 + seed, seconds=700, noise=1e-3), FORM)
        low, high = surge_fit.intervals(normal, seed, n=300).T
        held.append((low <= TRUTH) & (TRUTH <= high))
        width.append((high - low) / np.abs(TRUTH))
    assert np.all(np.mean(held, axis=0)[:2] >= 0.8)
    assert np.median(width, axis=0)[1] < 0.5  # beta: they are not held by being wide


def test_the_ships_disturbance_is_the_one_that_makes_its_prediction_err():
    runs = [made_run(200 + seed, seconds=700, noise=2e-3) for seed in range(3)]
    error = surge_fit.rms(
        np.concatenate([surge_fit.prediction_error(FORM, TRUTH, run) for run in runs])
    )
    vehicle = ship(FORM, TRUTH, error)
    assert vehicle.disturbance_std == pytest.approx(2e-3, rel=0.2)
    assert (vehicle.alpha, vehicle.beta, vehicle.gamma) == tuple(TRUTH[:3])


def test_the_filter_finds_a_ship_that_is_not_the_nominal_one_if_it_is_told_of_turn_and_wind():
    run = made_run(300, seconds=700, noise=2e-4, coefficients=TRUTH * [1.25, 0.9, 1.0, 1.0, 1.0])
    known = surge_fit.acceleration(FORM[3:], TRUTH[3:], run.speed[1:], run.inputs.sample_means())
    followed = track(run, ship(FORM, TRUTH, 2e-3), known)
    error = np.abs(followed.relative[-1] - [1.25, 0.9])
    assert np.all(error[1] < 3 * followed.std[-1, 1])
    assert error[1, 1] < 0.05 < error[0, 1]  # beta, of which a run tells most


def test_the_end_of_a_run_where_nobody_steers_is_left_out():
    run = made_run(1, seconds=100)
    run.inputs.rpm[800:] = 0.0
    run.inputs.rudder[850:] = 0.0
    run.inputs.rudder[849] = 0.1
    assert len(free_running(run).speed) == len(free_running(run).inputs.wind) == 850
    run.inputs.rpm[:] = 0.0
    run.inputs.rudder[:] = 0.0
    with pytest.raises(InputError, match="0 samples until nobody steers"):
        free_running(run)


def test_a_fit_to_no_run_that_goes_astern_predicts_one_that_does():
    runs = [made_run(500 + k, noise=1e-3, speeds=AHEAD_RPM) for k in range(2)]
    runs.append(made_run(502, noise=1e-3))
    form = (*FORM, "astern")
    pooled, others = esso_osaka.fit(runs, form)
    assert surge_fit.dropped(form, pooled) == []
    assert others.is_dropped.tolist() == [[False] * 6, [False] * 6, [False] * 5 + [True]]
    compared, missing = esso_osaka.compare_forms(runs, runs)
    assert all(np.isfinite([one["fitted"], one["left_out"]]).all() for one in compared)
    found = {"form": "model, astern", "fitted_to": "all runs but made 502", "term": "astern"}
    assert found | {"reason": "zero in the runs fitted to"} in missing


def results_of(capsys, *arguments):
    assert cli.main(["esso-osaka", *map(str, arguments)]) == 0
    output = arguments[arguments.index("--output") + 1]
    return json.loads((output / "results.json").read_text()), capsys.readouterr().out


def test_the_command_names_the_terms_that_runs_without_astern_do_not_excite(tmp_path, capsys):
    for seed in range(3):
        run = made_run(600 + seed, seconds=200, noise=1e-3, speeds=AHEAD_RPM)
        if seed == 1:
            run.inputs.rudder[:] = 0.0
        write_run(tmp_path / "data" / "random" / f"random_{seed}.csv", run)
    results, printed = results_of(capsys, tmp_path / "data", "--output", tmp_path / "out")
    missing = results["findings"]["dropped"]
    entry = {"form": "all terms", "fitted_to": "all runs", "term": "astern"}
    assert entry | {"reason": "zero in the runs fitted to"} in missing
    entry = {"form": esso_osaka.MODEL_NAME, "fitted_to": "1", "term": "gamma"}
    assert entry | {"reason": "zero in the runs fitted to"} in missing
    straight = results["findings"]["fits"]["model"]["runs"][1]
    gamma = esso_osaka.MODEL.index("gamma")
    assert straight["coefficients"][gamma] is None
    assert straight["intervals"][gamma] == [None, None]
    assert None not in straight["coefficients"][:2]
    assert "Terms dropped" in printed
    assert "astern" in printed and "zero in the runs fitted to" in printed
    assert "the propeller goes astern in 0 of 3 runs" in " ".join(results["summary"])
    assert "nan" not in (tmp_path / "out" / "index.html").read_text().lower().split("<img")[0]


def test_runs_that_never_turn_their_propeller_are_refused(tmp_path, capsys):
    for seed in range(2):
        run = made_run(700 + seed, seconds=100, speeds=(0.0,))
        write_run(tmp_path / "random" / f"random_{seed}.csv", run)
    error = refused(capsys, tmp_path, "--output", tmp_path / "out")
    assert "beta" in error and "zero in the runs fitted to" in error


def test_runs_to_be_scored_enter_no_fit(tmp_path, folder, capsys):
    other = made_run(900, seconds=120, coefficients=TRUTH * [1.0, 2.0, 1.0, 1.0, 1.0])
    write_run(tmp_path / "other.csv", other)
    plain, _ = results_of(capsys, folder, "--output", tmp_path / "plain")
    scored = ["--score", tmp_path / "other.csv"]
    results, printed = results_of(capsys, folder, "--output", tmp_path / "out", *scored)
    assert results["findings"]["fits"] == plain["findings"]["fits"]
    assert plain["findings"]["scored"] == []
    (run,) = results["findings"]["scored"]
    assert run["run"] == "other"
    form = esso_osaka.MODEL
    pooled = np.array(results["findings"]["fits"]["model"]["pooled"]["coefficients"])
    expected = surge_fit.rms(surge_fit.prediction_error(form, pooled, other))
    assert run["errors"][esso_osaka.MODEL_NAME] == pytest.approx(expected, rel=1e-4)
    own = results["findings"]["forms"][4]
    assert run["errors"][esso_osaka.MODEL_NAME] > 1.5 * own["left_out"]  # twice the thrust
    assert "Runs scored, in no fit" in printed and "other" in printed


def test_a_scored_run_that_goes_astern_says_that_no_fit_knows_the_thrust_astern():
    runs = [made_run(500 + k, noise=1e-3, speeds=AHEAD_RPM) for k in range(2)]
    ahead, astern = esso_osaka.score(runs, [made_run(3, speeds=AHEAD_RPM), made_run(3)])
    assert (ahead["missing"], astern["missing"]) == ([], ["astern"])
    assert np.isfinite(list(astern["errors"].values())).all()


def test_a_run_of_the_folder_that_is_to_be_scored_is_left_out_of_all_fits(tmp_path, folder, capsys):
    scored = ["--score", folder / "random" / ".." / "random" / "random_2.csv"]
    results, _ = results_of(capsys, folder, "--output", tmp_path / "out", *scored)
    findings = results["findings"]
    assert [run["run"] for run in findings["fits"]["model"]["runs"]] == ["0", "1"]
    assert [run["run"] for run in findings["scored"]] == ["2"]
    read = [run for run in load(folder) if run.name != "2"]
    pooled = esso_osaka.fit([free_running(run) for run in read], FORM)[0].coefficients
    np.testing.assert_allclose(findings["fits"]["model"]["pooled"]["coefficients"], pooled)


def test_a_file_to_be_scored_that_is_not_there_is_named(tmp_path, folder, capsys):
    output = ["--output", tmp_path / "out"]
    assert "nowhere.csv" in refused(capsys, folder, "--score", tmp_path / "nowhere.csv", *output)
    assert not (tmp_path / "out").exists()


def test_every_column_of_the_tables_is_printed(tmp_path, folder, capsys, monkeypatch):
    monkeypatch.setattr("training.report.page.PRINTED_WIDTH", WIDE)
    results, printed = results_of(capsys, folder, "--output", tmp_path / "out")
    tables = [section["table"] for section in results["sections"] if "table" in section]
    assert max(len(table["columns"]) for table in tables) > 6
    for table in tables:
        for words in (table["columns"], *table["rows"]):
            line = [word for word in words if word]
            assert any(all(word in text for word in line) for text in printed.splitlines()), words


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("ships")
    for seed in range(3):
        write_run(
            made / "random" / f"random_{seed}.csv", made_run(400 + seed, seconds=200, noise=1e-3)
        )
    return made


def test_the_command_writes_a_report(tmp_path, folder, capsys):
    assert cli.main(["esso-osaka", str(folder), "--output", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    findings = json.loads((tmp_path / "out" / "results.json").read_text())["findings"]
    forms = {one["form"]: one for one in findings["forms"]}
    assert set(esso_osaka.FORMS) < set(forms)
    model = forms[esso_osaka.MODEL_NAME]
    assert model["fitted"] < 0.4 * forms["speed stays as it is"]["fitted"]
    assert model["fitted"] < 0.8 * forms["thesis: alpha, beta, gamma"]["fitted"]
    assert all(one["fitted"] < 1.02 * one["left_out"] for one in forms.values())
    runs = findings["fits"]["model"]["runs"]
    assert [run["run"] for run in runs] == ["0", "1", "2"]
    for run in runs:
        assert all(
            low < value < high
            for value, (low, high) in zip(run["coefficients"], run["intervals"], strict=True)
        )
        assert run["errors"]["own"] < 1.02 * run["errors"]["left_out"]
    assert "Parameters by run" in printed
    page = (tmp_path / "out" / "index.html").read_text()
    assert f"{1e3 * model['fitted']:.1f} mm/s over every start (met)" in page
    assert (tmp_path / "out" / "figures" / "healthy-band.png").stat().st_size > 5000


def refused(capsys, *arguments):
    assert cli.main(["esso-osaka", *map(str, arguments)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def test_a_missing_folder_says_where_to_get_the_data(tmp_path, capsys):
    assert "NAOE-5thLab/FRT-DS-ESSO" in refused(capsys, tmp_path / "nowhere")


def test_one_run_alone_is_refused(tmp_path, capsys):
    write_run(tmp_path / "random" / "random_0.csv", made_run(0, seconds=70))
    assert "two or more" in refused(capsys, tmp_path, "--output", tmp_path / "out")


def test_a_gap_in_time_and_a_short_run_are_named(tmp_path, capsys):
    run = made_run(0, seconds=70)
    write_run(tmp_path / "random" / "random_0.csv", run)
    lines = (tmp_path / "random" / "random_0.csv").read_text().splitlines()
    (tmp_path / "random" / "random_0.csv").write_text("\n".join(lines[:30] + lines[40:]))
    assert "random_0.csv: got 't = 102.8 s, then 103.9 s'" in refused(capsys, tmp_path)
    (tmp_path / "random" / "random_0.csv").write_text("\n".join(lines[:30]))
    assert "29 rows" in refused(capsys, tmp_path)
