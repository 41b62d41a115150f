"""Kill commands at random moments, repeat them, and compare their files with those of whole runs.

Not a test of the suite, because every moment takes two runs::

    python tests/training/commands/kill_at_random_moments.py --moments 40 simulate calibrate

The commands are small: `train` and `train-stimulus` train on toys. All run in forks of one process
that has imported and compiled everything, so that the moments fall into their work. Files that hold
times differ between two whole runs too; they are not compared.
"""

import contextlib
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Literal

import tyro

FOLDER = Path(__file__).parent
LONGEST_RUN = 600.0  # s
RUN = "run"
TENSORBOARD = "tensorboard"


def prepare(logs: Path) -> dict[str, list[str]]:
    """Make the commands small, and write what they read; their words by name."""
    sys.path[:0] = [str(FOLDER.parents[2]), str(FOLDER.parent / "learning")]
    from tests.training.commands.test_train_stimulus import SMALL
    from tests.training.field.fleet_logs import VEHICLE, write_log
    from tests.training.field.healthy_missions import healthy_logs
    from training.field.vehicle_file import write_vehicle
    from training.learning import stimulus, trainer

    trainer.TRAINERS["integrated"] = "toy_trainer:ToyTrainer"
    for name, value in SMALL.items():
        setattr(stimulus, name, value)
    vehicle = logs / "vehicle.toml"
    write_vehicle(vehicle, VEHICLE)
    paths = [logs / f"{k}.csv" for k in range(2)]
    for path, log in zip(paths, healthy_logs(n=2, n_samples=600), strict=True):
        write_log(path, log.observation)
    benchmark = "benchmark --suite thesis --diagnosers null limits --stimuli cruise --lanes 4"
    benchmark += " --hours 0.1 --counting-hours 0.05 --backend threading --workers 1"
    return {
        "simulate": "simulate --vehicles 2 --duration 5".split(),
        "benchmark": benchmark.split(),
        "train": ["train", "integrated"],
        "train-stimulus": "train-stimulus --steps 128".split(),
        "calibrate": ["calibrate", "--vehicle", str(vehicle), *map(str, paths)],
    }


def run(words: list[str], log: Path, seconds: float = LONGEST_RUN) -> int | None:
    """Exit code of the command in a fork; None if it was killed after so many seconds."""
    child = os.fork()
    if child == 0:
        with log.open("a") as file:
            for stream in (sys.stdout, sys.stderr):
                os.dup2(file.fileno(), stream.fileno())
        from training import cli

        os._exit(cli.main(words))
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def files(folder: Path) -> dict[Path, bytes]:
    """The content of all files of a run by place.

    Without its manifest, which names the output, and its log, whose file names hold times.
    """
    return {
        path.relative_to(folder): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "manifest.json" and path.parent.name != TENSORBOARD
    }


def kill(name: str, words: list[str], folder: Path, moments: int) -> None:
    """Kill the command at random moments; `AssertionError` where its repetition differs."""
    log = folder / "log.txt"
    whole = []
    for place in ("first", "second"):
        start = time.monotonic()
        assert run([*words, "--output", str(folder / place / RUN)], log) == 0, log.read_text()
        duration = time.monotonic() - start
        whole.append(files(folder / place / RUN))
    expected = {place: content for place, content in whole[0].items() if content == whole[1][place]}
    timed = sorted(map(str, whole[0].keys() - expected.keys()))
    n_killed = 0
    for number in range(moments):
        parent = folder / str(number)
        output = parent / RUN
        moment = random.Random(f"{name} {number}").uniform(0.0, duration)
        n_killed += run([*words, "--output", str(output)], log, moment) is None
        assert run([*words, "--output", str(output)], log) == 0, log.read_text()
        found = files(output)
        assert found.keys() == whole[0].keys(), (moment, found.keys() ^ whole[0].keys())
        differing = [place for place in expected if found[place] != expected[place]]
        assert not differing, (moment, differing)
        assert list(parent.iterdir()) == [output], (moment, list(parent.iterdir()))
    print(
        f"{name}: {duration:.2f} s; killed {n_killed} times of {moments}: the same "
        f"{len(expected)} files, nothing left; not compared, for their times: "
        f"{', '.join(timed) or 'none'}",
        flush=True,
    )


def main(
    commands: tyro.conf.Positional[
        tuple[Literal["simulate", "benchmark", "train", "train-stimulus", "calibrate"], ...]
    ],
    moments: Annotated[int, tyro.conf.arg(help="of each command")] = 40,
) -> None:
    """Kill each command at random moments."""
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        folder = Path(place)
        small = prepare(folder)
        for name in commands:
            # compiles and imports here, for all forks
            from training import cli

            (folder / name).mkdir()
            words = small[name]
            assert cli.main([*words, "--output", str(folder / name / "before" / RUN)]) == 0
            kill(name, words, folder / name, moments)


if __name__ == "__main__":
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    tyro.cli(main)
