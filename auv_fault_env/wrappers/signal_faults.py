"""Faults of single channels of the observations and actions of any environment, as data."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from auv_fault_env.faults import NORMAL
from auv_fault_env.wrappers import channels


class Kind(NamedTuple):
    """What a kind of fault changes on its channel, and how large it can be at severity 1."""

    parameter: int  # index of the parameters of a channel
    low: float
    high: float
    is_factor: bool = False  # whether its size is a factor, else a shift


LARGEST = 1e12  # in any unit
LONGEST_DELAY = 1000  # samples
_SHIFT = Kind(channels.OFFSET, -LARGEST, LARGEST)
_FACTOR = Kind(channels.GAIN, -LARGEST, LARGEST, is_factor=True)
_STUCK = Kind(channels.STUCK, 0.0, 1.0)
_DELAY = Kind(channels.DELAY, 1, LONGEST_DELAY)
OBSERVATION = "observation"
ACTION = "action"
KINDS: dict[str, dict[str, Kind]] = {
    OBSERVATION: {
        "bias": _SHIFT,
        "scale": _FACTOR,
        "noise": Kind(channels.NOISE, 0.0, LARGEST),
        "stuck": _STUCK,
        "dropout": Kind(channels.DROPOUT, 0.0, 1.0),
        "delay": _DELAY,
    },
    ACTION: {
        "gain": _FACTOR,
        "offset": _SHIFT,
        "stuck": _STUCK,
        "delay": _DELAY,
    },
}


@dataclass(frozen=True)
class SignalFault:
    """What happens to one channel at severity 1; at severity s the s-th part of it.

    | kind | at severity 1 |
    |---|---|
    | `bias`, of an action `offset` | `size` is added, in the unit of the channel |
    | `scale`, of an action `gain` | the value times `size` |
    | `noise` | normal noise of standard deviation `size`, in the unit of the channel |
    | `stuck` | the share `size` of the samples repeats the value before |
    | `dropout` | the share `size` of the samples is zero |
    | `delay` | the value of `size` samples ago; at the start of an episode the first one |

    Parameters
    ----------
    kind
        A name of the table.
    target
        ``"observation"`` or ``"action"``.
    channel
        Index of the flattened `Box`.
    size
        See the table.
    """

    kind: str
    target: str
    channel: int
    size: float

    def __post_init__(self):
        kinds = KINDS[known_name("target of a signal fault", self.target, KINDS)]
        kind = kinds[known_name(f"kind of a fault of the {self.target}", self.kind, kinds)]
        channel = whole_number(f"channel of {self.kind}", self.channel, 0)
        thing = f"size of {self.kind}"
        size = finite_in_range(thing, self.size, kind.low, kind.high)
        if kind is _DELAY and size != int(size):
            raise refusal(thing, self.size, "a whole number of samples", "round it")
        if size == self.without_effect:
            raise refusal(thing, self.size, f"other than {size:g}", "let severity 1 do something")
        object.__setattr__(self, "channel", channel)
        object.__setattr__(self, "size", size)

    @property
    def parameter(self) -> int:
        """The parameter of the channel that it changes."""
        return KINDS[self.target][self.kind].parameter

    @property
    def without_effect(self) -> float:
        """The size of a fault that changes nothing."""
        return float(KINDS[self.target][self.kind].is_factor)

    @property
    def scale(self) -> float:
        """Factor on the parameter at severity 1."""
        return self.size if KINDS[self.target][self.kind].is_factor else 1.0

    @property
    def offset(self) -> float:
        """Shift of the parameter at severity 1."""
        return 0.0 if KINDS[self.target][self.kind].is_factor else self.size


def faults_of(value: Mapping[str, SignalFault | Mapping]) -> dict[str, SignalFault]:
    """The faults by name, each one of the class or a mapping of its fields."""
    if not isinstance(value, Mapping) or not value:
        allowed = "a mapping of names to signal faults, not an empty one"
        raise refusal("faults", value, allowed, "name one fault at least")
    for name in value:
        if not isinstance(name, str) or name == NORMAL:
            raise refusal("name of a fault", name, f"text other than {NORMAL}", "rename it")
    return {name: _fault_of(name, fault) for name, fault in value.items()}


def _fault_of(name: str, value: SignalFault | Mapping) -> SignalFault:
    if isinstance(value, SignalFault):
        return value
    if not isinstance(value, Mapping):
        allowed = "a SignalFault or a mapping of its fields"
        raise refusal(f"fault {name}", value, allowed, "write one")
    names = [spec.name for spec in fields(SignalFault)]
    for field in value:
        known_name(f"field of fault {name}", field, names)
    for field in names:
        if field not in value:
            allowed = f"{', '.join(names)} given"
            raise refusal(f"fault {name}", dict(value), allowed, f"add {field!r}")
    return SignalFault(**value)
