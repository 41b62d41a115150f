"""A call in a process of its own, for code of others: whatever it does ends there.

The process has memory, working folder, session and signals of its own, and what it prints is
discarded. It answers with plain data or arrays, never with pickles, so that none of its code comes
back. It ends with its caller.
"""

import io
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from training.benchmark.failures import CallFailed, one_line

# the search path is that of the caller, so that the same modules are found
START = (
    "import sys; sys.path[:] = sys.argv[1:]; "
    "from training.benchmark.own_process import answer; answer()"
)
# first byte of an answer
ARRAYS = b"A"
PLAIN = b"P"
FAILURE = b"F"
LOOK_FOR_CALLER = 1.0  # s, between two looks whether the caller still lives
FIRST_TO_GO = "1000"  # of the kernel's scale, where memory runs out


def call_in_own_process(function: Callable[..., Any], *arguments: Any, limit: float) -> Any:
    """The result of the function, called in a process of its own.

    Parameters
    ----------
    function, arguments
        Can be pickled. The function returns plain data as JSON has it, or arrays by name.
    limit
        Most seconds that it may take, the start of the process included.

    Raises
    ------
    CallFailed
        In one line, what the process did instead of answering.
    """
    call = pickle.dumps((function, arguments))
    process = subprocess.Popen(
        [sys.executable, "-c", START, *sys.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        reply, _ = process.communicate(call, timeout=limit)
    except subprocess.TimeoutExpired:
        remedy = "correct it, or give it more time by --time-limit"
        raise CallFailed(f"took more than {limit:g} s at once; {remedy}") from None
    finally:
        _end(process)
    return _decoded(reply, process.returncode)


def answer() -> None:
    """Answer a call, in the new process: it comes by standard input, the answer by its output."""
    threading.Thread(target=_end_with_caller, args=(os.getppid(),), daemon=True).start()
    # a descriptor that neither foreign code prints to nor its own processes inherit
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(FIRST_TO_GO, encoding="ascii")
    try:
        function, arguments = pickle.loads(sys.stdin.buffer.read())
        reply = _encoded(function(*arguments))
    # also what is meant to end a process, which this one does anyway
    except BaseException as error:
        reply = FAILURE + one_line(error).encode()
    channel.write(reply)
    channel.flush()
    # threads and exit handlers of foreign code have nothing more to do
    os._exit(0)


def _end_with_caller(caller: int) -> None:
    while os.getppid() == caller:
        time.sleep(LOOK_FOR_CALLER)
    os._exit(1)


def _end(process: subprocess.Popen) -> None:
    """End the process and those that it has started."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


def _encoded(result: Any) -> bytes:
    if isinstance(result, Mapping) and all(isinstance(v, np.ndarray) for v in result.values()):
        buffer = io.BytesIO()
        np.savez(buffer, **result)
        return ARRAYS + buffer.getvalue()
    return PLAIN + json.dumps(result).encode()


def _decoded(reply: bytes, code: int) -> Any:
    kind = reply[:1]
    content = reply[1:]
    if code != 0 or kind not in (ARRAYS, PLAIN, FAILURE):
        raise CallFailed(_how_it_ended(code))
    if kind == FAILURE:
        raise CallFailed(content.decode())
    if kind == PLAIN:
        return json.loads(content)
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return dict(arrays)


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"ended its process with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    why = ", perhaps for lack of memory" if -code == signal.SIGKILL else ""
    return f"its process was ended by {name}{why}"
