"""The ranges and names of the help are those that are checked."""

import math
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from tyro.constructors import PrimitiveConstructorSpec

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import InputError
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PRESETS
from diagnosers.registry import NAMES, ranked
from training import cli, known_names
from training.allowed import Range, check, number, whole
from training.arguments import COMMANDS, LARGEST_BUDGET, Simulate, Train
from training.benchmark import suites
from training.field.diagnosis.diagnosis import THRESHOLDS
from training.formats.onnx import GRAPHS
from training.learning.trainer import TRAINERS
from training.seeds import SPLITS
from training.stimuli import STIMULI

NUMBERS = {int, float, int | None, float | None}


def annotated(kind):
    """Type and annotation of every argument that has one."""
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if get_origin(hint) is Annotated:
            for one in get_args(hint)[1:]:
                if isinstance(one, PrimitiveConstructorSpec):
                    yield name, one


def help_of(capsys, name):
    assert cli.main([name, "--help"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_shows_every_range_and_every_name(capsys, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "1000")
    text = help_of(capsys, name)
    assert "None}" not in text
    for field, one in annotated(COMMANDS[name]):
        assert f"--{field.replace('_', '-')} {one.metavar}" in text or f" {one.metavar}" in text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_number_has_a_range(name):
    with_range = {field for field, one in annotated(COMMANDS[name]) if isinstance(one, Range)}
    hints = get_type_hints(COMMANDS[name])
    assert {field for field, hint in hints.items() if hint in NUMBERS} == with_range


def outside(one):
    """Words that a range must refuse."""
    yield from ("x", "nan", "")
    yield f"{int(one.low) - 1}"
    if one.high < math.inf:
        yield f"{int(one.high) + 1}"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_range_is_checked_in_one_line_before_any_work(tmp_path, capsys, name):
    kind = COMMANDS[name]
    for field, one in annotated(kind):
        if not isinstance(one, Range):
            continue
        option = field.replace("_", "-")
        required = {"train": ["integrated"], "export": ["integrated"], "submit": ["m:C"]}
        folder = ["folder"] if "folder" in kind.__dataclass_fields__ else []
        for word in outside(one):
            words = [name, *required.get(name, folder), f"--{option}={word}"]
            assert cli.main(words) == 2
            error = capsys.readouterr().err
            assert error.count("\n") == 1
            assert error.startswith(f"auv-fault {name}: {option}: got ")
            assert f"; allowed is {one.description}; give one in that range\n" in error


def test_a_range_has_its_ends_and_no_other_kind_of_number():
    for low, high in ((0, 5), (0.1, 0.5)):
        one = number(low, high)
        assert one.contains(low) and one.contains(high)
        assert not one.contains(high * 1.001) and not one.contains(low - 1e-9)
    assert whole(1).instance_from_str(["2.0"]) == "2.0"
    assert whole(1).contains(10**400)
    assert not number(0, 1).contains(math.nan)


def test_what_is_not_set_is_not_checked():
    check(Train("integrated"))
    with pytest.raises(InputError, match="vehicles: got 0; allowed is a whole number from 1 to"):
        check(Simulate(vehicles=0))


def test_the_names_of_the_help_are_those_of_the_registries():
    assert list(known_names.PRESETS) == list(PRESETS)
    assert list(known_names.SPLITS) == list(SPLITS)
    assert list(known_names.DIAGNOSERS) == list(NAMES)
    assert list(known_names.COMPETITORS) == ranked()
    assert list(known_names.DIAGNOSERS_OF_LOGS) == list(THRESHOLDS)
    assert list(known_names.TRAINABLE) == list(TRAINERS)
    assert list(known_names.EXPORTABLE) == list(GRAPHS)
    assert list(known_names.STIMULI) == list(STIMULI)
    files = {path.stem for path in suites.FOLDER.glob("*.json")}
    assert set(known_names.SUITES) == files
    assert list(known_names.MISSIONS) == list(MISSIONS)
    assert LARGEST_BUDGET == MAXIMUM_COMMAND
