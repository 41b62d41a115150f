"""Text files from outside, read whole: no device or pipe, and no more than fits."""

import os
import stat
from pathlib import Path

from auv_fault_env.errors import InputError, refusal

LARGEST = 64 << 20  # bytes


def text_of(path: Path, thing: str, allowed: str) -> str:
    """The text of a file in UTF-8; `InputError` for one that cannot be read, or is too large.

    Parameters
    ----------
    path
        Of the file. A pipe or a device is refused before it is opened, for it may never end.
    thing, allowed
        What the file is, and what it may be, for the refusal.
    """
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode):
            raise _refusal(path, thing, allowed, "name a regular file: this is none")
        with open(path, "rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            remedy = f"it has more than {LARGEST >> 20} MiB: name another file"
            raise _refusal(path, thing, allowed, remedy)
        return content.decode("utf-8-sig")
    except OSError as error:
        raise _refusal(path, thing, allowed, f"check the path ({error.strerror})") from None
    except UnicodeDecodeError:
        raise _refusal(path, thing, allowed, "save it as UTF-8") from None
    except InputError:
        raise
    except ValueError as error:  # a null in the path
        raise _refusal(path, thing, allowed, f"check the path ({error})") from None


def _refusal(path: Path, thing: str, allowed: str, remedy: str) -> InputError:
    return refusal(thing, str(path), allowed, remedy)
