"""Logs and readings that are slower or faster than the vehicle file says."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.parameters import SAMPLE_RATE
from training.field.calibration.mistakes.finding import Finding
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

LARGEST_RATIO = 1.5  # of two rates that are called equal
LEAST_REPEATS = 50  # of a value, to know how often each one stands
REPEATED = 0.7  # share of values that stand equally often
MULTIPLES = 0.9  # share of values that stand a multiple of that
JITTER = 5  # repeats, from which one more or less is the same


def sampling_findings(logs: Sequence[Log], vehicle: VehicleFile) -> list[Finding]:
    """Findings on the rate of the logs, then on readings that are held from row to row."""
    names = [name for name in READINGS if name in vehicle.columns]
    columns = [INDEX[name] for name in names]
    rate = _rate(logs, columns)
    if rate is None:
        return []
    findings = []
    stated = min(vehicle.sample_rate, SAMPLE_RATE)
    if not 1 / LARGEST_RATIO < rate / stated < LARGEST_RATIO:
        evidence = f"the file says {vehicle.sample_rate:g} Hz, the logs have {rate:.2g} Hz"
        cause = "is it the rate of another log?"
        remedy = f"write sample_rate = {rate:.2g} in [vehicle]"
        findings.append(Finding(("sample_rate",), evidence, cause, remedy))
    for name, column in zip(names, columns, strict=True):
        count = repeats(logs, column)
        if count > 1:
            evidence = (
                f"each value stands in {count} rows, so that {rate / count:.2g} come a second"
            )
            remedy = f"leave the cells of repeated values empty in the column of [channels.{name}]"
            findings.append(
                Finding((name,), evidence, "is its sensor slower than the log?", remedy)
            )
    return findings


def _rate(logs: Sequence[Log], columns: Sequence[int]) -> float | None:
    """Rows with a reading per second; None without two."""
    n_rows = 0
    duration = 0.0
    for log in logs:
        for segment in log.segments:
            is_read = np.isfinite(log.observation[segment][:, columns]).any(axis=1)
            time = log.time[segment][is_read]
            if len(time) > 1:
                n_rows += len(time) - 1
                duration += float(time[-1] - time[0])
    return n_rows / duration if duration else None


def repeats(logs: Sequence[Log], column: int) -> int:
    """In how many rows each value stands, where a slower sensor is held; else 1.

    A coarse reading repeats itself too, but irregularly.
    """
    counts = np.concatenate([_run_lengths(log, column) for log in logs])
    if len(counts) < LEAST_REPEATS:
        return 1
    count = int(np.bincount(counts).argmax())
    slack = 1 if count >= JITTER else 0
    is_usual = np.abs(counts - count) <= slack
    is_multiple = np.abs(counts - count * np.round(counts / count)) <= slack
    is_held = is_usual.mean() >= REPEATED and is_multiple.mean() >= MULTIPLES
    return count if is_held else 1


def _run_lengths(log: Log, column: int) -> np.ndarray:
    """Lengths of the runs of equal readings, without the first and the last of each segment."""
    lengths = [np.zeros(0, int)]
    for segment in log.segments:
        values = log.observation[segment][:, column]
        values = values[np.isfinite(values)]
        lengths.append(np.diff(np.flatnonzero(np.diff(values))))
    return np.concatenate(lengths)
