"""Tables from logs of MAVLink (.tlog): each frame behind its time."""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

from auv_fault_env.printable import printable
from training.extras import import_from_extra
from training.field.logs.message_columns import MessageColumns
from training.field.logs.table import Table

STAMP = 8  # bytes, us since 1970, the highest first
STAMPS = (946_684_800_000_000, 4_102_444_800_000_000)  # us, the years 2000 to 2100
# bytes around the payload of a frame, by its first byte
OVERHEAD = {0xFE: 8, 0xFD: 12}
SIGNATURE = 13  # bytes
IS_SIGNED = 1  # flag
BLOCK = 1 << 20  # bytes read at once
LONGEST_FRAME = STAMP + 12 + 255 + SIGNATURE  # bytes
UNKNOWN = {"uint16_t": 0xFFFF, "uint32_t": 0xFFFF_FFFF}  # values that mean: not measured
REMEDY = "write the messages of the readings as CSV: mavlogdump.py --types TYPE --format csv"


def is_tlog(start: bytes) -> bool:
    """Whether a file begins with a time and a frame of MAVLink."""
    stamp = int.from_bytes(start[:STAMP], "big")
    return len(start) > STAMP and start[STAMP] in OVERHEAD and STAMPS[0] < stamp < STAMPS[1]


def tlog_table(path: Path) -> Table:
    """Every number of every message, a column ``MESSAGE.field`` each: ``VFR_HUD.groundspeed``.

    Messages of several senders, or with a number of their own, have it: ``BATTERY_STATUS[1]``.
    `InputError` for a file without numbers. What is damaged is left out and counted.
    """
    columns = MessageColumns(printable(path.name), ".", REMEDY)
    left_out: Counter[str] = Counter()
    with path.open("rb") as file:
        for time, frame in _frames(file, left_out):
            if not add_frame(frame, time, columns):
                left_out["frames that are damaged or of an unknown kind"] += 1
    remarks = [f"MAVLink: {what} left out ({count})" for what, count in left_out.items()]
    return columns.table(remarks)


def _frames(file: BinaryIO, left_out: Counter[str]) -> Iterator[tuple[int, bytes]]:
    """Time [us] and bytes of each frame; bytes between frames are passed over."""
    buffer = b""
    place = 0
    while True:
        if len(buffer) - place < LONGEST_FRAME:
            buffer = buffer[place:] + file.read(BLOCK)
            place = 0
        if len(buffer) - place <= STAMP:
            return
        size = frame_size(buffer[place + STAMP : place + LONGEST_FRAME])
        if not is_tlog(buffer[place : place + STAMP + 1]) or not size:
            left_out["bytes between the frames"] += 1
            place += 1
            continue
        stamp = int.from_bytes(buffer[place : place + STAMP], "big")
        yield stamp, buffer[place + STAMP : place + STAMP + size]
        place += STAMP + size


def frame_size(start: bytes) -> int:
    """Bytes of the frame that begins here; 0 where none is whole."""
    if len(start) < 3 or start[0] not in OVERHEAD:
        return 0
    is_signed = start[0] == 0xFD and start[2] & IS_SIGNED
    size = OVERHEAD[start[0]] + start[1] + (SIGNATURE if is_signed else 0)
    return size if size <= len(start) else 0


def add_frame(frame: bytes, time: int, columns: MessageColumns) -> bool:
    """Add the numbers of a frame [us]; returns whether it could be decoded."""
    try:
        message = _decoder().decode(bytearray(frame))
    except (_dialect().MAVError, ValueError, LookupError):
        return False
    kind = message.get_type()
    number = getattr(message, message.instance_field) if message.instance_field else ""
    sender = f"{message.get_srcSystem()}.{message.get_srcComponent()}"
    instance = (sender, str(number))
    if (kind, instance) not in columns.series:
        columns.units |= units_of(kind)
    columns.add(kind, instance, time, _numbers(message))
    return True


def units_of(kind: str) -> dict[tuple[str, str], str]:
    """The units of a message's fields by its name and theirs, as the standard names them."""
    message = _kinds().get(kind)
    if message is None:
        return {}
    return {(kind, field): unit for field, unit in message.fieldunits_by_name.items()}


def _numbers(message: Any) -> Iterator[tuple[str, float]]:
    for field, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        value = getattr(message, field)
        unknown = UNKNOWN.get(kind)
        if field == message.instance_field or isinstance(value, str | bytes):
            continue
        elements = enumerate(value) if isinstance(value, list) else [(None, value)]
        for k, element in elements:
            name = field if k is None else f"{field}[{k}]"
            yield name, float("nan") if element == unknown else float(element)


@cache
def _dialect() -> Any:
    return import_from_extra("pymavlink.dialects.v20.ardupilotmega", "logs", "reading MAVLink")


@cache
def _decoder() -> Any:
    return _dialect().MAVLink(None)


@cache
def _kinds() -> dict[str, Any]:
    return {message.msgname: message for message in _dialect().mavlink_map.values()}
