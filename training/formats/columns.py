"""The columns of simulated data sets with type, unit and meaning, as schemas of Arrow.

Every field carries its unit and description as metadata; the data dictionary is made from these.
"""

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path

import pyarrow as pa

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import PARAMETERS, SIDES
from auv_fault_env.truth import STATE

DICTIONARY = "dictionary.csv"
UNIT = "unit"
DESCRIPTION = "description"
COLUMNS = ("table", "column", "type", UNIT, DESCRIPTION)  # of the data dictionary
NUMBER = pa.int32()
SEED = pa.int64()
VALUE = pa.float32()
EXACT = pa.float64()  # of times, so that samples compare with onsets
NAME = pa.dictionary(pa.int32(), pa.string())
# in the words of numpy
TYPE_NAMES = {NUMBER: "int32", SEED: "int64", VALUE: "float32", EXACT: "float64", NAME: "string"}
# what faults of hull and shafts change; those of the sensors are not in the tables
PLANT_PARAMETERS = tuple(name for name in PARAMETERS if not name.startswith(tuple(CHANNELS)))


def _field(name: str, kind: pa.DataType, unit: str, description: str) -> pa.Field:
    return pa.field(name, kind, metadata={UNIT: unit, DESCRIPTION: description})


def _state_field(name: str) -> pa.Field:
    if name == "disturbance":
        about = "acceleration of the hull by the water"
        return _field("truth_disturbance", VALUE, "m/s^2", about)
    about = f"what the reading {name} would be with a perfect sensor"
    return _field(f"truth_{name}", VALUE, CHANNELS[name].unit, about)


def _parameter_field(name: str) -> pa.Field:
    spec = PARAMETERS[name]
    # what stands behind a comma concerns the vehicle's constant, not that of one shaft
    about = spec.about.partition(",")[0]
    side = next((side for side in SIDES if name.startswith(side)), None)
    place = f"{about} of {side}" if side else about
    return _field(f"truth_{name}", VALUE, spec.unit, f"{place}, faults included")


VEHICLE = (
    _field("vehicle", NUMBER, "", "number of the vehicle in this data set, from 0"),
    _field("seed", SEED, "", "seed of its episode"),
)
EPISODES = pa.schema(
    [
        *VEHICLE,
        _field("time", EXACT, "s", "end of the sample, from the start of the episode"),
        *(_field(name, VALUE, spec.unit, spec.about) for name, spec in CHANNELS.items()),
        _field("truth_label", NAME, "", "diagnosis class of the most severe fault, or normal"),
        _field("truth_severity", VALUE, "1", "its severity, at the start of the sample"),
        _field("truth_onset", EXACT, "s", "onset of the first fault, infinite without one"),
        _field("truth_reward", VALUE, "1", "reward of the environment for the sample"),
        _field("truth_energy", VALUE, "J", "electrical energy of the motors in the sample"),
        *map(_state_field, STATE),
        *map(_parameter_field, PLANT_PARAMETERS),
    ],
    {DESCRIPTION: "One row per vehicle and sample; truth_ is for scoring only."},
)
PROFILE = (
    _field("onset", EXACT, "s", "when the fault begins"),
    _field("end", EXACT, "s", "when it is repaired, infinite if never"),
    _field("severity", EXACT, "1", "full severity, 0 to 1"),
    _field("ramp", EXACT, "s", "time from the onset in which the severity grows linearly from 0"),
    _field("period", EXACT, "s", "of an intermittent fault, from the onset on; 0 if permanent"),
    _field("duty", EXACT, "1", "share of each period, from its start, with the fault present"),
)
EVENTS = pa.schema(
    [
        *VEHICLE,
        _field("event", NUMBER, "", "number of the event in the vehicle's schedule, from 0"),
        _field("fault", NAME, "", "name of the fault in the catalogue"),
        _field("class", NAME, "", "its diagnosis class, as in truth_label"),
        _field("component", NAME, "", "the part that fails"),
        *PROFILE,
    ],
    {DESCRIPTION: "One row per fault event; vehicles without one have no row."},
)
TABLES: Mapping[str, pa.Schema] = {"episodes": EPISODES, "events": EVENTS}


def text_of(field: pa.Field, key: str) -> str:
    """The unit or the description of a field."""
    return field.metadata[key.encode()].decode()


def dictionary_rows() -> Iterator[list[str]]:
    """The rows of the data dictionary, as `COLUMNS`."""
    for table, schema in TABLES.items():
        for field in schema:
            words = text_of(field, UNIT), text_of(field, DESCRIPTION)
            yield [table, field.name, TYPE_NAMES[field.type], *words]


def write_dictionary(folder: Path) -> None:
    """Write the data dictionary beside the tables."""
    with (folder / DICTIONARY).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(dictionary_rows())
