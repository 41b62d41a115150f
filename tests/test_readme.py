"""README and documents: examples run, commands parse, the files and modules they name exist."""

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import tyro

from training.arguments import COMMANDS

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {path.name: path.read_text(encoding="utf-8") for path in DOCUMENTS}
PAGES_OF_EXAMPLES = (
    "README.md",
    "active.md",
    "diagnosers.md",
    "environments.md",
    "extending.md",
    "fault_injection.md",
    "faults.md",
    "index.md",
)
EXAMPLES = [
    (code, output)
    for name in PAGES_OF_EXAMPLES
    for code, output in re.findall(
        r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", TEXTS[name], re.DOTALL
    )
]


def commands(text):
    """The calls of `auv-fault` in the indented blocks and in the `code` of a document."""
    joined = text.replace("\\\n", " ")
    lines = [line for line in joined.splitlines() if line.startswith("    ")]
    spans = re.findall(r"`(auv-fault [^`]+)`", joined)
    for line in (*lines, *spans):
        for call in re.findall(r"(?:^|[\s|])auv-fault ([^;#|]+)", line):
            yield " ".join(call.split())


COMMAND_LINES = [
    (name, call)
    for name, text in TEXTS.items()
    for call in commands(text)
    if call.split()[0] in COMMANDS
]


@pytest.mark.parametrize(("code", "output"), EXAMPLES, ids=lambda text: text.split("\n")[0])
def test_example_prints_what_is_shown(code, output):
    for module in re.findall("^import (gym_electric_motor|mujoco)", code, re.MULTILINE):
        pytest.importorskip(module)  # of an extra
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout == output


@pytest.mark.parametrize(("name", "call"), COMMAND_LINES)
def test_command_of_a_document_parses(name, call):
    words = [word for word in shlex.split(call.replace("$k", "1")) if word != "..."]
    try:
        tyro.extras.subcommand_cli_from_dict(COMMANDS, prog="auv-fault", args=words)
    except SystemExit as stop:
        needs_more = len(words) == 1  # the name of a command alone, in a sentence
        assert needs_more or stop.code == 0, f"{name}: auv-fault {call}"


@pytest.mark.parametrize("name", TEXTS)
def test_every_module_and_file_that_is_named_exists(name):
    for module in re.findall(r"python -m (training[\w.]+)", TEXTS[name]):
        if not module.endswith("NAME") and not module.endswith("."):
            assert importlib.util.find_spec(module), module
    for file in re.findall(
        r"`((?:auv_fault_env|diagnosers|training|docs)/[\w/]+\.\w+)`", TEXTS[name]
    ):
        assert (ROOT / file).is_file(), file
    for link in re.findall(r"\]\((?!https?:)([^)#]+)", TEXTS[name]):
        assert (
            (ROOT if name in ("README.md", "CONTRIBUTING.md") else ROOT / "docs") / link
        ).exists(), link


def test_the_readme_is_one_page_with_nothing_left_to_fill_in():
    assert len(TEXTS["README.md"].splitlines()) <= 130
    assert "<!--" not in TEXTS["README.md"]
