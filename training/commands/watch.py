"""``auv-fault watch``: a live page on which a person runs a vehicle, breaks it, and sees what is made of it."""

import socket

from auv_fault_env.errors import finite_in_range, refusal
from training.arguments import Watch
from training.extras import import_from_extra

HOST = "127.0.0.1"  # nobody else's business


def main(arguments: Watch) -> None:
    """Serve the page until Ctrl+C."""
    nicegui = import_from_extra("nicegui", "live")
    port = free_port(arguments.port)
    finite_in_range("seed", arguments.seed, 0, 2**62)
    from training.live.page import Page
    from training.live.session import Session

    Session(arguments.seed).step()  # so that the first visitor does not wait for the compiler
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
        # s, after which a page would begin anew: a busy machine is no lost one
        reconnect_timeout=60.0,
    )


def free_port(port: int) -> int:
    """The port if it is free, any free one for 0; else a refusal."""
    finite_in_range("port", port, 0, 65535)
    with socket.socket() as probe:
        # as the server will, for one that has just gone
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise refusal(
                "port", port, f"a free one ({error.strerror})", "give another, or 0 for any"
            ) from None
        return probe.getsockname()[1]
