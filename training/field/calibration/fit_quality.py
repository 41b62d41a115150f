"""How well a calibration knows the vehicle, and the diagnoser that follows from that."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import InputError
from diagnosers.residuals import Residuals
from training.field.calibration.relation_fit import why_no_relations
from training.field.calibration.sensitivity import blind_residuals, described
from training.field.diagnosis.diagnosis import THRESHOLDS, beliefs, is_alarmed, persistence
from training.field.logs.log import Log
from training.field.vehicle_file import VEHICLE_DIAGNOSERS, VehicleFile

BANK = VEHICLE_DIAGNOSERS[0]
GOOD = "good"
USABLE = "usable"
POOR = "poor"
ONE_LOG = (
    "one log cannot show how far healthy missions differ, and so not how often they would alarm"
)
MORE_LOGS = "name three or more healthy logs"


class FitQuality(NamedTuple):
    """How well a calibrated vehicle is known."""

    level: str  # `GOOD`, `USABLE` or `POOR`
    diagnoser: str  # for this vehicle
    reasons: tuple[str, ...]
    remedy: str = ""  # of a poor fit, and of one to a single log
    # share of the healthy logs, of the filter bank; None for a single log
    time_in_alarm: float | None = None
    # that the relations find, relative, by residual; None without relations
    smallest_changes: Mapping[str, float] | None = None

    @property
    def line(self) -> str:
        """All of it in one line."""
        parts = [*self.reasons, self.remedy, f"diagnose uses {self.diagnoser}"]
        return f"fit: {self.level}: " + "; ".join(filter(None, parts))

    @property
    def poor_fit(self) -> str:
        """Why the fit is poor; empty for another one."""
        return "; ".join(self.reasons) if self.level == POOR else ""

    def in_doubt(self, subjects: Sequence[str]) -> "FitQuality":
        """The quality where mistakes in these are likely: the constants follow from them."""
        if not subjects:
            return self
        reason = f"likely mistakes: {', '.join(dict.fromkeys(subjects))}"
        remedy = "; ".join(filter(None, ["settle the warnings first", self.remedy]))
        return self._replace(level=POOR, reasons=(reason, *self.reasons), remedy=remedy)


def fit_quality(logs: Sequence[Log], vehicle: VehicleFile) -> FitQuality:
    """Judge a calibrated vehicle by its healthy logs.

    `GOOD` if the filter bank raises no alarm on these logs, to which its constants were fitted,
    `USABLE` if it does but the relations find changes of useful size
    (`sensitivity.LARGEST_CHANGE`), else `POOR`. After a single log it is `USABLE` at best, for
    nothing shows how far healthy missions differ.

    Misleads: the logs are those of the fit. A condition that they do not contain, such as another
    payload or colder water, can raise alarms nevertheless.
    """
    quality = _quality_on(logs, vehicle)
    if len(logs) > 1 or quality.time_in_alarm is None:
        return quality
    return quality._replace(
        level=USABLE if quality.level == GOOD else quality.level,
        reasons=(ONE_LOG, *quality.reasons[1:]),
        remedy="; ".join(filter(None, [quality.remedy, MORE_LOGS])),
        time_in_alarm=None,
    )


def _quality_on(logs: Sequence[Log], vehicle: VehicleFile) -> FitQuality:
    """The quality by these logs, however few; what the bank does on them is the first reason."""
    share, of_bank = _time_in_alarm(logs, vehicle)
    model = vehicle.relations
    changes = None if model is None else model.smallest_changes()
    if model is None:
        why, remedy = why_no_relations(logs, vehicle)
    else:
        why = f"the relations find lasting changes from: {described(changes)}"
        remedy = ""
    if share == 0.0:
        return FitQuality(GOOD, BANK, (of_bank, why), "", share, changes)
    if model is None:
        return FitQuality(POOR, BANK, (of_bank, why), remedy, share)
    blind = blind_residuals(model)
    if not blind:
        return FitQuality(USABLE, Residuals.name, (of_bank, why), "", share, changes)
    hidden = described({name: changes[name] for name in blind})
    reasons = (of_bank, f"the relations find no lasting changes below: {hidden}")
    remedy = "leave out logs that differ from the others, or log steadier legs of several speeds"
    return FitQuality(POOR, Residuals.name, reasons, remedy, share, changes)


def _time_in_alarm(logs: Sequence[Log], vehicle: VehicleFile) -> tuple[float | None, str]:
    """Share of the healthy logs in which the filter bank is in alarm, and a sentence on it.

    None if the bank cannot diagnose the vehicle.
    """
    try:
        alarmed = [
            is_alarmed(log, beliefs(log, BANK, vehicle), THRESHOLDS[BANK], persistence(vehicle))
            for log in logs
        ]
    except InputError as error:
        return None, f"the filter bank cannot diagnose the vehicle ({error})"
    share = float(np.concatenate(alarmed).mean())
    return share, f"the filter bank is in alarm for {100 * share:.3g} % of the healthy time"
