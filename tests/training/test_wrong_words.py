"""Every word of a command line that is wrong is refused in one line, by its name."""

import dataclasses
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_type_hints

import pytest

from training import cli
from training.arguments import COMMANDS
from training.wrong_words import refusal_of_words

POSITIONAL = {
    "train": ["integrated"],
    "export": ["integrated"],
    "submit": ["module:Class"],
    "haizhe": ["folder"],
    "esso-osaka": ["folder"],
    "vehicle": ["init", "log.csv"],
}
REQUIRED = {
    "train": "NAME",
    "export": "NAME",
    "submit": "TARGET",
    "haizhe": "FOLDER",
    "esso-osaka": "FOLDER",
    "vehicle": "ACTION, LOG",
    "calibrate": "--vehicle",
    "diagnose": "--vehicle",
}
TAKE_MANY = ("calibrate", "diagnose")


def options(name):
    """The options of a command that take values, with their types."""
    hints = get_type_hints(COMMANDS[name])
    by_position = {word.lower() for word in REQUIRED.get(name, "").split(", ")} | {"logs"}
    for field in dataclasses.fields(COMMANDS[name]):
        if field.name not in by_position and hints[field.name] is not bool:
            yield "--" + field.name.replace("_", "-"), hints[field.name]


def line(capsys, *words):
    """The one line of the error after the name of the command."""
    assert cli.main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    start = " ".join(["auv-fault", *words[:1]]) + ": "
    assert printed.err.startswith(start)
    # not in the words of the parser
    assert "arguments: got" not in printed.err
    return printed.err.removeprefix(start)


@pytest.mark.parametrize("name", REQUIRED)
def test_what_is_missing_is_named(capsys, name):
    error = line(capsys, name)
    assert error.startswith(f"{REQUIRED[name]}: got nothing; allowed is ")
    assert error.endswith(f"; `auv-fault {name} --help` explains all\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_an_unknown_option_gets_the_nearest_name(capsys, name):
    option = next(options(name))[0]
    wrong = option[:-1] + "x"
    words = POSITIONAL.get(name, [])
    for given in ([wrong, "3"], [f"{wrong}=3"]):
        error = line(capsys, name, *words, *given)
        assert error.startswith(f"option: got '{wrong}'; allowed is one of --")
        assert error.endswith(f"; did you mean '{option}'?\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_an_option_without_its_value_is_named(capsys, name):
    for option, kind in options(name):
        if "tuple" in str(kind) and option != "--diagnoser":
            continue
        for next_words in ([], ["--output", "x"] if option != "--output" else []):
            error = line(capsys, name, *POSITIONAL.get(name, []), option, *next_words)
            assert error.startswith(f"{option}: got nothing; allowed is ")


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in TAKE_MANY])
def test_a_word_too_many_is_named(capsys, name):
    error = line(capsys, name, *POSITIONAL.get(name, []), "more")
    assert error.startswith("argument: got 'more'; allowed is ")
    assert "; leave it out; " in error


@pytest.mark.parametrize(
    ("words", "start", "end"),
    [
        (("simulate", "--formats", "csv", "parkuet"), "--formats: got 'parkuet'", "'parquet'?\n"),
        (("benchmark", "--backend=lo"), "--backend: got 'lo'", "'loky'?\n"),
        (("vehicle", "inti", "log.csv"), "ACTION: got 'inti'", "did you mean 'init'?\n"),
    ],
)
def test_a_choice_out_of_the_list_gets_the_nearest_name(capsys, words, start, end):
    error = line(capsys, *words)
    assert error.startswith(f"{start}; allowed is one of ") and error.endswith(end)


def test_an_unknown_command_gets_the_nearest_name(capsys):
    assert cli.main(["daignose", "log.csv"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("auv-fault: command: got 'daignose'; allowed is one of reproduce, ")
    assert error.endswith("; did you mean 'diagnose'?\n") and error.count("\n") == 1


def test_an_underscore_in_the_name_of_a_command_is_a_hyphen_in_its_error(capsys):
    assert cli.main(["esso_osaka"]) == 2
    assert capsys.readouterr().err.startswith("auv-fault esso-osaka: FOLDER: got nothing; ")


def test_control_characters_of_a_word_reach_no_terminal(capsys):
    assert "\x1b" not in line(capsys, "diagnose", "--vehi\x1b[2Jcle", "x")


@dataclass
class Options:
    lanes: int = 3
    share: float = 0.5
    suite: Literal["thesis", "ideal"] = "ideal"
    quick: bool = False
    seeds: tuple[int, ...] = ()


def study(arguments: Options) -> None:
    pass


def plain_study(path: Path, seed: int = 0) -> None:
    pass


@pytest.mark.parametrize(
    ("target", "words", "start"),
    [
        (study, ["--lanes", "1.5"], "--lanes: got '1.5'; allowed is a whole number; give one"),
        (study, ["--share", "half"], "--share: got 'half'; allowed is a number; give one"),
        (study, ["--share", "-0.5", "x"], "argument: got 'x'; allowed is options only; "),
        (study, ["--quick=yes"], "--quick: got 'yes'; allowed is no value; "),
        (study, ["--help=3"], "--help: got '3'; allowed is no value; "),
        (study, ["--no-quik"], "option: got '--no-quik'; "),
        (study, ["--seeds", "1", "2", "x"], "--seeds: got 'x'; allowed is a whole number; "),
        (plain_study, ["--seed", "1"], "--path: got nothing; allowed is a path; add --path PATH"),
        (study, ["--lanes=1"], "arguments: got '--lanes=1'; allowed is what `p --help`"),
    ],
)
def test_the_words_of_a_study(target, words, start):
    error = str(refusal_of_words("p", words, target, "╭─ Box ─╮\n│ of the parser │\n╰───╯"))
    assert error.startswith(start)
    assert "arguments: got" not in start or error.endswith("shows; Box of the parser")


def test_a_study_refuses_in_one_line():
    module = "training.studies.calibration"
    command = [sys.executable, "-m", module, "--vehicle", "3"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"python -m {module}: option: got '--vehicle'; ")
    assert done.stderr.endswith("; did you mean '--vehicles'?\n")
