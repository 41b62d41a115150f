import re
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.split("\n")[0])
def test_example_runs(block):
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", block], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr


def test_every_file_that_is_named_exists():
    root = Path(__file__).parents[1]
    for name in re.findall(r"`((?:auv_fault_env|diagnosers|training)/\w+\.py)`", README):
        assert (root / name).is_file()


def test_nothing_is_left_to_fill_in():
    assert "<!--" not in README
