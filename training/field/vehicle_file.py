"""The vehicle file (TOML, docs/vehicle.md): the columns of a vehicle's logs, and the vehicle."""

import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.parameters import HULL, PRESETS, SHAFT, Vehicle, vehicle_of
from auv_fault_env.text_files import text_of
from diagnosers.relations.model import RelationModel
from diagnosers.relations.table import KEYS, as_table, from_table
from diagnosers.residuals import Residuals
from training.field.units import UNITS, factor

QUANTITIES = {spec.name: spec.metadata for spec in fields(Vehicle) if spec.metadata}
# the constant of the vehicle that full scales grow with, by unit
MAXIMA = {
    "m/s": "maximum_speed",
    "V": "maximum_voltage",
    "A": "maximum_current",
    "rpm": "maximum_rpm",
}
BAND: Mapping[str, float] = MappingProxyType(
    {name: QUANTITIES[name]["band"] for name in (*HULL, *SHAFT)}
)
NOISE: Mapping[str, float] = MappingProxyType({name: CHANNELS[name].noise for name in READINGS})
# diagnosers that take the parameters of a vehicle file
VEHICLE_DIAGNOSERS = (
    "filter_bank",
    "integrated",
    "cusum",
    "rules",
    "limits",
    "kalman_network",
)
DIAGNOSERS = (*VEHICLE_DIAGNOSERS, Residuals.name)
GENERAL = {
    "name": "",
    "preset": "",
    "shafts": "",
    "sample_rate": "Hz",
    "hotel_load": "W",
    "battery": "Wh",
    "diagnoser": "",
    "poor_fit": "",
}
# as in `VehicleFile`
VEHICLE_KEYS = ("sample_rate", "hotel_load", "battery", "diagnoser", "poor_fit")
TABLES = ("vehicle", "parameters", "healthy_band", "noise", "time", "channels", "relations")
COLUMN = ("column", "unit", "scale", "offset", "times")


class Column(NamedTuple):
    """A column of the log: reading in the channel's unit = scale * column + offset.

    With `times`, that is multiplied by another column, as a duty by the supply's voltage.
    """

    name: str
    scale: float = 1.0
    offset: float = 0.0
    times: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns that are read."""
        return (self.name,) if self.times is None else (self.name, self.times)


@dataclass(frozen=True)
class VehicleFile:
    """The content of a vehicle file; an unknown or impossible value is an `InputError`.

    A vehicle with one shaft has the channels of port only. ``vehicle.beta`` is the thrust of all
    shafts together, and hotel load and battery are the whole vehicle's.

    Attributes
    ----------
    vehicle
        Its nominal constants and its number of shafts.
    columns
        By channel of `CHANNELS`; a channel that is not here does not exist on the vehicle.
    time
        Column of the time, in seconds; None if the rows are ``1/sample_rate`` apart.
    sample_rate
        Of the log [Hz], 0.5 to 10,000.
    band
        Half-width of the healthy band, relative, by parameter of `HULL` and `SHAFT`; by default
        `BAND`.
    noise
        Standard deviation by reading, in the channel's unit; by default `NOISE`.
    hotel_load, battery
        Power of all but propulsion [W]; charge of the full battery [Wh], 0 if not known.
    diagnoser
        What `diagnose` uses unless another is named, of `DIAGNOSERS`; calibration chooses it.
    relations
        Of its readings on healthy logs, for the diagnoser `residuals`; None before calibration.
    poor_fit
        Why the calibration calls its fit poor, of which `diagnose` warns; empty otherwise.
    """

    vehicle: Vehicle
    columns: Mapping[str, Column]
    time: Column | None = None
    sample_rate: float = 10.0
    band: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    hotel_load: float = 0.0
    battery: float = 0.0
    diagnoser: str = VEHICLE_DIAGNOSERS[0]
    relations: RelationModel | None = None
    poor_fit: str = ""

    def __post_init__(self):
        _check_channels(self.columns, self.shafts)
        for channel, column in self.columns.items():
            _check_column(f"channels.{channel}", column)
        if self.time is not None:
            _check_column("time", self.time)
            if self.time.times is not None:
                remedy = "leave it out"
                raise refusal("time.times", self.time.times, "no factor of the time", remedy)
        _check_numbers("healthy_band", self.band, dict.fromkeys(BAND, 0.9))
        ranges = {name: CHANNELS[name].high - CHANNELS[name].low for name in NOISE}
        _check_numbers("noise", self.noise, ranges)
        finite_in_range("sample_rate [Hz]", self.sample_rate, 0.5, 1e4)
        finite_in_range("hotel_load [W]", self.hotel_load, 0.0, 1e6)
        finite_in_range("battery [Wh]", self.battery, 0.0, 1e9)
        known_name("diagnoser", self.diagnoser, DIAGNOSERS)
        if not isinstance(self.poor_fit, str):
            raise refusal("poor_fit", self.poor_fit, "a text", "calibrate the vehicle again")
        object.__setattr__(self, "band", {**BAND, **self.band})
        object.__setattr__(self, "noise", {**NOISE, **self.noise})

    @property
    def shafts(self) -> int:
        """Number of shafts of the vehicle, 1 or 2."""
        return self.vehicle.shafts


def _check_channels(columns: Mapping[str, Column], shafts: int) -> None:
    for channel in columns:
        known_name("key of [channels]", channel, CHANNELS)
        if shafts == 1 and channel.startswith("starboard"):
            allowed = "those of the port side, with shafts = 1"
            raise refusal("channels", channel, allowed, "rename it or set shafts = 2")
    if not set(columns) & set(READINGS):
        allowed = "at least one of " + ", ".join(READINGS)
        raise refusal("channels", list(columns), allowed, "add [channels.speed]")


def _check_column(where: str, column: Column) -> None:
    for key, name in zip(("column", "times"), column.names, strict=False):
        if not isinstance(name, str) or not name:
            allowed = "a name of the log's header"
            raise refusal(f"{where}.{key}", name, allowed, "name the column")
    finite_in_range(f"{where}.offset", column.offset, -1e12, 1e12)
    if not finite_in_range(f"{where}.scale", column.scale, -1e9, 1e9):
        remedy = "write the factor to the channel's unit"
        raise refusal(f"{where}.scale", column.scale, "a number other than 0", remedy)


def _check_numbers(table: str, numbers: Mapping[str, float], highest: Mapping[str, float]) -> None:
    for name, value in numbers.items():
        key = known_name(f"key of [{table}]", name, highest)
        finite_in_range(f"{table}.{key}", value, 0.0, highest[name])


def read_vehicle(path: Path) -> VehicleFile:
    """The vehicle of a TOML file; `InputError` for unknown, missing or impossible values."""
    content = _content(path)
    for name in content:
        known_name("table of the vehicle file", name, TABLES)
    general = _table(content, "vehicle", GENERAL)
    if "sample_rate" not in general:
        raise refusal(
            "vehicle file",
            str(path),
            "one with sample_rate [Hz] in [vehicle]",
            "add it",
        )
    channels = _table(content, "channels", CHANNELS)
    columns = {
        name: _column(f"channels.{name}", entry, CHANNELS[name].unit)
        for name, entry in channels.items()
    }
    relations = _table(content, "relations", KEYS)
    return VehicleFile(
        vehicle=_vehicle(general, _table(content, "parameters", QUANTITIES)),
        columns=columns,
        time=_column("time", content["time"], "s") if "time" in content else None,
        band=_table(content, "healthy_band", BAND),
        noise=_table(content, "noise", NOISE),
        relations=from_table(relations) if relations else None,
        **{key: general[key] for key in VEHICLE_KEYS if key in general},
    )


def _content(path: Path) -> dict[str, Any]:
    text = text_of(path, "vehicle file", "a readable TOML file")
    try:
        return tomllib.loads(text)
    # ValueError also for a number of thousands of digits
    except (ValueError, RecursionError) as error:
        remedy = f"correct it: {error}"
    raise refusal("vehicle file", str(path), "a readable TOML file", remedy) from None


def _table(content: Mapping[str, Any], name: str, keys: Iterable[str]) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise refusal(name, table, f"a table [{name}]", "give it keys of its own")
    for key in table:
        known_name(f"key of [{name}]", key, keys)
    return table


def _vehicle(general: Mapping[str, Any], parameters: Mapping[str, Any]) -> Vehicle:
    default = next(iter(PRESETS))
    preset = vehicle_of(known_name("preset", general.get("preset", default), PRESETS))
    name = general.get("name", preset.name)
    if not isinstance(name, str) or not name:
        raise refusal("name of the vehicle", name, "a text", "name it")
    shafts = general.get("shafts", preset.shafts)
    return replace(preset, name=name, shafts=shafts, **parameters)


def _column(where: str, entry: Any, kind: str) -> Column:
    entry = _table({where: entry}, where, COLUMN)
    scale = finite_in_range(f"{where}.scale", entry.get("scale", 1.0), -1e9, 1e9)
    unit = factor(f"{where}.unit", entry.get("unit", kind), kind)
    offset = entry.get("offset", 0.0)
    return Column(entry.get("column"), unit * scale, offset, entry.get("times"))


def write_vehicle(
    path: Path,
    vehicle: VehicleFile,
    comments: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the file, which `read_vehicle` reads as an equal vehicle; one that exists is replaced.

    A comment at the end of a line is found by table and key: ``{"channels.speed.column": "why"}``.
    """
    write_text(path, as_toml(vehicle, comments))


def write_text(path: Path, text: str) -> None:
    """Write the text of a vehicle file; one that exists is replaced."""
    path = Path(path)
    aside = path.with_name(f".{path.name}")
    try:
        aside.write_text(text, encoding="utf-8")
        aside.replace(path)
    except OSError as error:
        with suppress(OSError):
            aside.unlink()
        allowed = f"a place that can be written ({error.strerror or error})"
        raise refusal("vehicle file", str(path), allowed, "choose another place") from None


def as_toml(vehicle: VehicleFile, comments: Mapping[str, str] = MappingProxyType({})) -> str:
    """The text of the file: changes from the nearest preset, with units and comments."""
    changes = {
        preset.name: _changed(_constants(vehicle.vehicle), _constants(preset))
        for preset in PRESETS.values()
    }
    preset = min(changes, key=lambda name: len(changes[name]))
    general = {key: getattr(vehicle, key) for key in ("shafts", *VEHICLE_KEYS)}
    if not vehicle.poor_fit:
        del general["poor_fit"]
    tables = {
        "vehicle": {"name": vehicle.vehicle.name, "preset": preset} | general,
        "parameters": changes[preset],
        "healthy_band": _changed(vehicle.band, BAND),
        "noise": _changed(vehicle.noise, NOISE),
        "time": {} if vehicle.time is None else _entry(vehicle.time, "s"),
    }
    for name, column in vehicle.columns.items():
        tables[f"channels.{name}"] = _entry(column, CHANNELS[name].unit)
    if vehicle.relations is not None:
        tables["relations"] = as_table(vehicle.relations)
    texts = [_text(name, table, comments) for name, table in tables.items() if table]
    return "\n".join(texts)


def _constants(vehicle: Vehicle) -> dict[str, float]:
    return {name: getattr(vehicle, name) for name in QUANTITIES}


def _changed(values: Mapping[str, float], usual: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if value != usual[name]}


def unit_of(column: Column, kind: str) -> str:
    """The unit that is the column's scale, apart from the sign; else that of the channel."""
    units = UNITS[kind].items()
    return next((name for name, factor in units if factor == abs(column.scale)), kind)


def _entry(column: Column, kind: str) -> dict[str, str | float]:
    unit = unit_of(column, kind)
    entry = {"column": column.name, "unit": unit}
    scale = column.scale / UNITS[kind][unit]
    if scale != 1.0:
        entry["scale"] = scale
    if column.offset != 0.0:
        entry["offset"] = column.offset
    if column.times is not None:
        entry["times"] = column.times
    return entry


def _text(name: str, table: Mapping[str, Any], comments: Mapping[str, str]) -> str:
    lines = [f"[{name}]"]
    for key, value in table.items():
        notes = "; ".join(filter(None, (_about(name, key), comments.get(f"{name}.{key}"))))
        comment = " ".join(notes.split())
        lines.append(f"{key} = {_literal(value)}" + (f"  # {comment}" if comment else ""))
    return "\n".join(lines) + "\n"


def _about(table: str, key: str) -> str:
    if table == "parameters":
        return f"{QUANTITIES[key]['unit']}: {QUANTITIES[key]['about']}"
    if table == "healthy_band":
        return "relative half-width"
    return CHANNELS[key].unit if table == "noise" else GENERAL.get(key, "")


def _literal(value: Any) -> str:
    if isinstance(value, Mapping):
        entries = (f"{key} = {_literal(one)}" for key, one in value.items())
        return "{ " + ", ".join(entries) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(_literal, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value) if isinstance(value, int) else repr(float(value))
