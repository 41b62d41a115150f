"""The live page is for the pages of its own address; bad messages cost a line, not the session."""

import asyncio
import logging

import aiohttp
import httpx
import pytest

from training.live.guard import LONGEST_LINE, OneLine

from .visitor import SOCKET, served, until, visit

LAST = "the last message"
PAGE = "update:modelValue"
BAD_VALUES = ["abc", 1e9, None, True, {"a": 1}, [1, 2], -1e308, ""]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with served(tmp_path_factory.mktemp("server")) as one:
        yield one


def new_lines(server, n_before):
    """What has been logged since, one record each."""
    lines = server.log[n_before:]
    assert all(line.startswith("auv-fault watch: ") for line in lines), lines
    assert all(len(line) <= LONGEST_LINE and line.isprintable() for line in lines)
    return lines


def test_what_leaves_is_forgotten(server):
    """Sessions end with their visitors, and the next ones need no more memory."""

    async def all_at_once():
        async def one():
            async with visit(server.address) as visitor:
                await visitor.click("start")
                await asyncio.sleep(0.5)

        await asyncio.gather(*(one() for _ in range(6)))

    memory = []
    for _ in range(3):
        asyncio.run(all_at_once())
        asyncio.run(until(lambda: server.state()["sessions"] == 0))
        memory.append(server.state()["memory"])
    # of 12 sessions of about 1 MiB each
    assert memory[-1] - memory[0] < 6.0, memory


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "", "127.0.0.1.evil"])
@pytest.mark.parametrize("path", ["/", f"/{SOCKET}/?EIO=4&transport=polling"])
def test_another_host_is_refused(server, host, path):
    answer = httpx.get(server.address + path, headers={"Host": host})
    assert answer.status_code == 400
    assert answer.text == "Invalid host header"


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_this_host_is_served(server, name):
    port = server.address.rpartition(":")[2]
    answer = httpx.get(server.address, headers={"Host": f"{name}:{port}"})
    assert answer.status_code == 200
    assert "auv-fault watch" in answer.text


def connects(server, transport, **headers):
    """Whether socket.io answers to a handshake with these headers."""
    address = f"{server.address}/{SOCKET}/?EIO=4&transport={transport}"

    async def by_websocket():
        async with aiohttp.ClientSession() as web:
            try:
                async with web.ws_connect(address, headers=headers) as socket:
                    return (await socket.receive_str()).startswith("0")
            except aiohttp.WSServerHandshakeError as error:
                assert error.status in (400, 403)
                return False

    if transport == "websocket":
        return asyncio.run(by_websocket())
    answer = httpx.get(address, headers=headers)
    assert answer.status_code in (200, 400)
    return answer.status_code == 200


@pytest.mark.parametrize("transport", ["websocket", "polling"])
def test_only_pages_of_this_origin_connect(server, transport):
    port = server.address.rpartition(":")[2]
    assert connects(server, transport)
    for origin in (server.address, f"http://localhost:{port}"):
        assert connects(server, transport, Origin=origin)
    foreign = [
        "null",
        "http://evil.example",
        f"http://evil.example:{port}",
        f"http://127.0.0.1:{int(port) + 1}",
        f"https://127.0.0.1:{port}",
    ]
    for origin in foreign:
        assert not connects(server, transport, Origin=origin)
    # a name that leads here, whose page has the same origin
    host = f"evil.example:{port}"
    assert not connects(server, transport, Origin=f"http://{host}", Host=host)


def test_bad_messages_cost_a_line_each_and_the_session_goes_on(server):
    async def check():
        async with visit(server.address) as visitor:
            await visitor.click("start")
            n_before = len(server.log)
            n_sent = 0
            changeable = [
                int(number)
                for number, element in visitor.elements.items()
                if any(event["type"] == PAGE for event in element.get("events", ()))
            ]
            assert len(changeable) == 10
            for value in BAD_VALUES:
                for number in changeable:
                    await visitor.send(number, [value])
                for button in ("inject", "repair", "random fault"):
                    await visitor.click(button)
                n_sent += len(changeable) + 3
            number = changeable[0]
            for change in (
                {"args": ["{"]},
                {"args": 5},
                {"listener_id": "x"},
                {"id": 999},
                {"id": [1]},
                {"client_id": "x"},
                {"client_id": []},
            ):
                await visitor.send(number, [1], **change)
                n_sent += 1
            own = {"client_id": visitor.client_id}
            forged = own | {"level": "error", "message": "\x1b"}
            for name in ("event", "handshake", "ack", "log", "javascript_response", "nonsense"):
                for message in (None, "x", {}, [], own, forged):
                    await visitor.socket.emit(name, message)
                    n_sent += 1
            for raw in ("garbage", "2{", b"x"):
                await visitor.socket.eio.send(raw)
                n_sent += 1
            # the session takes the right values, and the vehicle goes on
            for number in changeable:
                model = visitor.elements[str(number)]["props"].get("options")
                await visitor.send(number, [{"value": 1, "label": ""} if model else 0.5])
            await visitor.socket.emit("log", own | {"level": "error", "message": LAST})
            await until(lambda: any(LAST in line for line in server.log))
            lines = [line for line in new_lines(server, n_before) if LAST not in line]
            assert 0.5 * n_sent < len(lines) <= n_sent
            assert not any("Traceback" in line for line in lines)
            await moves(visitor)

    async def moves(visitor):
        """Wait until the vehicle has gone on."""
        (number,) = (
            number
            for number, element in visitor.elements.items()
            if element.get("text", "").endswith(" m") and " s, " in element["text"]
        )
        before = visitor.elements[number]["text"]
        for _ in range(100):
            await asyncio.sleep(0.1)
            if visitor.elements[number]["text"] != before:
                return
        raise AssertionError(f"the vehicle stays at {before}")

    asyncio.run(check())


def test_more_pages_than_the_memory_is_meant_for_are_refused(server):
    for _ in range(14):
        text = httpx.get(server.address, timeout=60.0).text
    assert "12 pages are open: close one" in text
    assert server.state()["sessions"] <= 12


def record(message, error=None):
    info = (type(error), error, error.__traceback__) if error else None
    return logging.LogRecord("x", logging.ERROR, "f.py", 1, message, (), info)


def test_a_record_is_one_line_with_the_place_of_its_error():
    try:
        int("x\ny\x1b[2J")
    except ValueError as error:
        line = OneLine().format(record(str(error), error))
        longer = OneLine().format(record("Task\nmore", error))
    assert line.startswith("auv-fault watch: error: ValueError: invalid literal for int()")
    assert line.endswith(f"({__file__}:{line.rpartition(':')[2]}")
    assert longer.startswith("auv-fault watch: error: Task: ValueError: invalid literal")
    assert OneLine().format(record("a\nb\x1b")) == "auv-fault watch: error: a b\\x1b"
    assert len(OneLine().format(record("a" * 5000))) == LONGEST_LINE
