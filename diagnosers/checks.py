"""The check that a diagnoser keeps the rules of `Diagnoser`, on a small fleet."""

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import refusal, whole_number
from auv_fault_env.faults import NORMAL
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import follow_mission
from auv_fault_env.schedules import FaultEvent
from diagnosers.diagnoser import Belief, Diagnoser
from diagnosers.registry import load

N_SAMPLES = 120
FAULTS = (
    "increased_drag",
    "propeller_loss:port",
    "motor_overheating:starboard",
    "sensor_dropout:speed",
)
SCHEDULES = ((), (), *((FaultEvent(fault, onset=5.0, severity=0.8),) for fault in FAULTS))
N_SHORT = 25  # samples of the checks with many runs
# networks compute in float32
ROUNDING = 1e-6
BATCH_TOLERANCE = 1e-4


def check_diagnoser(diagnoser: Diagnoser, seed: int = 0) -> None:
    """Raise `InputError`, in one line, for the first rule of `Diagnoser` that the diagnoser breaks.

    It makes about 2000 updates on six lanes, four of them with a fault, and resets the diagnoser.
    The rules: valid classes and beliefs; causality; the same beliefs in a batch and on single
    lanes, and after another reset; valid beliefs with missing and dropped channels; `ValueError`
    for a wrong shape; the same beliefs after save and load, if it can be saved. Misleads: it does
    not measure how good the diagnoser is, and misses a dependence on the future beyond 12 s.
    """
    observations = _fleet_run(whole_number("seed", seed, 0))
    for check in CHECKS:
        check(diagnoser, observations)


def _fleet_run(seed: int) -> np.ndarray:
    """Observations (n_samples, n_lanes, n_channels) of the small fleet."""
    fleet = Fleet(len(SCHEDULES))
    observation = fleet.reset(range(seed, seed + len(SCHEDULES)), schedules=SCHEDULES)
    run = [observation]
    while len(run) < N_SAMPLES:
        run.append(fleet.step(follow_mission(run[-1])))
    return np.array(run, np.float64)


def _beliefs(diagnoser: Diagnoser, observations: np.ndarray, when: str = "") -> list[Belief]:
    diagnoser.reset(observations.shape[1])
    try:
        return [diagnoser.update(observation) for observation in observations]
    except Exception as error:
        raise refusal(
            f"update{when}", error, "a belief", "take the last reading where one is missing"
        ) from error


def _stacked(beliefs: Iterable[Belief]) -> np.ndarray:
    """Beliefs as one array (n_samples, 3, n_lanes, n_classes): probability, severity mean and std."""
    return np.array([(np.exp(belief[0]), *belief[1:]) for belief in beliefs])


def _require(is_met: bool, thing: str, got, allowed: str, remedy: str) -> None:
    if not is_met:
        raise refusal(thing, got, allowed, remedy)


def _require_belief(diagnoser: Diagnoser, belief: Belief, n_lanes: int, when: str) -> None:
    """Require arrays of the right shape, finite and in range, and probabilities that sum to 1."""
    _require(isinstance(belief, Belief), f"belief{when}", belief, "a Belief", "return one")
    shape = (n_lanes, len(diagnoser.classes))
    for name, values in zip(Belief._fields, belief, strict=True):
        got = getattr(values, "shape", None)
        _require(
            got == shape,
            f"shape of {name}{when}",
            got,
            f"{shape}",
            "give a row per lane, a column per class",
        )
        _require(
            bool(np.isfinite(values).all()),
            f"{name}{when}",
            "NaN or infinity",
            "finite numbers",
            "limit it",
        )
    highest = float(belief[0].max())
    total = np.exp(belief[0]).sum(axis=1)
    worst = float(total[np.abs(total - 1).argmax()])
    _require(highest <= ROUNDING, f"log_probability{when}", highest, "at most 0", "normalise it")
    _require(
        abs(worst - 1) <= ROUNDING, f"sum of probabilities{when}", worst, "1", "normalise them"
    )
    low = float(belief[1].min())
    high = float(belief[1].max())
    _require(
        -ROUNDING <= low <= high <= 1 + ROUNDING,
        f"severity_mean{when}",
        (low, high),
        "0 to 1",
        "clip it",
    )
    low = float(belief[2].min())
    _require(low >= 0, f"severity_std{when}", low, "from 0", "give a standard deviation")


def _require_equal(
    got: np.ndarray, wanted: np.ndarray, thing: str, allowed: str, remedy: str, tolerance=0.0
) -> None:
    difference = float(np.abs(got - wanted).max())
    _require(difference <= tolerance, thing, f"a difference of {difference:.2g}", allowed, remedy)


def _check_interface(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    _require(
        isinstance(diagnoser, Diagnoser),
        "diagnoser",
        type(diagnoser),
        "classes, reset and update",
        "add them",
    )
    names = diagnoser.classes
    is_list = isinstance(names, tuple) and names[:1] == (NORMAL,)
    is_valid = is_list and len(set(names)) == len(names) > 1
    _require(
        is_valid,
        "classes",
        names,
        f"a tuple of different names, {NORMAL!r} first",
        "see auv_fault_env.classes()",
    )


def _check_beliefs(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    for k, belief in enumerate(_beliefs(diagnoser, observations)):
        _require_belief(diagnoser, belief, observations.shape[1], f" after sample {k}")


def _check_arrays(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    """An update changes neither its observation nor a belief that it has returned before."""
    inputs = observations.copy()
    beliefs = []
    copies = []
    diagnoser.reset(observations.shape[1])
    for observation in inputs:
        belief = diagnoser.update(observation)
        beliefs.append(belief)
        copies.append(_stacked([belief]))
    _require_equal(
        inputs, observations, "observation after update", "an unchanged one", "work on a copy"
    )
    allowed = "the belief as it was returned"
    remedy = "return new arrays"
    _require_equal(
        _stacked(beliefs), np.concatenate(copies), "belief after later updates", allowed, remedy
    )


def _check_causality(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    half = N_SAMPLES // 2
    other_future = np.concatenate([observations[:half], observations[:half][::-1]])
    beliefs = _stacked(_beliefs(diagnoser, observations)[:half])
    others = _stacked(_beliefs(diagnoser, other_future)[:half])
    _require_equal(
        beliefs, others, "beliefs before another future", "the same beliefs", "use no later sample"
    )


def _check_reset(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    first = _stacked(_beliefs(diagnoser, observations))
    second = _stacked(_beliefs(diagnoser, observations))
    _require_equal(
        second,
        first,
        "beliefs after a second reset",
        "exactly those after the first",
        "reset everything",
    )


def _check_lanes(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    batch = _stacked(_beliefs(diagnoser, observations))
    for lane in range(observations.shape[1]):
        single = _stacked(_beliefs(diagnoser, observations[:, lane : lane + 1]))
        thing = f"lane {lane} alone and in the batch"
        allowed = f"equal beliefs within {BATCH_TOLERANCE:g}"
        _require_equal(
            batch[:, :, lane : lane + 1],
            single,
            thing,
            allowed,
            "keep lanes apart",
            BATCH_TOLERANCE,
        )


def _check_channels(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    """Each channel missing (NaN) or dropped (zero) for a whole run, and all at some samples."""
    names = list(CHANNELS)
    for value, state, channels in ((np.nan, "missing", names), (0.0, "dropped", READINGS)):
        for name in channels:
            run = observations[:N_SHORT].copy()
            run[:, :, names.index(name)] = value
            _check_run(diagnoser, run, f" with {name} {state}")
        run = observations[:N_SHORT].copy()
        run[::3] = value
        _check_run(diagnoser, run, f" with all channels {state} every third sample")


def _check_run(diagnoser: Diagnoser, run: np.ndarray, when: str) -> None:
    for belief in _beliefs(diagnoser, run, when):
        _require_belief(diagnoser, belief, run.shape[1], when)


def _check_shapes(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    for wrong in (observations[0, :-1], observations[0, :, :-1], observations[0, 0]):
        diagnoser.reset(observations.shape[1])
        got = "a belief"
        try:
            diagnoser.update(wrong)
        except ValueError:
            continue
        except Exception as error:
            got = error
        reset = f"reset({observations.shape[1]})"
        thing = f"update with an observation of shape {wrong.shape} after {reset}"
        raise refusal(thing, got, "a ValueError", "check the shape")


def _check_storage(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    if not hasattr(diagnoser, "save"):
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "diagnoser.safetensors"
        diagnoser.save(path)
        loaded = load(path)
        before = _stacked(_beliefs(diagnoser, observations[:N_SHORT]))
        after = _stacked(_beliefs(loaded, observations[:N_SHORT]))
    _require(
        loaded.classes == diagnoser.classes,
        "classes after load",
        loaded.classes,
        "those saved",
        "save them",
    )
    _require_equal(
        after, before, "beliefs after save and load", "equal beliefs", "save all that it has learnt"
    )


CHECKS: tuple[Callable[[Diagnoser, np.ndarray], None], ...] = (
    _check_interface,
    _check_beliefs,
    _check_arrays,
    _check_causality,
    _check_reset,
    _check_lanes,
    _check_channels,
    _check_shapes,
    _check_storage,
)
