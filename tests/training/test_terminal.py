"""Output that nobody can show, or nobody reads, costs neither the report nor a traceback."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from auv_fault_env.printable import printable
from training.terminal import terminal

LOG = "time,speed [m/s],\x1b[2Jport rpm\n" + "".join(
    f"{k / 10},{0.2 + k % 7 / 100},{300 + k % 5}\n" for k in range(200)
)
COMMAND = [sys.executable, "-m", "training.cli"]
# of a file system that takes any bytes
NOT_UTF8 = os.fsdecode(b"m\xff\xe4")


def run(folder, *arguments, **options):
    options = {"stdout": subprocess.PIPE} | options
    environment = os.environ | options.pop("environment", {})
    return subprocess.run(
        [*COMMAND, *arguments], cwd=folder, env=environment, stderr=subprocess.PIPE, **options
    )


def init(tmp_path, log="log.csv", **options):
    (tmp_path / log).write_text(LOG)
    return run(tmp_path, "vehicle", "init", log, "--output", "v–→.toml", **options)


def is_whole(tmp_path, name="v–→.toml"):
    return "port_rpm" in (tmp_path / name).read_text(encoding="utf-8")


def test_what_the_encoding_lacks_is_replaced(tmp_path):
    done = init(tmp_path, environment={"PYTHONIOENCODING": "latin-1"})
    assert done.returncode == 0
    assert b"v??.toml: 2 channels" in done.stdout
    assert done.stderr == b""
    assert is_whole(tmp_path)


def test_control_characters_of_a_header_reach_no_terminal(tmp_path):
    done = init(tmp_path)
    assert b"\x1b" not in done.stdout + done.stderr
    assert b"\\x1b[2Jport rpm" in (tmp_path / "v–→.toml").read_bytes()


def test_a_file_name_that_is_not_utf8(tmp_path):
    try:
        (tmp_path / NOT_UTF8).touch()
    except OSError:
        pytest.skip("the file system takes names in UTF-8 only")
    done = init(tmp_path, log=f"{NOT_UTF8}.csv")
    assert done.returncode == 0, done.stderr
    assert is_whole(tmp_path)
    done = run(tmp_path, "vehicle", "init", NOT_UTF8 + "\x1b", "--output", "w.toml")
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1 and b"m\\udcff\\udce4\\x1b" in done.stderr


@pytest.mark.parametrize("help", [False, True])
def test_a_reader_that_has_gone_changes_nothing(tmp_path, help):
    reading, writing = os.pipe()
    os.close(reading)
    done = run(tmp_path, "--help", stdout=writing) if help else init(tmp_path, stdout=writing)
    os.close(writing)
    assert done.returncode == 0
    assert done.stderr == b""
    assert help or is_whole(tmp_path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("help", [False, True])
def test_a_full_device_is_one_line_and_the_files_are_whole(tmp_path, help):
    with open("/dev/full", "wb") as full:
        done = run(tmp_path, "--help", stdout=full) if help else init(tmp_path, stdout=full)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1
    assert done.stderr.startswith(b"auv-fault: standard output is lost: No space left on device;")
    assert help or is_whole(tmp_path)


@pytest.mark.parametrize(
    ("closed", "code", "words"),
    [
        (">&-", 2, b"auv-fault: standard output is lost: it is closed; "),
        ("<&-", 0, b""),
        ("2>&-", 0, b""),
        (">&- 2>&- <&-", 2, b""),
    ],
)
def test_a_closed_standard_stream(tmp_path, closed, code, words):
    command = f'"{sys.executable}" -m training.cli vehicle init log.csv --output v.toml'
    (tmp_path / "log.csv").write_text(LOG)
    script = f"exec {command} {closed}"
    done = subprocess.run(["sh", "-c", script], cwd=tmp_path, capture_output=True)
    assert done.returncode == code, done.stderr
    assert done.stderr.startswith(words) and done.stderr.count(b"\n") == bool(words)
    assert is_whole(tmp_path, "v.toml")


def test_no_file_takes_the_number_of_a_closed_stream(tmp_path):
    code = (
        "import os; from training.terminal import terminal\n"
        "with terminal():\n"
        "    file = open('data', 'wb')\n"
        "    os.write(1, b'of a library'); os.write(2, b'of a library')\n"
        "    assert file.fileno() > 2\n"
    )
    script = f'exec "{sys.executable}" -c "$CODE" <&- >&- 2>&-'
    environment = os.environ | {"CODE": code}
    done = subprocess.run(["sh", "-c", script], cwd=tmp_path, env=environment)
    assert done.returncode == 0 and (tmp_path / "data").read_bytes() == b""


def test_numerical_warnings_reach_no_terminal_and_others_do():
    code = (
        "import warnings, numpy as np\n"
        "from training.terminal import terminal\n"
        "with terminal():\n"
        "    np.array([1e300]) * 1e300; np.mean([])\n"
        "    warnings.warn('of a library')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert done.stderr.count(b"Warning") == 1 and b"UserWarning: of a library" in done.stderr
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True)
    assert done.returncode == 1


def test_a_stream_after_an_error_discards(monkeypatch):
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys, "stdout", Full())
    with terminal() as (output, _):
        print("verdict")
        print("report", flush=True)
        assert output.reason_of_loss() == "No space left on device"
    assert isinstance(sys.stdout, Full)


def test_help_keeps_its_colours_and_bars_return_to_the_start_of_their_line(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with terminal() as (output, errors):
        print("\x1b[1mhelp")
        output.escapes = True
        errors.escapes = True
        print("\x1b[1mrow\tof\r")
        print("\r10%\x1b[A", file=sys.stderr)
    assert sys.stdout.getvalue() == "\x1b[1mhelp\n\\x1b[1mrow\tof\\r\n"
    assert sys.stderr.getvalue() == "\r10%\\x1b[A\n"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Höhe über Grund [m] →", "Höhe über Grund [m] →"),
        ("\x07\x7f\x9b", "\\x07\\x7f\\x9b"),
        ("speed\u202edeeps", "speed\\u202edeeps"),
        ("m\udcff", "m\\udcff"),
        ("a\nb", "a\\nb"),
    ],
)
def test_printable(text, shown):
    assert printable(text) == shown
    assert printable(shown) == shown
