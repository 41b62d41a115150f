"""What is no text file of a sensible size is refused in one line, and never waited for."""

import os
from pathlib import Path

import pytest

from auv_fault_env import text_files
from auv_fault_env.errors import InputError
from auv_fault_env.schedules import load_schedule
from auv_fault_env.text_files import text_of

DEVICE = Path("/dev/zero")


def made(folder, kind):
    path = folder / "file"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to(DEVICE)
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "long name":
        path = folder / (300 * "n")
    elif kind == "null":
        path = folder / "a\0b"
    elif kind == "Latin-1":
        path.write_bytes("Höhe".encode("latin-1"))
    return path


@pytest.mark.skipif(not DEVICE.exists(), reason="no such devices")
@pytest.mark.parametrize(
    ("kind", "remedy"),
    [
        ("pipe", "name a regular file"),
        ("device", "name a regular file"),
        ("folder", "name a regular file"),
        ("loop", "symbolic links"),
        ("long name", "name too long"),
        ("null", "null"),
        ("absent", "No such file"),
        ("Latin-1", "save it as UTF-8"),
    ],
)
def test_refused(tmp_path, kind, remedy):
    path = made(tmp_path, kind)
    for read in (lambda: text_of(path, "file", "a text"), lambda: load_schedule(path)):
        with pytest.raises(InputError, match=f"(?i){remedy}") as refused:
            read()
        assert str(refused.value).count("\n") == 0 and "allowed is" in str(refused.value)


def test_a_large_file_is_refused_and_one_just_small_enough_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(text_files, "LARGEST", 1 << 20)
    path = tmp_path / "file"
    path.write_bytes(b"\xef\xbb\xbf" + (text_files.LARGEST - 3) * b"x")
    assert text_of(path, "file", "a text") == (text_files.LARGEST - 3) * "x"
    path.write_bytes((text_files.LARGEST + 1) * b"x")
    with pytest.raises(InputError, match="more than 1 MiB"):
        text_of(path, "file", "a text")
