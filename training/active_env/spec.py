"""The specification of an active environment: what `gymnasium.make` needs to make an equal one."""

import dataclasses

from gymnasium.envs.registration import EnvSpec

from auv_fault_env.importable import place_of
from training.active_env.diagnoser_argument import plain_diagnoser

PLAIN = {"diagnoser": plain_diagnoser, "reward": place_of}


def with_plain_arguments(spec: EnvSpec) -> EnvSpec:
    """The specification with diagnoser and reward as JSON has them, where it can have them."""
    plain = {name: of(spec.kwargs[name]) for name, of in PLAIN.items() if name in spec.kwargs}
    return dataclasses.replace(spec, kwargs=spec.kwargs | plain)
