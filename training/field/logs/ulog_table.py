"""Tables from the ULog files of PX4."""

import contextlib
import io
from collections.abc import Mapping
from typing import Any

from auv_fault_env.errors import InputError, refusal
from training.extras import import_from_extra
from training.field.logs.message_columns import MessageColumns, Series
from training.field.logs.table import WIDEST, Table
from training.field.logs.text_table import one_line

START = b"ULog\x01\x12\x35"
REMEDY = "write the topics of the readings as CSV: ulog2csv -m TOPIC,TOPIC"
DEEPEST = 20  # types within types
MOST_SHORT_READS = 1000


class Content(io.BytesIO):
    """The bytes of a file, for a library that reads beyond the end of a damaged one for ever."""

    def __init__(self, content: bytes):
        super().__init__(content)
        self._n_short = 0

    def read(self, size: int = -1) -> bytes:
        """Read; `EOFError` after many attempts beyond the end."""
        part = super().read(size)
        self._n_short += len(part) < size
        if self._n_short > MOST_SHORT_READS:
            raise EOFError("damaged near its end")
        return part


def ulog_table(content: bytes, log: str) -> Table:
    """Every number of every topic, a column ``topic.field`` each: ``esc_status.esc[0].esc_rpm``.

    A topic with several instances has its number: ``battery_status[1].voltage_v``. `InputError` for
    a file that is damaged from the start, and for one without numbers.
    """
    ulog = _read(content, log)
    columns = MessageColumns(log, ".", REMEDY)
    remarks = []
    for topic in ulog.data_list:
        if "timestamp" not in topic.data:
            remarks.append(f"{topic.name}: has no time; left out")
            continue
        series = Series(topic.data["timestamp"].astype("i8"))
        series.fields = {
            name: values for name, values in topic.data.items() if not name.startswith("timestamp")
        }
        columns.series[topic.name, (str(topic.multi_id),)] = series
    if ulog.file_corruption:
        remarks.append("ULog: damaged parts left out")
    if ulog.dropouts:
        duration = sum(one.duration for one in ulog.dropouts) / 1000
        remarks.append(f"ULog: the logger lost {duration:.3g} s ({len(ulog.dropouts)} dropouts)")
    return columns.table(remarks)


def _read(content: bytes, log: str) -> Any:
    core = import_from_extra("pyulog.core", "logs", "reading ULog")
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # the library prints its warnings
            head = core.ULog(Content(content), parse_header_only=True)
            _check_formats(head.message_formats, log)
            return core.ULog(Content(content))
    except InputError:
        raise
    except Exception as error:  # damage makes the library raise exceptions of any kind
        reason = one_line(error) or type(error).__name__
        raise refusal("log", log, f"a whole ULog file ({reason})", "copy it again") from None


def _check_formats(formats: Mapping[str, Any], log: str) -> None:
    """Refuse types that unfold to more columns than any table has."""

    def n_fields(name: str, depth: int) -> int:
        if depth > DEEPEST or name not in formats:
            return 1 if depth <= DEEPEST else WIDEST + 1
        fields = formats[name].fields
        counts = (max(size, 1) * n_fields(kind, depth + 1) for kind, size, _ in fields)
        return min(sum(counts), WIDEST + 1)

    for name in formats:
        if n_fields(name, 0) > WIDEST:
            got = f"{log}: topic {name}"
            raise refusal("log", got, f"at most {WIDEST} fields in a topic", REMEDY)
