"""What an environment draws at the start of an episode, and how JSON has it."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, Self

import numpy as np

from auv_fault_env.errors import known_name, refusal
from auv_fault_env.importable import found
from auv_fault_env.noise import STREAMS

TYPE = "type"  # the entry of the plain form that names the class
CHECKED_KEYS = np.arange(1, 9, dtype=np.uint64)  # noise keys of the lanes of a check


class Distribution:
    """A distribution of schedules or missions: a frozen dataclass whose fields JSON can have.

    It depends on a lane's noise key alone, so that a seed means the same episode in any company.
    """

    def plain(self) -> dict[str, Any]:
        """The class, as ``module:name``, and the fields that differ from their defaults."""
        plain = {TYPE: f"{type(self).__module__}:{type(self).__qualname__}"}
        for spec in fields(self):
            value = plain_value(getattr(self, spec.name))
            if value != plain_value(_usual(spec)):
                plain[spec.name] = value
        return plain

    @classmethod
    def of(cls, value: Self | Mapping[str, Any] | None, usual: type[Self]) -> Self:
        """The distribution itself, that of its plain form, or by default one of the `usual` class.

        Without a `type` the plain form is one of the `usual` class.
        """
        if value is None:
            return usual()
        if isinstance(value, cls):
            _check_class(type(value))
            return value
        if not isinstance(value, Mapping):
            allowed = f"a {cls.__name__} or a mapping of its fields"
            raise refusal("distribution", value, allowed, "give one, or None for the usual one")
        given = dict(value)
        name = given.pop(TYPE, None)
        kind = usual if name is None else _class_of(name, cls)
        for field in given:
            known_name(f"field of {kind.__name__}", field, [spec.name for spec in fields(kind)])
        return kind(**given)


def plain_value(value: Any) -> Any:
    """The value with Python's numbers and lists in place of NumPy's, which JSON does not have."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: plain_value(entry) for name, entry in value.items()}
    if type(value) in (list, tuple):
        return type(value)(map(plain_value, value))
    return value


def generators_of(key: np.ndarray, stream: str) -> list[np.random.Generator]:
    """A generator for each noise key (n_lanes,), of one of the `STREAMS`."""
    return [np.random.default_rng([int(of_lane), STREAMS[stream]]) for of_lane in key]


def _usual(spec: Field) -> Any:
    """The default of a field, None without one."""
    if spec.default_factory is not MISSING:
        return spec.default_factory()
    return None if spec.default is MISSING else spec.default


def _class_of(name: Any, base: type[Distribution]) -> type[Distribution]:
    """The class behind ``module:name``."""
    kind = found("type of the distribution", name)
    if not (isinstance(kind, type) and issubclass(kind, base)):
        allowed = f"a subclass of {base.__name__}"
        raise refusal("type of the distribution", name, allowed, "name one")
    _check_class(kind)
    return kind


def _check_class(kind: type[Distribution]) -> None:
    """Refuse a class whose instances JSON cannot have."""
    if not is_dataclass(kind) or not kind.__dataclass_params__.frozen:
        allowed = "a frozen dataclass"
        raise refusal("class of the distribution", kind.__name__, allowed, "decorate it")
