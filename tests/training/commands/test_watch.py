import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager

import pytest

from auv_fault_env.errors import InputError
from training.commands.watch import HOST, NOTICE, free_port

from ..live.browser import CHROMIUM, tab

WATCH = [sys.executable, "-m", "training.cli", "watch"]
HERS = {
    name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "NICEGUI"))
}
ALARM = "document.body?.innerText.includes('alarm: propeller_loss:port')"


@contextmanager
def served():
    """Address of a page that is served as from the command line."""
    server = subprocess.Popen(
        [*WATCH, "--port", "0", "--seed", "1"], stdout=subprocess.PIPE, text=True, env=HERS
    )
    try:
        yield re.match(r"http://\S+", server.stdout.readline()).group()
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(timeout=30)
        server.stdout.close()


def test_the_first_line_says_what_is_compiled_and_how_long_it_takes():
    with subprocess.Popen(
        [*WATCH, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=HERS
    ) as server:
        assert server.stderr.readline() == f"auv-fault watch: {NOTICE}\n"
        assert "about half a minute" in NOTICE
        assert server.stdout.readline().startswith("http://")
        server.send_signal(signal.SIGINT)
        assert "Traceback" not in server.stderr.read()


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_in_a_browser_a_fault_is_injected_and_named_and_nothing_comes_from_elsewhere(tmp_path):
    with served() as address, tab(tmp_path) as page:
        page.call("Page.navigate", url=address)
        page.until("document.querySelectorAll('canvas').length === 7")
        page.until("document.body?.innerText.includes('no alarm')")
        page.click("4×")
        page.click("start")
        page.click("inject")
        page.until(ALARM)
        fetched = [
            e["params"]["request"]["url"]
            for e in page.events
            if e["method"] == "Network.requestWillBeSent"
        ]
        assert any("echart" in url for url in fetched)
        assert [url for url in fetched if not url.startswith((address, "data:", "blob:"))] == []
        assert [
            event for event in page.events if event["method"] == "Runtime.exceptionThrown"
        ] == []


def test_a_taken_port_is_refused():
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen()
        taken = other.getsockname()[1]
        with pytest.raises(InputError, match=f"port: got {taken}; allowed is a free one"):
            free_port(taken)
    assert free_port(taken) == taken
    assert free_port(0) > 0


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--port", "70000"], "port: got 70000"), (["--port", "0", "--seed", "-1"], "seed: got -1")],
    ids=["port", "seed"],
)
def test_bad_input_is_one_line(options, words):
    run = subprocess.run([*WATCH, *options], capture_output=True, text=True, env=HERS, timeout=60)
    assert run.returncode == 2
    assert run.stderr.startswith(f"auv-fault watch: {words}; allowed is")
    assert run.stderr.count("\n") == 1


def test_without_the_extra_it_is_named(monkeypatch):
    from training.arguments import Watch
    from training.commands.watch import main

    monkeypatch.setitem(sys.modules, "nicegui", None)
    with pytest.raises(InputError, match=r"pip install 'auv-fault\[live\]'"):
        main(Watch())
