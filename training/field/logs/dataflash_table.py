"""Tables from the DataFlash logs (.BIN) of ArduPilot."""

import contextlib
import io
from collections.abc import Iterator
from numbers import Real
from pathlib import Path
from typing import Any

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from training.extras import import_from_extra
from training.field.logs.message_columns import MessageColumns
from training.field.logs.table import Table
from training.field.logs.text_table import one_line

START = b"\xa3\x95"
# us per unit of the fields that hold the time
CLOCKS = {"TimeUS": 1, "TimeMS": 1000}
LATEST = 10**15  # us, 31 years: a later time is damage
INSTANCE_FIELDS = ("Instance", "Inst")  # of logs that do not say which field it is
# messages about the log itself
DESCRIPTIONS = ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "FILE")
REMEDY = "write the messages of the readings as CSV: mavlogdump.py --types TYPE --format csv"


class Complaints(io.TextIOBase):
    """A stream that keeps nothing but whether anything was written."""

    def __init__(self):
        self.any = False

    def write(self, text: str) -> int:
        """Note that there was a text."""
        self.any = True
        return len(text)


def dataflash_table(path: Path) -> Table:
    """Every number of every message, a column ``MESSAGE.Field`` each: ``BAT.Volt``, ``RCOU.C1``.

    A message with several instances has its number: ``ESC[1].RPM``. `InputError` for a file without
    numbers. What is damaged is left out.
    """
    log = printable(path.name)
    columns = MessageColumns(log, ".", REMEDY)
    complaints = Complaints()  # of the library, which prints them
    try:
        with (
            contextlib.redirect_stdout(complaints),
            contextlib.redirect_stderr(complaints),
            contextlib.closing(_reader()(str(path))) as messages,
        ):
            while (message := messages.recv_msg()) is not None:
                _add(message, columns)
    except InputError:
        raise
    except Exception as error:  # damage makes the library raise exceptions of any kind
        reason = one_line(error) or type(error).__name__
        allowed = f"a whole DataFlash log ({reason})"
        raise refusal("log", log, allowed, "copy it again") from None
    return columns.table(["DataFlash: damaged parts left out"] if complaints.any else [])


def _reader() -> type:
    """The library's reader with its index in Python: the fast one prints past `sys.stderr`."""
    library = import_from_extra("pymavlink.DFReader", "logs", "reading DataFlash logs")
    slow_index = {"init_arrays_fast": library.DFReader_binary.init_arrays}
    return type("Reader", (library.DFReader_binary,), slow_index)


def _add(message: Any, columns: MessageColumns) -> None:
    kind = message.get_type()
    fields = message.get_fieldnames()
    clock = next((name for name in CLOCKS if name in fields), None)
    if clock is None or kind in DESCRIPTIONS:
        return
    time = getattr(message, clock) * CLOCKS[clock]
    if time > LATEST:
        return
    known = (name for name in INSTANCE_FIELDS if name in fields)
    instance_field = message.fmt.instance_field or next(known, None)
    instance = str(getattr(message, instance_field)) if instance_field else ""
    if (kind, (instance,)) not in columns.series:
        units = {(kind, name): message.fmt.get_unit(name) for name in fields}
        columns.units |= units
    columns.add(kind, (instance,), time, _numbers(message, {clock, instance_field}))


def _numbers(message: Any, others: set[str | None]) -> Iterator[tuple[str, float]]:
    for name in message.get_fieldnames():
        value = getattr(message, name)
        if name not in others and isinstance(value, Real):
            yield name, float(value)
