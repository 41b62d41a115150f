"""Tables from ROS bags: MCAP files, rosbag2 folders and databases, and bags of ROS 1."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from training.extras import import_from_extra
from training.field.logs.table import Table

# ns, within which messages of several topics are one row
ROW_DURATION = 20_000_000
# numbers of an array that become columns; a longer one is an image, a scan, a point cloud
LONGEST_ARRAY = 16
# field of a message whose stamp is left out: the bag has one clock for all topics
HEADER = "header"


class BagRows:
    """Rows while a bag is read; one begins with a topic's second message, and after a pause."""

    def __init__(self):
        self.times = array("q")  # ns, of the first message of each row
        self.left_out: Counter[str] = Counter()  # messages that could not be decoded, by topic
        self._row_numbers: dict[str, array] = defaultdict(lambda: array("q"))
        self._values: dict[str, array] = defaultdict(lambda: array("d"))
        self._topics: set[str] = set()  # of the last row

    def add(self, topic: str, time: int, numbers: Iterable[tuple[str, float]]) -> None:
        """Add the numbers of a message."""
        if not self.times or topic in self._topics or abs(time - self.times[-1]) > ROW_DURATION:
            self.times.append(time)
            self._topics.clear()
        self._topics.add(topic)
        for name, value in numbers:
            self._row_numbers[name].append(len(self.times) - 1)
            self._values[name].append(value)

    def columns(self) -> dict[str, np.ndarray]:
        """Time [s] from the first row, and every column, (n_rows,); NaN without a message."""
        times = np.frombuffer(self.times, np.int64)
        columns = {"time": (times - times[0]) * 1e-9}
        for name, values in self._values.items():
            row_numbers = np.frombuffer(self._row_numbers[name], np.int64)
            columns[name] = np.full(times.size, np.nan)
            columns[name][row_numbers] = np.frombuffer(values)
        return columns

    @property
    def has_numbers(self) -> bool:
        """Whether any message held a number."""
        return bool(self._values)


def read_bag(path: Path) -> Table:
    """Every number of every message, a column ``topic/field`` each.

    Fields within fields and the elements of short arrays add their names and indices:
    ``/motor/port/rpm``, ``/readings/data/3``. A row holds the messages within 20 ms, at most one
    of each topic. ``time`` [s] counts from the first row, by the recorder's clock. A message that
    cannot be decoded is left out and counted in the remarks.

    `InputError` for what is no bag, a damaged one, and one without numbers. Misleads where messages
    were delayed: the recorder's clock says when they came, not when they were measured.
    """
    rows = _read_rows(Path(path))
    if not rows.has_numbers:
        allowed = "one with numbers in its messages"
        raise refusal("bag", str(path), allowed, "record the topics of the readings")
    remarks = tuple(
        f"{topic}: {count} messages that cannot be decoded left out"
        for topic, count in rows.left_out.items()
    )
    return Table(rows.columns(), remarks)


def _read_rows(path: Path) -> BagRows:
    highlevel = import_from_extra("rosbags.highlevel", "logs", "reading bags")
    typesys = import_from_extra("rosbags.typesys", "logs", "reading bags")
    # for old bags, which do not hold their types
    types = typesys.get_typestore(typesys.Stores.LATEST)
    rows = BagRows()
    try:
        with highlevel.AnyReader([path], default_typestore=types) as bag:
            for connection, time, data in bag.messages():
                topic = connection.topic
                try:
                    message = bag.deserialize(data, connection.msgtype)
                    numbers = list(_numbers(message, topic))
                except Exception:  # as below
                    rows.left_out[topic] += 1
                else:
                    rows.add(topic, time, numbers)
    except Exception as error:  # damage makes the library raise exceptions of any kind
        reason = " ".join(str(error).split()) or type(error).__name__
        allowed = f"a whole MCAP file or rosbag2 folder ({reason})"
        remedy = "check the path; `mcap recover` repairs a file that was cut off"
        raise refusal("bag", str(path), allowed, remedy) from None
    return rows


def _numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """The numbers in a message or in a field of one, each with its name."""
    if isinstance(value, Real | np.bool_):
        yield name, float(value)
    elif is_dataclass(value):
        for field in fields(value):
            if field.name != HEADER:
                yield from _numbers(getattr(value, field.name), f"{name}/{field.name}")
    elif isinstance(value, np.ndarray | list) and len(value) <= LONGEST_ARRAY:
        for index, element in enumerate(value):
            yield from _numbers(element, f"{name}/{index}")
