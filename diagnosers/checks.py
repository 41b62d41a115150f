"""The check that a diagnoser keeps the rules of `Diagnoser`, on a small fleet."""

import sysconfig
import tempfile
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import refusal, whole_number
from auv_fault_env.faults import NORMAL, UNKNOWN
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import follow_mission
from auv_fault_env.schedules import FaultEvent
from diagnosers.diagnoser import Belief, Diagnoser
from diagnosers.registry import load

N_SAMPLES = 120
FAULTS = (
    *("increased_drag", "propeller_loss:port"),
    *("motor_overheating:starboard", "sensor_dropout:speed"),
)
SCHEDULES = (
    (),
    (),
    *((FaultEvent(fault, onset=5.0, severity=0.8),) for fault in FAULTS),
)
MISSING = "missing"  # the state of a channel that is NaN
LIBRARIES = tuple(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib"))
N_SHORT = 25  # samples of the checks with many runs
ROUNDING = 1e-6  # networks compute in float32
BATCH_TOLERANCE = 1e-4


def check_diagnoser(diagnoser: Diagnoser, seed: int = 0) -> None:
    """Raise `InputError`, in one line, for the first rule of `Diagnoser` that the diagnoser breaks.

    It makes about 2000 updates on six lanes, four of them with a fault, and resets the diagnoser;
    the rules are `CHECKS`. Misleads: it does not measure how good the diagnoser is, and misses a
    dependence on the future beyond 12 s.
    """
    _run_checks(CHECKS, diagnoser, seed)


def check_beliefs(diagnoser: Diagnoser, seed: int = 0) -> None:
    """As `check_diagnoser`, without save and load: all that a benchmark asks of a diagnoser."""
    _run_checks(CHECKS_OF_BELIEFS, diagnoser, seed)


def _run_checks(checks: Iterable["Check"], diagnoser: Diagnoser, seed: int) -> None:
    observations = _fleet_run(whole_number("seed", seed, 0))
    for check in checks:
        check(diagnoser, observations)


def _fleet_run(seed: int) -> np.ndarray:
    """Observations (n_samples, n_lanes, n_channels) of the small fleet."""
    fleet = Fleet(len(SCHEDULES))
    run = [fleet.reset(range(seed, seed + len(SCHEDULES)), schedules=SCHEDULES)]
    while len(run) < N_SAMPLES:
        run.append(fleet.step(follow_mission(run[-1])))
    return np.array(run, np.float64)


def _beliefs(diagnoser: Diagnoser, observations: np.ndarray, when: str = "") -> list[Belief]:
    diagnoser.reset(observations.shape[1])
    try:
        return [diagnoser.update(observation) for observation in observations]
    except Exception as error:
        remedy = f"correct it in {_place_of(error)}"
        if MISSING in when:
            remedy = f"take the last reading where one is missing, or {remedy}"
        raise refusal(f"update{when}", error, "a belief", remedy) from error


def _place_of(error: Exception) -> str:
    """File and line where an error was raised, of libraries where they were called."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames[1:] if not frame.filename.startswith(LIBRARIES)]
    place = (own or frames)[-1]
    return f"{Path(place.filename).name}, line {place.lineno}"


def _stacked(beliefs: Iterable[Belief]) -> np.ndarray:
    """Probability, severity mean and std as one array (n_samples, 3, n_lanes, n_classes)."""
    return np.array([(np.exp(belief[0]), *belief[1:]) for belief in beliefs])


def _run(diagnoser: Diagnoser, observations: np.ndarray) -> np.ndarray:
    """The beliefs, as `_stacked`, after a reset."""
    return _stacked(_beliefs(diagnoser, observations))


def _require(is_met: bool, thing: str, got, allowed: str, remedy: str) -> None:
    if not is_met:
        raise refusal(thing, got, allowed, remedy)


def _require_beliefs(diagnoser: Diagnoser, observations: np.ndarray, when: str = "") -> None:
    """Require arrays of the right shape, finite and in range, and probabilities that sum to 1."""
    shape = (observations.shape[1], len(diagnoser.classes))
    for k, belief in enumerate(_beliefs(diagnoser, observations, when)):
        at = when or f" after sample {k}"
        _require(
            isinstance(belief, Belief),
            f"belief{at}",
            belief,
            "a Belief",
            "return one",
        )
        for name, values in zip(Belief._fields, belief, strict=True):
            got = getattr(values, "shape", None)
            remedy = "give a row per lane, a column per class"
            _require(got == shape, f"shape of {name}{at}", got, f"{shape}", remedy)
            is_finite = bool(np.isfinite(values).all())
            _require(
                is_finite,
                f"{name}{at}",
                "NaN or infinity",
                "finite numbers",
                "limit it",
            )
        highest = float(belief.log_probability.max())
        _require(
            highest <= ROUNDING,
            f"log_probability{at}",
            highest,
            "at most 0",
            "normalise it",
        )
        total = np.exp(belief.log_probability).sum(axis=1)
        worst = float(total[np.abs(total - 1).argmax()])
        is_one = abs(worst - 1) <= ROUNDING
        _require(is_one, f"sum of probabilities{at}", worst, "1", "normalise them")
        low = float(belief.severity_mean.min())
        high = float(belief.severity_mean.max())
        is_share = -ROUNDING <= low <= high <= 1 + ROUNDING
        _require(is_share, f"severity_mean{at}", (low, high), "0 to 1", "clip it")
        least = float(belief.severity_std.min())
        remedy = "give a standard deviation"
        _require(least >= 0, f"severity_std{at}", least, "from 0", remedy)


def _require_equal(
    got: np.ndarray,
    wanted: np.ndarray,
    thing: str,
    allowed: str,
    remedy: str,
    tolerance=0.0,
) -> None:
    difference = float(np.abs(got - wanted).max())
    _require(
        difference <= tolerance,
        thing,
        f"a difference of {difference:.2g}",
        allowed,
        remedy,
    )


def _check_interface(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    is_diagnoser = isinstance(diagnoser, Diagnoser)
    needed = "classes, reset and update"
    _require(is_diagnoser, "diagnoser", type(diagnoser), needed, "add them")
    names = diagnoser.classes
    has_ends = isinstance(names, tuple) and (names[:1], names[-1:]) == ((NORMAL,), (UNKNOWN,))
    is_valid = has_ends and len(set(names)) == len(names) > 2
    allowed = f"a tuple of different names, {NORMAL!r} first, {UNKNOWN!r} last"
    _require(is_valid, "classes", names, allowed, "see auv_fault_env.classes()")


def _check_arrays(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    """An update changes neither its observation nor a belief that it has returned before."""
    inputs = observations.copy()
    beliefs = []
    copies = []
    diagnoser.reset(observations.shape[1])
    for observation in inputs:
        beliefs.append(diagnoser.update(observation))
        copies.append(_stacked(beliefs[-1:]))
    thing = "observation after update"
    _require_equal(inputs, observations, thing, "an unchanged one", "work on a copy")
    thing = "belief after later updates"
    allowed = "the belief as it was returned"
    later = _stacked(beliefs)
    _require_equal(later, np.concatenate(copies), thing, allowed, "return new arrays")


def _check_repetition(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    """The same beliefs before another future, after another reset, and on each lane alone."""
    beliefs = _run(diagnoser, observations)
    past = observations[: N_SAMPLES // 2]
    others = _run(diagnoser, np.concatenate([past, past[::-1]]))[: len(past)]
    thing = "beliefs before another future"
    first = beliefs[: len(past)]
    _require_equal(first, others, thing, "the same beliefs", "use no later sample")
    again = _run(diagnoser, observations)
    allowed = "exactly those after the first"
    _require_equal(again, beliefs, "beliefs after a second reset", allowed, "reset everything")
    allowed = f"equal beliefs within {BATCH_TOLERANCE:g}"
    for lane in range(observations.shape[1]):
        of_lane = beliefs[:, :, [lane]]
        single = _run(diagnoser, observations[:, [lane]])
        thing = f"lane {lane} alone and in the batch"
        _require_equal(of_lane, single, thing, allowed, "keep lanes apart", BATCH_TOLERANCE)


def _check_channels(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    """Each channel missing (NaN) or dropped (zero) for a whole run, and all at some samples."""
    names = list(CHANNELS)
    for value, state, channels in (
        (np.nan, MISSING, names),
        (0.0, "dropped", READINGS),
    ):
        for name in channels:
            run = observations[:N_SHORT].copy()
            run[:, :, names.index(name)] = value
            _require_beliefs(diagnoser, run, f" with {name} {state}")
        run = observations[:N_SHORT].copy()
        run[::3] = value
        _require_beliefs(diagnoser, run, f" with all channels {state} every third sample")


def _check_shapes(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    n_lanes = observations.shape[1]
    for wrong in (observations[0, :-1], observations[0, :, :-1], observations[0, 0]):
        diagnoser.reset(n_lanes)
        got: str | Exception = "a belief"
        try:
            diagnoser.update(wrong)
        except ValueError:
            continue
        except Exception as error:
            got = error
        thing = f"update with an observation of shape {wrong.shape} after reset({n_lanes})"
        raise refusal(thing, got, "a ValueError", "check the shape")


def _check_storage(diagnoser: Diagnoser, observations: np.ndarray) -> None:
    if not hasattr(diagnoser, "save"):
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "diagnoser.safetensors"
        diagnoser.save(path)
        loaded = load(path)
        before = _run(diagnoser, observations[:N_SHORT])
        after = _run(loaded, observations[:N_SHORT])
    is_same = loaded.classes == diagnoser.classes
    _require(is_same, "classes after load", loaded.classes, "those saved", "save them")
    thing = "beliefs after save and load"
    _require_equal(after, before, thing, "equal beliefs", "save all that it has learnt")


Check = Callable[[Diagnoser, np.ndarray], None]
CHECKS_OF_BELIEFS: tuple[Check, ...] = (
    _check_interface,
    _require_beliefs,
    _check_arrays,
    _check_repetition,
    _check_channels,
    _check_shapes,
)
CHECKS: tuple[Check, ...] = (*CHECKS_OF_BELIEFS, _check_storage)
