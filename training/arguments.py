"""The arguments of every command, one dataclass each: configuration, help text and logged settings in one."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg


@dataclass(frozen=True)
class Reproduce:
    """Run the thesis' test runs, train its networks, and show our figures beside the thesis'."""

    output: Path = Path("runs/reproduce")
    """Folder of the report; an earlier report there is replaced."""
    seed: int = 0
    """First seed of the noisy runs, and of the networks."""
    seeds: int = 20
    """Number of noisy runs of each test."""
    networks: int = 10
    """Number of networks of each kind; their spread is shown."""


@dataclass(frozen=True)
class Simulate:
    """Simulate vehicles with faults and write every sample to CSV, Parquet or a Minari data set."""

    output: Path = Path("runs/simulate")
    """Folder of the files; an earlier run there is replaced."""
    vehicles: int = 8
    """Number of vehicles, one episode each."""
    duration: float = 60.0
    """Length of an episode [s]."""
    seed: int = 0
    """Seed of the first vehicle; vehicle k has seed + k."""
    schedule: Path | None = None
    """JSON file with the fault schedule of every vehicle; sampled anew for each if not given. [] is healthy."""
    mission: str | None = None
    """thesis, acceleration, cruise or a constant speed in m/s; sampled anew for each vehicle if not given."""
    preset: str = "thesis1992"
    """Vehicle: thesis1992 or npsnet1995."""
    sensor_noise: float = 1.0
    """Factor on the readings' noise, 0 for none."""
    disturbance: float = 1.0
    """Factor on the disturbing acceleration, 0 for none."""
    healthy_band: float = 1.0
    """Factor on the spread of healthy vehicles, 0 for none."""
    formats: tuple[Literal["csv", "parquet", "minari"], ...] = ("csv", "parquet")
    """Files to write; minari is a data set for `minari.load_dataset` (extra `formats`)."""


@dataclass(frozen=True)
class Train:
    """Train a diagnoser's network; a run that was broken off goes on with the same command."""

    name: Annotated[Positional[str], arg(metavar="NAME")]
    """Diagnoser to train: raw_network, kalman_network or integrated."""
    output: Path | None = None
    """Folder of weights, card and report, runs/train-NAME if not given; the checkpoint lies in OUTPUT-unfinished."""
    seed: int = 0
    """Seed of all that is random; with the same number of threads (OMP_NUM_THREADS) it gives the same weights."""
    epochs: int | None = None
    """Most epochs to train, to shorten a run; the trainer's own number if not given."""
    install: bool = False
    """Copy weights and card into the package, where the diagnoser finds them; works on a finished run too."""
    restart: bool = False
    """Discard the checkpoint and train anew; a finished run at the output is replaced once the new one is complete."""


@dataclass(frozen=True)
class TrainStimulus:
    """Train a policy that varies the speed so that faults show sooner; the same command goes on after a break."""

    output: Path | None = None
    """Folder of policy, card and report, runs/train-stimulus-DIAGNOSER-SEED if not given."""
    seed: int = 0
    """Seed of all that is random."""
    budget: float = 0.1
    """Root mean square of the speed offsets that it may spend at most [m/s]; it learns to make do with less as well."""
    diagnoser: str = "filter_bank"
    """Diagnoser whose beliefs it sees: filter_bank or integrated."""
    steps: int = 650_000
    """Decisions to train on, one second each, rounded up to whole epochs."""
    install: bool = False
    """Copy policy and card into the package; works on a finished run too."""
    restart: bool = False
    """Discard the checkpoint and train anew; a finished run at the output is replaced once the new one is complete."""


@dataclass(frozen=True)
class Validate:
    """Score the diagnosers on validation episodes, while you develop one; the same command goes on after a break."""

    output: Path = Path("runs/validate")
    """Folder of the report and the trials; an earlier validation there is replaced."""
    diagnosers: tuple[str, ...] = ()
    """Diagnosers to score; all of the registry if none is named."""
    seed: int = 0
    """Offset within the validation seeds, and seed of the bootstrap intervals."""
    lanes: int = 1000
    """Number of faulty vehicles, one episode each under every stimulus."""
    hours: float = 20.0
    """Healthy operation to set the thresholds on, and as much again to count false alarms on [h]."""


@dataclass(frozen=True)
class Benchmark:
    """Score the diagnosers on a frozen suite; a run that was broken off goes on with the same command."""

    suite: str = "standard"
    """thesis, standard, ood_{noise,disturbance,vehicle,severity,compound,mission}, or a file of your own, FILE.json."""
    output: Path | None = None
    """Folder of the report and the trials, runs/benchmark-SUITE if not given; an earlier report there is replaced."""
    diagnosers: tuple[str, ...] = ()
    """Diagnosers to score; all of the registry if none is given."""
    diagnoser: UseAppendAction[tuple[str, ...]] = ()
    """One of somebody else's, module:Class or path/to/file.py:Class; repeat it for more. Naming it runs its code."""
    stimuli: tuple[str, ...] = ("cruise", "thesis")
    """Stimuli to run them under."""
    budget: float = 0.0762
    """Root mean square of the speed offsets that each stimulus may spend [m/s]; by default the thesis' 0.25 ft/s."""
    hours: float = 200.0
    """Healthy operation on which each diagnoser's thresholds are set, shared by the stimuli [h]."""
    counting_hours: float = 50.0
    """Other healthy operation on which its false alarms are counted, shared by the stimuli [h]."""
    lanes: int | None = None
    """Run about so many of the suite's faulty episodes, for a quick try without bounds; all if not given."""
    workers: int | None = None
    """Processes at work; one per core if not given. The results are the same for any number."""
    backend: Literal["loky", "threading", "ray"] = "loky"
    """Processes or threads of this machine, or a Ray cluster (extra `distributed`; RAY_ADDRESS names one that runs)."""
    seed: int = 0
    """Seed of the bootstrap intervals; the episodes have theirs from the suite."""


@dataclass(frozen=True)
class Export:
    """Write a trained network as ONNX, and beside it an episode to try it on."""

    name: Annotated[Positional[str], arg(metavar="NAME")]
    """raw_network, kalman_network, parallel, integrated, a policy of the package, or a safetensors file."""
    output: Path | None = None
    """File to write, runs/NAME.onnx if not given; the episode is the .npz beside it. Earlier ones are replaced."""
    seed: int = 0
    """Seed of the episode."""


@dataclass(frozen=True)
class Calibrate:
    """Fit a vehicle file to healthy logs: parameters with intervals, healthy band, noise, and what they do not tell."""

    vehicle: Path
    """Vehicle file (TOML) to start from; `auv-fault vehicle init` proposes one."""
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOGS")]
    """Healthy logs, one mission each: CSV, Parquet, MCAP, as the vehicle file describes them."""
    output: Path = Path("runs/calibrate")
    """Folder of vehicle.toml and the report; an earlier run there is replaced."""


@dataclass(frozen=True)
class Diagnose:
    """Diagnose logs of a vehicle, or its stream. Exit code: 0 healthy, 2 a log is unusable, 3 a fault; the highest."""

    vehicle: Path
    """Vehicle file (TOML), best the one that calibrate wrote."""
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOGS")] = ()
    """Logs: CSV, Parquet, MCAP, as the vehicle file describes them."""
    diagnoser: str = "filter_bank"
    """filter_bank; or integrated, cusum, rules, limits, kalman_network, which need every channel at 10 Hz."""
    follow: bool = False
    """Read standard input, CSV below a header or JSON objects; answer each line with a JSON object."""
    healthy: tuple[Path, ...] = ()
    """Healthy logs: they set limits on the shafts' loads, and lower the threshold where they would raise an alarm."""
    output: Path = Path("runs/diagnose")
    """Folder of the report; an earlier report there is replaced. Not written with --follow."""


@dataclass(frozen=True)
class Haizhe:
    """Classify the faults of the Haizhe AUV data set, beside controls that show what its sessions betray."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the data set (doi.org/10.17632/7rp2pmr6mx.1): train/CLASS/*.csv and, for the official figure, test/."""
    output: Path = Path("runs/haizhe")
    """Folder of the report; an earlier report there is replaced."""
    seed: int = 0
    """Seed of folds, forests and bootstrap intervals."""


@dataclass(frozen=True)
class EssoOsaka:
    """Fit the surge equation to the Esso Osaka ship's free-running tests and run the parameter filter on them."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the data set (github.com/NAOE-5thLab/FRT-DS-ESSO): random/*.csv."""
    output: Path = Path("runs/esso-osaka")
    """Folder of the report; an earlier report there is replaced."""
    seed: int = 0
    """Seed of the bootstrap intervals."""


@dataclass(frozen=True)
class Vehicle:
    """Propose the vehicle file that `calibrate` and `diagnose` read, from a log; it says why at every guess."""

    action: Annotated[Positional[Literal["init"]], arg(metavar="ACTION")]
    """init: propose a file."""
    log: Annotated[Positional[Path], arg(metavar="LOG")]
    """A log of the vehicle, best a healthy one on which the speed changes: CSV, Parquet, MCAP."""
    output: Path = Path("vehicle.toml")
    """File to write; one that exists is not replaced."""


@dataclass(frozen=True)
class Watch:
    """Serve a live page on this machine: run a vehicle, break it, and see what a diagnoser makes of it."""

    port: int = 8080
    """Port of the page, on 127.0.0.1 only; 0 takes any that is free."""
    seed: int = 0
    """Seed of the vehicle that every visitor gets, and of the surprises."""


COMMANDS: dict[str, type] = {
    "reproduce": Reproduce,
    "simulate": Simulate,
    "train": Train,
    "train-stimulus": TrainStimulus,
    "validate": Validate,
    "benchmark": Benchmark,
    "export": Export,
    "calibrate": Calibrate,
    "diagnose": Diagnose,
    "haizhe": Haizhe,
    "esso-osaka": EssoOsaka,
    "vehicle": Vehicle,
    "watch": Watch,
}
