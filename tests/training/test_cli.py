import subprocess
import sys
import time
from importlib.metadata import version

import pytest

from training import cli
from training.arguments import COMMANDS

PROBE = "import sys; {}; print(' '.join(sorted({{name.split('.')[0] for name in sys.modules}})))"
NAMES_BY_POSITION = {("train", "name"): "raw_network", ("export", "name"): "raw_network"}
HELP = """
import contextlib, training.cli
with contextlib.suppress(SystemExit):
    training.cli.main(["--help"])
"""


def modules_after(statement):
    run = subprocess.run(
        [sys.executable, "-c", PROBE.format(statement)], capture_output=True, text=True, check=True
    )
    return set(run.stdout.split("\n")[-2].split())


@pytest.mark.parametrize(
    "statement",
    ["import auv_fault_env", HELP],
    ids=["import", "help"],
)
def test_start_loads_nothing_heavy(statement):
    code = statement if "\n" not in statement else f"exec({statement!r})"
    assert not modules_after(code) & {
        "torch",
        "matplotlib",
        "stable_baselines3",
        "pandas",
        "pygame",
        "pyarrow",
    }


def test_every_command_has_a_module_with_main():
    import importlib

    for name in COMMANDS:
        assert callable(importlib.import_module(f"training.commands.{name.replace('-', '_')}").main)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_every_argument(name):
    run = subprocess.run(
        [sys.executable, "-m", "training.cli", name, "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    for field in COMMANDS[name].__dataclass_fields__:
        # an option, or by position
        positional = NAMES_BY_POSITION.get((name, field), field.upper())
        assert "--" + field.replace("_", "-") in run.stdout or positional in run.stdout


def test_without_a_command_the_help_is_shown_and_the_code_is_that_of_bad_input(capsys):
    assert cli.main([]) == 2
    without = capsys.readouterr()
    assert without.err == ""
    assert cli.main(["--help"]) == 0
    assert capsys.readouterr().out == without.out
    assert all(name in without.out for name in COMMANDS)
    assert "--version" in without.out


def test_the_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"auv-fault {version('auv-fault')}\n"


def test_the_version_of_a_checkout_that_is_not_installed(capsys, monkeypatch):
    monkeypatch.setattr(cli, "version", lambda name: version("no-such-package"))
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == "auv-fault of a checkout that is not installed\n"


def test_bad_input_is_one_line_without_a_traceback(tmp_path):
    run = subprocess.run(
        [
            sys.executable,
            "-m",
            "training.cli",
            "simulate",
            "--preset",
            "x",
            "--output",
            str(tmp_path / "run"),
        ],
        capture_output=True,
        text=True,
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith(
        "auv-fault simulate: preset: got 'x'; allowed is one of thesis1992, npsnet1995, "
    )


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        (["vehicle", "init", "no.csv"], "log: got 'no.csv'"),
        (["calibrate", "--vehicle", "no.toml", "log.csv"], "vehicle file: got 'no.toml'"),
        (["calibrate", "--vehicle", "v.toml", "no.csv"], "log: got 'no.csv'"),
        (["diagnose", "--vehicle", "no.toml", "log.csv"], "vehicle file: got 'no.toml'"),
        (["diagnose", "--vehicle", "v.toml", "no.csv", "nor.csv"], "log: got 'no.csv'"),
        (["simulate", "--vehicle", "no.toml"], "vehicle file: got 'no.toml'"),
        (["simulate", "--schedule", "no.json"], "schedule file: got 'no.json'"),
        (["train", "integrated", "--vehicle", "no.toml"], "vehicle file: got 'no.toml'"),
        (["train", "no-such"], "diagnoser to train: got 'no-such'"),
        (["benchmark", "--suite", "no.json"], "suite: got 'no.json'"),
        (["benchmark", "--diagnoser", "no.py:Class"], "no.py:Class'; allowed is what can be"),
        (["submit", "no.py:Class"], "submission: got 'no.py'"),
        (["export", "no-such"], "network to export: got 'no-such'"),
        (["haizhe", "no"], "data folder: got 'no'"),
        (["esso-osaka", "no"], "data folder: got 'no'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_inputs_are_checked_before_the_output(tmp_path, monkeypatch, capsys, words, refused):
    monkeypatch.chdir(tmp_path)
    channels = "".join(f'[channels.{name}]\ncolumn = "{name}"\n' for name in ("speed", "port_rpm"))
    (tmp_path / "v.toml").write_text(f"[vehicle]\nsample_rate = 10.0\n{channels}")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "mine").touch()
    assert cli.main([*words, "--output", "taken"]) == 2
    error = capsys.readouterr().err.split("\r")[-1].lstrip()
    assert error.count("\n") == 1
    assert error.startswith(f"auv-fault {words[0]}: ") and refused in error


def test_termination_leaves_nothing(tmp_path):
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "training.cli",
            "simulate",
            "--vehicles",
            "5000",
            "--output",
            str(tmp_path / "run"),
        ],
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.terminate()
    try:
        assert process.wait(timeout=30) == 128 + 15
    finally:
        process.kill()
        process.wait()
    assert not list(tmp_path.iterdir())
