"""``auv-fault watch``: a live page of a simulated vehicle, its faults and their diagnosis."""

import socket
import sys

from auv_fault_env.errors import refusal
from training.arguments import Watch
from training.extras import import_from_extra

HOST = "127.0.0.1"  # the page is for this machine alone
NOTICE = (
    "compiling simulator, filter bank and advice: about half a minute at the first start, "
    "then a few seconds"
)
MOST_PAGES = 50  # about 1 MiB each
RECONNECT_TIMEOUT = 60.0  # s until a page that has left ends: a busy machine is not a lost one


def main(arguments: Watch) -> None:
    """Serve the page until Ctrl+C."""
    nicegui = import_from_extra("nicegui", "live", "`watch`")
    port = free_port(arguments.port)
    print(f"auv-fault watch: {NOTICE}", file=sys.stderr, flush=True)
    from training.live.guard import keep_to_own_address, log_in_lines
    from training.live.start import Preparation, show_page

    preparation = Preparation(arguments.seed)
    log_in_lines()
    keep_to_own_address(HOST, port)
    nicegui.app.on_startup(lambda: print(f"http://{HOST}:{port}/ until Ctrl+C", flush=True))

    def root() -> None:
        if len(nicegui.Client.instances) > MOST_PAGES:
            nicegui.ui.label(f"{MOST_PAGES} pages are open: close one, and reload a minute later.")
        else:
            show_page(arguments.seed, preparation, NOTICE)

    nicegui.ui.run(
        root,
        host=HOST,
        port=port,
        title="auv-fault watch",
        show=False,
        reload=False,
        show_welcome_message=False,
        reconnect_timeout=RECONNECT_TIMEOUT,
        log_config=None,  # as other loggers
    )


def free_port(port: int) -> int:
    """The port, or any free one for 0; a taken one is refused."""
    with socket.socket() as probe:
        # as the server will do, for a port whose last server has just ended
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            allowed = f"a free one ({error.strerror})"
            raise refusal("port", port, allowed, "choose another, or 0 for any") from None
        return probe.getsockname()[1]
