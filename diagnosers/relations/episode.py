"""The windows of a whole episode at once."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from diagnosers.relations.windows import (
    Layout,
    Typical,
    Windows,
    is_steady,
    is_under_way,
    windows_of,
)

AT_ONCE = 1000  # windows that are made together, which bounds the memory


class EpisodeWindows(NamedTuple):
    """The windows of an episode, a second apart, under way."""

    windows: Windows
    is_steady: np.ndarray  # (n,)
    last: np.ndarray  # (n,), index of the last row of each


def episode_windows(
    rows: np.ndarray, layout: Layout, typical: Mapping[str, Typical]
) -> EpisodeWindows:
    """The windows of an episode's rows (n_rows, n_channels), in which all gaps are filled."""
    index = np.arange(len(rows))
    command = rows[:, INDEX["mission_speed"]]
    is_new = np.concatenate([[True], command[1:] != command[:-1]])[: len(rows)]
    held = index - np.maximum.accumulate(np.where(is_new, index, 0))
    last_at_rest = np.maximum.accumulate(np.where(is_under_way(rows), -1, index))
    is_due = (index - last_at_rest >= layout.n_rows) & ((index + 1) % layout.every == 0)
    last = np.flatnonzero(is_due)
    offsets = np.arange(1 - layout.n_rows, 1)
    parts = [
        windows_of(rows[last[k : k + AT_ONCE, None] + offsets], layout, typical)
        for k in range(0, max(len(last), 1), AT_ONCE)
    ]
    return EpisodeWindows(joined(parts), is_steady(held[last], layout), last)


def joined(parts: Sequence[Windows]) -> Windows:
    """The windows of all parts, in their order."""

    def together(values: Sequence) -> np.ndarray | dict[str, np.ndarray]:
        if isinstance(values[0], dict):
            return {name: together([part[name] for part in values]) for name in values[0]}
        return np.concatenate(values)

    return Windows(*map(together, zip(*parts, strict=True)))
