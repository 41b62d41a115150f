"""What an extra brings is imported where it is needed, and where it is missing the extra is named."""

import importlib
from types import ModuleType

from auv_fault_env.errors import refusal


def import_from_extra(module: str, extra: str) -> ModuleType:
    """The module; if it is not installed, a refusal that names the extra of this package that brings it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        remedy = f"pip install 'auv-fault[{extra}]'"
        raise refusal("package", module.partition(".")[0], "an installed one", remedy) from None
