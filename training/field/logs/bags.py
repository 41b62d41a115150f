"""Bags of ROS 2 (MCAP files, rosbag2 folders and databases; ROS 1's too) as tables."""

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

TOGETHER = 20_000_000  # ns, within which messages of several topics are one row
# numbers of an array that become columns; a longer one is an image, a scan, a point cloud
LONGEST = 16
# field of a message whose stamp is passed over: the bag has one clock for all topics
HEADER = "header"


class Rows:
    """The rows of a table while a bag is read: a topic heard again begins a new one, and so does a pause."""

    def __init__(self):
        self.times = array("q")  # ns, of the first message of each row
        # rows and values
        self.series: dict[str, tuple[array, array]] = defaultdict(lambda: (array("q"), array("d")))
        self.heard: set[str] = set()
        self.left_out: Counter[str] = Counter()  # messages that could not be decoded, by topic

    def add(self, topic: str, time: int, numbers: Iterable[tuple[str, float]]) -> None:
        """Take the numbers of a message."""
        if not self.times or topic in self.heard or abs(time - self.times[-1]) > TOGETHER:
            self.times.append(time)
            self.heard.clear()
        self.heard.add(topic)
        for name, value in numbers:
            self.series[name][0].append(len(self.times) - 1)
            self.series[name][1].append(value)

    def columns(self) -> dict[str, np.ndarray]:
        """Time [s] from the first row, and every column, (n_rows,), NaN where nothing was heard."""
        times = np.frombuffer(self.times, np.int64)
        columns = {"time": (times - times[0]) * 1e-9}
        for name, (rows, values) in self.series.items():
            columns[name] = np.full(times.size, np.nan)
            columns[name][np.frombuffer(rows, np.int64)] = np.frombuffer(values)
        return columns


def read_bag(path: Path) -> Table:
    """Every number of every message, a column ``topic/field`` each.

    Fields within fields and the elements of short arrays add their names and places:
    ``/motor/port/rpm``, ``/readings/data/3``. A row is what is heard within 20 ms, of each topic
    once, NaN where it is silent. ``time`` [s] counts from the first row, by the recorder's clock. A
    message that cannot be decoded is left out and counted in the repairs.

    Raises `InputError` for what is no bag, a damaged one, and one without numbers. Misleads where
    messages were delayed on their way: the recorder's clock says when they came, not when they were
    measured.
    """
    rows = _read(Path(path))
    if not rows.series:
        raise refusal(
            "bag",
            str(path),
            "one with numbers in its messages",
            "record the topics of the readings",
        )
    repairs = (
        f"{topic}: {n} messages that cannot be decoded left out"
        for topic, n in rows.left_out.items()
    )
    return Table(rows.columns(), tuple(repairs))


def _read(path: Path) -> Rows:
    reader, typesys = (
        import_from_extra(f"rosbags.{part}", "formats") for part in ("highlevel", "typesys")
    )
    rows = Rows()
    # for old bags, which do not hold their own
    types = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with reader.AnyReader([path], default_typestore=types) as bag:
            for connection, time, data in bag.messages():
                try:
                    numbers = list(
                        _numbers(bag.deserialize(data, connection.msgtype), connection.topic)
                    )
                except Exception:  # as below
                    rows.left_out[connection.topic] += 1
                else:
                    rows.add(connection.topic, time, numbers)
    except Exception as error:  # the library meets damage with whatever exception comes of it
        reason = " ".join(str(error).split()) or type(error).__name__
        remedy = "check the path; `mcap recover` mends a file that was cut off"
        raise refusal(
            "bag", str(path), f"a whole MCAP file or rosbag2 folder ({reason})", remedy
        ) from None
    return rows


def _numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """The numbers in a message or a part of one, each with its name."""
    if isinstance(value, Real | np.bool_):
        yield name, float(value)
    elif is_dataclass(value):
        for field in fields(value):
            if field.name != HEADER:
                yield from _numbers(getattr(value, field.name), f"{name}/{field.name}")
    elif isinstance(value, np.ndarray | list) and len(value) <= LONGEST:
        for place, part in enumerate(value):
            yield from _numbers(part, f"{name}/{place}")
