"""The specification of an environment: what `gymnasium.make` needs to make an equal one."""

import dataclasses
from typing import Any

from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from auv_fault_env.distributions import Distribution, plain_value
from auv_fault_env.parameters import Vehicle


def plain(argument: Any) -> Any:
    """An argument of an environment as JSON has it, in a form that the environment takes too."""
    if isinstance(argument, AutoresetMode):
        return argument.value
    if isinstance(argument, Vehicle):
        return dataclasses.asdict(argument)
    if isinstance(argument, Distribution):
        return argument.plain()
    return plain_value(argument)


class WithSpec:
    """An environment whose `spec` has its arguments in their plain form."""

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What makes an equal environment; `to_json` writes it, `EnvSpec.from_json` reads it."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None):
        self._spec = spec and self._true_spec(spec)

    def _true_spec(self, spec: EnvSpec) -> EnvSpec:
        arguments = {name: plain(argument) for name, argument in spec.kwargs.items()}
        return dataclasses.replace(spec, kwargs=arguments)
