"""Optional packages: imported where they are needed, or refused with the extra to install."""

import importlib
from types import ModuleType

from auv_fault_env.errors import InputError
from auv_fault_env.printable import printable


def import_from_extra(module: str, extra: str, user: str) -> ModuleType:
    """The module; refused if it cannot be imported, with who needs it and the extra to install.

    `user` begins the sentence: ``"reading bags"``.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ImportError as error:
        absent = error.name if isinstance(error, ModuleNotFoundError) else None
        is_missing = absent is not None and absent.partition(".")[0] == package
        reason = "" if is_missing else f", whose import fails ({error})"
        sentence = f"{user} needs {package}{reason}: pip install 'auv-fault[{extra}]'"
        raise InputError(printable(sentence)) from None
