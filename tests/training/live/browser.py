"""Chromium without a window, driven over its DevTools protocol."""

import json
import shutil
import subprocess
import time
import urllib.request
from contextlib import contextmanager

from websockets.sync.client import connect

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--remote-debugging-port=0",
)


class Tab:
    """A page in the browser; `events` are the protocol's messages so far."""

    def __init__(self, socket):
        self._socket = socket
        self._number = 0
        self.events = []

    def call(self, method, **parameters):
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("id") == self._number:
                return message["result"]
            self.events.append(message)

    def evaluate(self, script):
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def until(self, script, seconds=60.0):
        end = time.monotonic() + seconds
        while not self.evaluate(script):
            assert time.monotonic() < end, f"not within {seconds:g} s: {script}"
            time.sleep(0.1)

    def click(self, text):
        has_text = f"button => button.innerText.toLowerCase() === '{text}'"
        button = f"[...document.querySelectorAll('button')].find({has_text})"
        self.until(f"{button} !== undefined")
        self.evaluate(f"{button}.click()")


@contextmanager
def tab(folder, width=1366, height=900):
    """An empty tab of a new browser whose profile lies in the folder."""
    command = [
        CHROMIUM,
        *OPTIONS,
        f"--user-data-dir={folder}",
        f"--window-size={width},{height}",
        "about:blank",
    ]
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with connect(_address(folder / "DevToolsActivePort"), max_size=None) as socket:
            page = Tab(socket)
            for domain in ("Network", "Runtime", "Page"):
                page.call(f"{domain}.enable")
            yield page
    finally:
        browser.terminate()
        browser.wait(timeout=30)


def _address(file):
    end = time.monotonic() + 60.0
    while not (file.exists() and file.read_text().count("\n")):
        assert time.monotonic() < end, "Chromium has not started"
        time.sleep(0.1)
    port = file.read_text().split()[0]
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
        return next(
            one["webSocketDebuggerUrl"] for one in json.load(answer) if one["type"] == "page"
        )
