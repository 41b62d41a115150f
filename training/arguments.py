"""The arguments of every command, one dataclass each, with their help texts."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg

from training.allowed import listed, number, whole
from training.known_names import (
    COMPETITORS,
    DIAGNOSERS,
    DIAGNOSERS_OF_LOGS,
    EXPORTABLE,
    MISSIONS,
    PRESETS,
    SPLITS,
    STIMULI,
    SUITES,
    TRAINABLE,
)

FEWEST_HOURS = 0.05
MOST_HOURS = 1000.0  # of healthy operation, for which `training.benchmark.plan` has seeds
LAST_OFFSET = 90_000_000  # the parts of the validation suite are 100 million seeds apart
LAST_BOOTSTRAP_SEED = 10_000_000  # from it the seeds of the bounds' lanes are counted
LARGEST_BUDGET = 1.0  # m/s, the largest speed command

Seed = Annotated[int, whole(0, 2**62)]
Hours = Annotated[float, number(FEWEST_HOURS, MOST_HOURS)]
Factor = Annotated[float, number(0.0, 10.0)]
Count = Annotated[int, whole(1, 10**9)]
# without the word None, which tyro writes into the help otherwise
OptionalPath = Annotated[Path | None, arg(metavar="PATH")]
OptionalSampler = Annotated[str | None, arg(metavar="{FILE.json,module:Class}")]


@dataclass(frozen=True)
class Reproduce:
    """Run the thesis' test runs, train its networks, and show our figures beside the thesis'."""

    output: Path = Path("runs/reproduce")
    """Folder of the report; an earlier report there is replaced."""
    seed: Seed = 0
    """First seed of the noisy runs, and of the networks."""
    seeds: Annotated[int, whole(2, 10_000)] = 20
    """Number of noisy runs of each test."""
    networks: Annotated[int, whole(2, 100)] = 10
    """Number of networks of each kind."""


@dataclass(frozen=True)
class Simulate:
    """Simulate vehicles with faults and write every sample to Parquet, CSV or a Minari data set."""

    output: Path = Path("runs/simulate")
    """Folder of the files; an earlier run there is replaced."""
    vehicles: Count = 8
    """Number of vehicles, one episode each."""
    duration: Annotated[float, number(0.1, 1e5)] = 60.0
    """Length of an episode [s]."""
    seed: Seed = 0
    """Seed of the first vehicle, within the split if there is one; the next have the next seeds."""
    split: Annotated[str | None, listed(*SPLITS)] = None
    """Part of a data set, whose seeds no other part has."""
    schedule: OptionalPath = None
    """JSON file with the fault schedule of every vehicle, [] for none; sampled if not set."""
    schedules: OptionalSampler = None
    """Distribution that schedules are sampled from: JSON file of its fields, or module:Class."""
    mission: Annotated[str | None, listed(*MISSIONS, "SPEED")] = None
    """Mission of every vehicle, or its constant speed [m/s]; sampled if not set."""
    missions: OptionalSampler = None
    """Distribution that missions are sampled from: JSON file of its fields, or module:Class."""
    preset: Annotated[str, listed(*PRESETS)] = "thesis1992"
    """Vehicle, with constants from publications."""
    vehicle: OptionalPath = None
    """Vehicle file (TOML) instead of a preset: its constants, healthy band and noise."""
    sensor_noise: Factor = 1.0
    """Factor on the readings' noise, 0 for none."""
    disturbance: Factor = 1.0
    """Factor on the disturbing acceleration, 0 for none."""
    healthy_band: Factor = 1.0
    """Factor on the healthy band, 0 for none."""
    realism: Factor = 0.0
    """Factor on the imperfections of real sensors and surroundings, 1 for what is usual."""
    formats: tuple[Literal["parquet", "csv", "minari"], ...] = ("parquet",)
    """Files to write; minari is a data set for `minari.load_dataset` (extra `formats`)."""


@dataclass(frozen=True)
class Train:
    """Train a diagnoser; a run that was broken off goes on with the same command."""

    name: Annotated[Positional[str], listed(*TRAINABLE)]
    """Diagnoser to train."""
    output: OptionalPath = None
    """Folder of weights, card and report, default runs/train-DIAGNOSER."""
    vehicle: OptionalPath = None
    """Vehicle file (TOML): trains a network on that vehicle, for `diagnose --weights`."""
    seed: Seed = 0
    """Seed; it gives the same weights with the same number of threads (OMP_NUM_THREADS)."""
    epochs: Annotated[int | None, whole(1)] = None
    """Most epochs to train, to shorten a run; the trainer's own number if not given."""
    install: bool = False
    """Copy weights and card into the package; works on a finished run too."""
    restart: bool = False
    """Discard the checkpoint and train anew; a finished run is replaced at the end."""


@dataclass(frozen=True)
class TrainStimulus:
    """Train a policy that varies the speed; the same command continues a stopped run."""

    output: OptionalPath = None
    """Folder of policy, card and report, runs/train-stimulus-DIAGNOSER-SEED if not given."""
    seed: Seed = 0
    """Seed of all that is random."""
    diagnoser: Annotated[str, listed(*COMPETITORS)] = "filter_bank"
    """Diagnoser whose beliefs it sees."""
    steps: Count = 10_000_000
    """Decisions to train on, one second each, rounded up to whole epochs."""
    install: bool = False
    """Copy policy and card into the package; works on a finished run too."""
    restart: bool = False
    """Discard the checkpoint and train anew; a finished run is replaced at the end."""


@dataclass(frozen=True)
class Validate:
    """Score the diagnosers on validation episodes; the same command continues a stopped run."""

    output: Path = Path("runs/validate")
    """Folder of the report and the trials; an earlier validation there is replaced."""
    diagnosers: Annotated[tuple[str, ...], listed(*DIAGNOSERS, several=True)] = ()
    """Diagnosers to score; all of the registry if none is named."""
    seed: Annotated[int, whole(0, LAST_OFFSET)] = 0
    """Offset within the validation seeds, and seed of the bootstrap intervals."""
    lanes: Annotated[int, whole(2, 1_000_000)] = 1000
    """Number of faulty vehicles, one episode each under every stimulus."""
    hours: Hours = 20.0
    """Healthy operation to set the thresholds, and as much again to count false alarms [h]."""


@dataclass(frozen=True)
class Benchmark:
    """Score the diagnosers on a frozen suite; the same command continues a stopped run."""

    suite: Annotated[str, listed(*SUITES, "FILE.json")] = "standard"
    """Suite of faulty episodes and healthy operation (docs/suites.md)."""
    output: OptionalPath = None
    """Folder of report and trials, default runs/benchmark-SUITE; an earlier report is replaced."""
    diagnosers: Annotated[tuple[str, ...], listed(*DIAGNOSERS, several=True)] = ()
    """Diagnosers to score; all of the registry if none is named."""
    diagnoser: UseAppendAction[tuple[str, ...]] = ()
    """A diagnoser from elsewhere, module:Class or FILE.py:Class; repeatable. This runs its code, in
    processes of its own; what it prints is not shown."""
    time_limit: Annotated[float, number(1.0, 1e6)] = 900.0
    """Most time that a diagnoser from elsewhere may take at once, for a trial say [s]."""
    stimuli: Annotated[tuple[str, ...], listed(*STIMULI, several=True)] = ("cruise", "thesis")
    """Stimuli to run them under."""
    budget: Annotated[float, number(0.0, LARGEST_BUDGET)] = 0.0762
    """Greatest root mean square of the speed offsets [m/s]; by default the thesis' 0.25 ft/s."""
    hours: Hours = 300.0
    """Healthy operation on which each diagnoser's thresholds are set, shared by the stimuli [h]."""
    counting_hours: Hours = 200.0
    """Other healthy operation on which its false alarms are counted, shared by the stimuli [h]."""
    lanes: Annotated[int | None, whole(1, 10**9)] = None
    """Run about so many of the suite's faulty episodes, without bounds; all if not set."""
    workers: Annotated[int | None, whole(1, 10_000)] = None
    """Processes at work; one per core if not given. The results are the same for any number."""
    backend: Literal["loky", "threading", "ray"] = "loky"
    """Processes or threads, or a Ray cluster (extra `distributed`, address in RAY_ADDRESS)."""
    seed: Annotated[int, whole(0, LAST_BOOTSTRAP_SEED)] = 0
    """Seed of the bootstrap intervals; the episodes have theirs from the suite."""


@dataclass(frozen=True)
class Submit:
    """Score a diagnoser from elsewhere on a suite of seeds that its digest and a nonce choose."""

    target: Annotated[Positional[str], arg(metavar="TARGET")]
    """module:Class, FILE.py:Class or FILE.onnx. This runs its code, in processes of its own; what
    it prints is not shown."""
    files: tuple[Path, ...] = ()
    """Further files that FILE.py needs, beside it or below; no others are there when it runs."""
    digest: bool = False
    """Print the digest of the submission, to publish it before the nonce is known, and stop."""
    nonce: Annotated[str | None, arg(metavar="TEXT")] = None
    """What nobody could know when the digest was published; random if not given."""
    nonce_from: Annotated[str | None, arg(metavar="TEXT")] = None
    """Where somebody else has published the nonce; the row is unverified without."""
    suite: Annotated[str, listed(*SUITES)] = "standard"
    """Frozen suite (docs/suites.md) whose recipe the suite of fresh seeds has."""
    lanes: Count = 360
    """Faulty episodes."""
    hours: Hours = 20.0
    """Healthy operation on which the thresholds are set [h]."""
    counting_hours: Hours = 20.0
    """Other healthy operation on which false alarms are counted [h]."""
    time_limit: Annotated[float, number(1.0, 1e6)] = 900.0
    """Most time that the diagnoser may take at once, for a trial say [s]."""
    workers: Annotated[int | None, whole(1, 10_000)] = None
    """Processes at work; one per core if not given. The figures are the same for any number."""
    output: OptionalPath = None
    """File to write, default runs/submit/NAME-SUITE.json; one that exists is not replaced."""


@dataclass(frozen=True)
class Leaderboard:
    """Write the tables of docs/leaderboard.md from the rows of `auv-fault submit`."""

    rows: Path = Path("docs/leaderboard")
    """Folder of the rows."""
    page: Path = Path("docs/leaderboard.md")
    """Page between whose marks the tables stand."""


@dataclass(frozen=True)
class Export:
    """Write a trained network as ONNX, and beside it an episode to try it on."""

    name: Annotated[Positional[str], listed(*EXPORTABLE, "POLICY", "FILE.safetensors")]
    """Network to write, a policy of the package as stimulus-filter_bank-0, or a file of weights."""
    output: OptionalPath = None
    """File to write, default runs/NAME.onnx; the episode is the .npz beside it."""
    seed: Seed = 0
    """Seed of the episode."""


@dataclass(frozen=True)
class Calibrate:
    """Fit a vehicle file to healthy logs: parameters with intervals, healthy band, noise."""

    vehicle: Path
    """Vehicle file (TOML) to start from; `auv-fault vehicle init` proposes one."""
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOGS")]
    """Healthy logs, one mission each: text, Parquet, bags, logs of autopilots (docs/logs.md)."""
    output: Path = Path("runs/calibrate")
    """Folder of vehicle.toml and the report; an earlier run there is replaced."""


@dataclass(frozen=True)
class Diagnose:
    """Diagnose logs or a stream. Exit code: the highest of 0 healthy, 2 unusable log, 3 fault."""

    vehicle: Path
    """Vehicle file (TOML), best the one that calibrate wrote."""
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOGS")] = ()
    """Logs: text, Parquet, bags, logs of autopilots (docs/logs.md)."""
    diagnoser: Annotated[str | None, listed(*DIAGNOSERS_OF_LOGS)] = None
    """By default that of the vehicle file, which calibrate chooses. residuals needs a calibration,
    raw_network --weights, all others but filter_bank every channel at 10 Hz or --weights."""
    weights: OptionalPath = None
    """Weights of the diagnoser (safetensors) from `auv-fault train --vehicle` on this file."""
    follow: bool = False
    """Read CSV with a header or JSON objects from standard input; answer each line in JSON."""
    healthy: tuple[Path, ...] = ()
    """Healthy logs: they limit the shafts' loads, and lower a threshold that they would cross."""
    output: Path = Path("runs/diagnose")
    """Folder of the report; an earlier report there is replaced. Not written with --follow."""


@dataclass(frozen=True)
class Haizhe:
    """Classify the faults of the Haizhe AUV data set, beside controls for its sessions."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the data set (doi.org/10.17632/7rp2pmr6mx.1): train/CLASS/*.csv, test/."""
    output: Path = Path("runs/haizhe")
    """Folder of the report; an earlier report there is replaced."""
    seed: Annotated[int, whole(0, 2**31)] = 0
    """Seed of folds, classifiers and bootstrap intervals."""


@dataclass(frozen=True)
class EssoOsaka:
    """Fit the surge equation and run the parameter filter on tests of the ship Esso Osaka."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the data set (github.com/NAOE-5thLab/FRT-DS-ESSO): random/*.csv."""
    score: tuple[Path, ...] = ()
    """Files of runs that are predicted and enter no fit, of FOLDER or from elsewhere."""
    output: Path = Path("runs/esso-osaka")
    """Folder of the report; an earlier report there is replaced."""
    seed: Seed = 0
    """Seed of the bootstrap intervals."""


@dataclass(frozen=True)
class Vehicle:
    """Propose a vehicle file from a log. Exit code: 0 the file reads the log, 2 it does not yet."""

    action: Annotated[Positional[Literal["init"]], arg(metavar="ACTION")]
    """init: propose a file."""
    log: Annotated[Positional[Path], arg(metavar="LOG")]
    """A log of the vehicle, best a healthy one on which the speed changes (docs/logs.md)."""
    output: Path = Path("vehicle.toml")
    """File to write; one that exists is not replaced."""


@dataclass(frozen=True)
class Watch:
    """Serve a live page on this machine: run a vehicle, break it, and see what is diagnosed."""

    port: Annotated[int, whole(0, 65535)] = 8080
    """Port of the page, on 127.0.0.1 only; 0 takes any that is free."""
    seed: Seed = 0
    """Seed of the vehicle of every visitor, and of the random faults."""


COMMANDS: dict[str, type] = {
    "reproduce": Reproduce,
    "simulate": Simulate,
    "train": Train,
    "train-stimulus": TrainStimulus,
    "validate": Validate,
    "benchmark": Benchmark,
    "submit": Submit,
    "leaderboard": Leaderboard,
    "export": Export,
    "calibrate": Calibrate,
    "diagnose": Diagnose,
    "haizhe": Haizhe,
    "esso-osaka": EssoOsaka,
    "vehicle": Vehicle,
    "watch": Watch,
}
