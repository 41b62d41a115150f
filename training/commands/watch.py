"""``auv-fault watch``: a live page of a simulated vehicle, its faults and their diagnosis."""

import socket

from auv_fault_env.errors import finite_in_range, refusal
from training.arguments import Watch
from training.extras import import_from_extra

HOST = "127.0.0.1"  # the page is for this machine alone


def main(arguments: Watch) -> None:
    """Serve the page until Ctrl+C."""
    nicegui = import_from_extra("nicegui", "live")
    port = free_port(arguments.port)
    finite_in_range("seed", arguments.seed, 0, 2**62)
    from training.live.page import Page
    from training.live.session import Session

    Session(arguments.seed).step()  # compiles before the first visitor comes
    nicegui.app.on_startup(lambda: print(f"http://{HOST}:{port}/ until Ctrl+C", flush=True))

    def root() -> None:
        Page(arguments.seed)

    nicegui.ui.run(
        root,
        host=HOST,
        port=port,
        title="auv-fault watch",
        show=False,
        reload=False,
        show_welcome_message=False,
        # s until the page would start again: a busy machine is not a lost one
        reconnect_timeout=60.0,
    )


def free_port(port: int) -> int:
    """The port, or any free one for 0; a taken one is refused."""
    finite_in_range("port", port, 0, 65535)
    with socket.socket() as probe:
        # as the server will do, for a port whose last server has just ended
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            allowed = f"a free one ({error.strerror})"
            raise refusal("port", port, allowed, "choose another, or 0 for any") from None
        return probe.getsockname()[1]
