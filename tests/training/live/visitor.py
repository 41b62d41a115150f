"""A server of the live page in a process of its own, and visitors without a browser."""

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from contextlib import asynccontextmanager, contextmanager

import httpx
import socketio

# beside the page, how many sessions are alive, and the memory of the process [MiB]
PROGRAM = """
import gc, sys
from nicegui import app
from training.arguments import Watch
from training.commands import watch
from training.live.session import Session

@app.get("/state")
def state():
    gc.collect()
    sessions = sum(isinstance(one, Session) for one in gc.get_objects())
    pages = open("/proc/self/statm").read().split()[1] if sys.platform == "linux" else 0
    return {"sessions": sessions, "memory": int(pages) * 4096 / 2**20}

Session(1).step()  # compiles, so that the first page is whole at once
watch.RECONNECT_TIMEOUT = 1.0
watch.MOST_PAGES = 12
watch.main(Watch(port=0, seed=1))
"""
SOCKET = "_nicegui_ws/socket.io"
FORBIDDEN = ("PYTEST", "NICEGUI")


class Server:
    """A server at `address`; `log` is its standard error so far."""

    def __init__(self, address, errors):
        self.address = address
        self._errors = errors

    @property
    def log(self):
        with open(self._errors) as file:
            return file.read().splitlines()

    def state(self):
        return httpx.get(f"{self.address}/state", timeout=60.0).json()


@contextmanager
def served(folder):
    """A server of at most 12 pages, which end a second after their visitor has left."""
    environment = {name: v for name, v in os.environ.items() if not name.startswith(FORBIDDEN)}
    errors = folder / "errors.txt"
    command = [sys.executable, "-c", PROGRAM]
    with errors.open("w") as log:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment
        )
    try:
        address = re.match(r"(http://\S+)/", process.stdout.readline())[1]
        _wait_until_it_listens(address)
        yield Server(address, errors)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def _wait_until_it_listens(address):
    """The address is printed a moment before."""
    end = time.monotonic() + 60.0
    while True:
        try:
            httpx.get(f"{address}/state", timeout=60.0)
            return
        except httpx.ConnectError:
            assert time.monotonic() < end, "the server does not listen"
            time.sleep(0.1)


class Visitor:
    """A connected page: its elements by text or label, and what the server has changed."""

    def __init__(self, client_id, elements, socket):
        self.client_id = client_id
        self.elements = elements
        self.socket = socket

    def find(self, text):
        """Number and element of this text or label."""
        for number, element in self.elements.items():
            properties = element.get("props", {})
            if text in (element.get("text"), properties.get("label")):
                return int(number), element
        raise AssertionError(f"no {text} on the page")

    async def send(self, number, arguments, **changes):
        """Send the first event of an element as a browser does, but with these changes."""
        listener = self.elements[str(number)]["events"][0]["listener_id"]
        words = [json.dumps(one) for one in arguments]
        message = {
            "id": number,
            "client_id": self.client_id,
            "listener_id": listener,
            "args": words,
        }
        await self.socket.emit("event", message | changes)

    async def click(self, text):
        await self.send(self.find(text)[0], [])


@asynccontextmanager
async def visit(address):
    """Open the page and connect as a browser does."""
    async with httpx.AsyncClient(timeout=60.0) as web:
        text = (await web.get(address)).text
    client_id = re.search(r"'client_id': '([^']+)'", text)[1]
    elements = json.loads(re.search(r"parseElements\(String.raw`(.*?)`\), \{\n", text)[1])
    socket = socketio.AsyncClient()
    visitor = Visitor(client_id, elements, socket)

    @socket.on("update")
    def update(changes):
        for number, element in changes.items():
            if not number.startswith("_") and isinstance(element, dict):
                visitor.elements[number] = element

    query = f"client_id={client_id}&tab_id={client_id}&document_id={client_id}"
    query += "&next_message_id=0&implicit_handshake=true"
    await socket.connect(
        f"{address}?{query}",
        headers={"Origin": address},
        socketio_path=SOCKET,
        transports=["websocket"],
    )
    try:
        yield visitor
    finally:
        await socket.disconnect()


async def until(condition, seconds=60.0):
    """Wait until the condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds:g} s"
        await asyncio.sleep(0.1)
