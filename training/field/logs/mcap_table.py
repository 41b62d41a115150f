"""Tables from MCAP files that are no ROS bags: messages in JSON, and frames of MAVLink."""

import json
from collections import Counter
from collections.abc import Iterator
from numbers import Real
from pathlib import Path
from typing import Any

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from training.extras import import_from_extra
from training.field.logs import limits
from training.field.logs.bags import LONGEST_ARRAY, read_bag
from training.field.logs.limits import check_content
from training.field.logs.mavlink_table import OVERHEAD, add_frame, frame_size, units_of
from training.field.logs.message_columns import MessageColumns
from training.field.logs.table import Table
from training.field.logs.text_table import one_line

START = b"\x89MCAP"
ROS_PROFILES = ("ros1", "ros2")
DEEPEST = 20  # values within values
MAVLINK_KEYS = {"header", "message"}  # of a message of MAVLink in JSON
SMALLER_CHUNKS = "write it again with smaller chunks: mcap recover --chunk-size"


def mcap_table(path: Path) -> Table:
    """Every number of every message, a column ``topic/field`` each.

    A message of MAVLink in JSON has its fields alone, ``mavlink/1/1/VFR_HUD/groundspeed``; a frame
    of MAVLink has the name of its message, ``VFR_HUD/groundspeed``. A topic in another encoding is
    left out by name. `time` [s] counts from the first message, by the recorder's clock. A ROS bag
    is read by `read_bag`.
    """
    if _profile(path) in ROS_PROFILES:
        return read_bag(path)
    log = printable(path.name)
    columns = MessageColumns(log, "/")
    left_out: Counter[str] = Counter()
    remarks = []
    try:
        for channel, message in _messages(path, log):
            time = message.log_time // 1000
            if channel.message_encoding == "json":
                is_read = _add_json(channel.topic, time, message.data, columns)
            else:
                is_read = _is_frame(message.data) and add_frame(message.data, time, columns)
            if not is_read:
                left_out[f"{channel.topic} in {channel.message_encoding or 'no encoding'}"] += 1
    except InputError:
        raise
    except Exception as error:  # damage makes the library raise exceptions of any kind
        reason = one_line(error) or type(error).__name__
        if not columns.series:
            allowed = f"a whole MCAP file ({reason})"
            remedy = "`mcap recover` repairs a file that was cut off"
            raise refusal("bag", str(path), allowed, remedy) from None
        remarks.append(f"MCAP: breaks off; the messages before are read ({reason})")
    remarks += [f"{topic}: messages left out ({count})" for topic, count in left_out.items()]
    if not columns.series and left_out:
        allowed = "messages of ROS 2, or in JSON, or frames of MAVLink"
        got = f"{log}: {', '.join(left_out)}"
        raise refusal("log", got, allowed, "export the topics of the readings as CSV")
    return columns.table(remarks)


def _profile(path: Path) -> str:
    """The profile that the file names; that of ROS 2 where it cannot be read."""
    reader = import_from_extra("mcap.reader", "logs", "reading MCAP")
    try:
        with path.open("rb") as file:
            return reader.make_reader(file).get_header().profile
    except Exception:  # damage makes the library raise exceptions of any kind
        return "ros2"


def _messages(path: Path, log: str) -> Iterator[tuple[Any, Any]]:
    """Every message with its channel; refused before a chunk is unpacked that fills the memory."""
    stream = import_from_extra("mcap.stream_reader", "logs", "reading MCAP")
    records = import_from_extra("mcap.records", "logs", "reading MCAP")
    channels = {}
    with path.open("rb") as file:
        limit = limits.LARGEST_CONTENT
        reader = stream.StreamReader(file, emit_chunks=True, record_size_limit=limit)
        for record in reader.records:
            parts = [record]
            if isinstance(record, records.Chunk):
                check_content(log, record.uncompressed_size, SMALLER_CHUNKS)
                parts = stream.breakup_chunk(record)
            for part in parts:
                if isinstance(part, records.Channel):
                    channels[part.id] = part
                elif isinstance(part, records.Message):
                    yield channels[part.channel_id], part


def _is_frame(data: bytes) -> bool:
    return data[:1] in {bytes([mark]) for mark in OVERHEAD} and frame_size(data) == len(data)


def _add_json(topic: str, time: int, data: bytes, columns: MessageColumns) -> bool:
    """Add the numbers of a message in JSON; returns whether it could be decoded."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return False
    if isinstance(value, dict) and MAVLINK_KEYS <= value.keys():
        value = value["message"]
        kind = value.get("type") if isinstance(value, dict) else None
        if isinstance(kind, str) and (topic, ("",)) not in columns.series:
            units = units_of(kind)
            columns.units |= {(topic, field): unit for (_, field), unit in units.items()}
    columns.add(topic, ("",), time, _numbers(value, "", DEEPEST))
    return True


def _numbers(value: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """The numbers in a message or in a field of one, each with its name."""
    if isinstance(value, Real):
        yield name or "value", float(value)
    elif isinstance(value, dict) and depth:
        for field, element in value.items():
            yield from _numbers(element, f"{name}/{field}" if name else field, depth - 1)
    elif isinstance(value, list) and depth and len(value) <= LONGEST_ARRAY:
        for index, element in enumerate(value):
            yield from _numbers(element, f"{name}/{index}" if name else str(index), depth - 1)
