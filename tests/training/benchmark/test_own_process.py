"""Whatever code does in a process of its own, its caller gets data or one line."""

import ctypes
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from training.benchmark.failures import CallFailed
from training.benchmark.own_process import call_in_own_process

LIMIT = 60.0


class Unspeakable(BaseException):
    def __str__(self):
        raise KeyboardInterrupt


def raises(error):
    raise error


def loops():
    while True:
        pass


def misbehaves(folder):
    """All that must not reach the caller, and an answer."""
    os.chdir(folder)
    os.environ["SPOILT"] = "1"
    np.seterr(all="raise")
    print(100_000_000 * "x")
    os.write(2, 1_000_000 * b"y")
    subprocess.Popen(["sleep", "300"])
    sys.stdout = None
    sys.path.clear()
    return {"folder": os.getcwd()}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ((os._exit, 3), "exit code 3"),
        ((os._exit, 0), "exit code 0"),
        ((ctypes.string_at, 0), "SIGSEGV"),
        ((os.kill, 0, signal.SIGKILL), "SIGKILL, perhaps for lack of memory"),
        ((raises, KeyboardInterrupt()), "KeyboardInterrupt"),
        ((raises, SystemExit(4)), "SystemExit: 4"),
        ((raises, GeneratorExit()), "GeneratorExit"),
        ((raises, Unspeakable()), "Unspeakable: a message that cannot be shown"),
        ((raises, ValueError("m\ud800\x1b[2J\n\U0001f600" + 10_000 * "x")), r"\\ud800\\x1b\[2J"),
        ((os.closerange, 0, 100), "exit code 1"),
        ((object,), "not JSON serializable"),
    ],
)
def test_what_it_does_is_one_line(call, words):
    with pytest.raises(CallFailed, match=words) as failed:
        call_in_own_process(*call, limit=LIMIT)
    message = str(failed.value)
    assert message.isprintable() and len(message) <= 500


def test_an_endless_loop_ends_at_the_limit():
    begin = time.monotonic()
    with pytest.raises(CallFailed, match=r"more than 2 s at once; .* --time-limit"):
        call_in_own_process(loops, limit=2.0)
    assert time.monotonic() - begin < 20.0


def test_nothing_but_the_answer_comes_back(tmp_path, capfd):
    before = os.getcwd(), dict(os.environ), np.geterr(), list(sys.path)
    answer = call_in_own_process(misbehaves, str(tmp_path), limit=LIMIT)
    assert answer == {"folder": str(tmp_path)}
    assert (os.getcwd(), dict(os.environ), np.geterr(), list(sys.path)) == before
    assert capfd.readouterr() == ("", "")


def test_arrays_come_back_as_they_are():
    array = np.arange(6.0, dtype=np.float32).reshape(2, 3)
    answer = call_in_own_process(dict, {"a": array}, limit=LIMIT)
    assert answer["a"].dtype == np.float32
    np.testing.assert_array_equal(answer["a"], array)
