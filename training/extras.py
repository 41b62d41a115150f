"""Optional packages: imported where they are needed, or refused with the extra to install."""

import importlib
from types import ModuleType

from auv_fault_env.errors import refusal


def import_from_extra(module: str, extra: str) -> ModuleType:
    """The module; refused with the name of the extra if it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError:
        remedy = f"pip install 'auv-fault[{extra}]'"
        raise refusal("package", module.partition(".")[0], "an installed one", remedy) from None
