"""Keeps the live page to the pages of its own address, and its log to a line per message."""

import logging
import traceback
from types import TracebackType

import nicegui
from starlette.middleware.trustedhost import TrustedHostMiddleware

from auv_fault_env.printable import printable

LOCAL_NAME = "localhost"  # of this machine in addresses, beside its number
WEB_PORT = 80  # which addresses leave out
LOGGERS_WITH_HANDLERS = ("engineio.server", "socketio.server")  # would log everything twice
LONGEST_LINE = 500  # characters of a log line


def keep_to_own_address(host: str, port: int) -> None:
    """Refuse requests to any other host, and connections of pages from any other origin.

    So no page of another site reaches this one, not even by a name that it lets lead to this
    machine (DNS rebinding). Programs of this machine send no origin and are served.
    """
    hosts = [host, LOCAL_NAME]
    nicegui.app.add_middleware(TrustedHostMiddleware, allowed_hosts=hosts, www_redirect=False)
    suffix = "" if port == WEB_PORT else f":{port}"
    nicegui.core.sio.eio.cors_allowed_origins = [f"http://{name}{suffix}" for name in hosts]


class OneLine(logging.Formatter):
    """A record as one line of printable text, an exception by its message and where it was raised.

    Messages of visitors, which may be forged, neither fill the log nor write what is none.
    """

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        message = record.getMessage()
        error, trace = (record.exc_info or (None, None, None))[1:]
        if error is not None:
            # further lines describe the task that the error has ended
            first = message.partition("\n")[0]
            message = _described(error, trace)
            message = message if first == str(error) else f"{first}: {message}"
        text = f"auv-fault watch: {record.levelname.lower()}: {' '.join(message.split())}"
        return printable(text, longest=LONGEST_LINE)


def log_in_lines() -> None:
    """Log warnings and errors of the server on standard error as `OneLine`."""
    for name in LOGGERS_WITH_HANDLERS:
        logging.getLogger(name).handlers.clear()
    handler = logging.StreamHandler()
    handler.setFormatter(OneLine())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)


def _described(error: BaseException, trace: TracebackType | None) -> str:
    what = f"{type(error).__name__}: {error}"
    frames = traceback.extract_tb(trace)
    return f"{what} ({frames[-1].filename}:{frames[-1].lineno})" if frames else what
