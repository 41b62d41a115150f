"""Kill a command at random moments, repeat it, and compare its files with those of a whole run.

Not a test of the suite, because it takes 40 times as long as the command::

    python tests/training/commands/kill_at_random_moments.py simulate --vehicles 2 --duration 5

Files that hold times differ between two whole runs too; they are not compared.
"""

import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MOMENTS = 40
PROGRAM = [sys.executable, "-m", "training.cli"]


def run(command, seconds=None):
    """Run the command to its end, or kill it after so many seconds; returns how long it took."""
    start = time.monotonic()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace"
    )
    try:
        _, error = process.communicate(timeout=seconds)
        assert process.returncode == 0, error
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
    return time.monotonic() - start


def files(folder):
    """The content of all files of a run by place, without its manifest, which names the output."""
    return {
        path.relative_to(folder): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "manifest.json" and not path.name.startswith(".")
    }


def main(arguments):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = [*PROGRAM, *arguments, "--output"]
        # the first run may compile
        durations = [run([*command, str(folder / place)]) for place in ("first", "second")]
        whole = files(folder / "first")
        timed = {
            place
            for place, content in files(folder / "second").items()
            if content != whole.get(place)
        }
        print(f"{durations[1]:.1f} s; hold times: {', '.join(sorted(map(str, timed))) or 'none'}")
        for number in range(MOMENTS):
            output = folder / f"run{number}"
            moment = random.Random(number).uniform(0.0, durations[1])
            run([*command, str(output)], moment)
            run([*command, str(output)])
            found = files(output)
            differing = [
                place
                for place in whole.keys() | found.keys()
                if place not in timed and whole.get(place) != found.get(place)
            ]
            left = [path.name for path in folder.glob(f".run{number}.*")]
            assert not differing and not left, (moment, differing, left)
            print(f"killed after {moment:.2f} s: the same {len(whole) - len(timed)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
