"""Files that are complete at any time."""

import os
from pathlib import Path

from auv_fault_env.errors import refusal


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is complete at any time, the old or the new one."""
    aside = path.with_name(f".{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            aside.write_bytes(content)
            os.replace(aside, path)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        allowed = f"a place that can be written ({error.strerror or error})"
        raise refusal("output", str(path), allowed, "choose another --output") from None
