"""Page of a run: who gets it, what a session gets, and that nothing leaves the machine."""

import asyncio
import base64
import json
import re
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from html import unescape
from http.client import HTTPConnection
from typing import Any

import pytest
from bokeh.protocol import Protocol
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from hybridsep.base.errors import ParameterError
from hybridsep.logs.units import shown_of
from hybridsep_live.core import Row
from hybridsep_live.page import Page
from hybridsep_live.page_server import fill
from hybridsep_live.state import State, table

TITLE = "an axis <script>alert(1)</script>"
SHOWN = shown_of("", "m")


def rows(first: int, n: int) -> list[Row]:
    return [Row(k, 1e-3 * k, 0.1, 0.1 + 1e-6 * k, 0.1, 0.1, 1e-6, 1, 1e-5) for k in range(first, first + n)]


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with Page(TITLE, SHOWN) as page:
        page.begin(1e-3, 100)
        page.take(rows(0, 3000), {"n_samples": 3100})
        yield page


def fetch(page: Page, path: str, **headers: str) -> tuple[int, Mapping[str, str], str]:
    """Return status, headers and body of an answer."""
    with closing(HTTPConnection("127.0.0.1", page.port, timeout=20.0)) as connection:
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return answer.status, dict(answer.headers), answer.read().decode()


def handshake(page: Page, token: str, query: str, origin: str) -> int:
    """Return the status of the answer to one that wants to open a session's WebSocket."""
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Origin": origin, "Sec-WebSocket-Version": "13"}
    keys = {"Sec-WebSocket-Key": base64.b64encode(b"k" * 16).decode(), "Sec-WebSocket-Protocol": f"bokeh, {token}"}
    return fetch(page, f"/ws{query}", **upgrade, **keys)[0]


def gets(page: Page, token: str, *wanted: str, more: Sequence[Row] = ()) -> bool:
    """Return whether a session gets texts with all that is wanted, with more rows; not if it is closed before."""

    async def listen() -> bool:
        request = HTTPRequest(f"ws://127.0.0.1:{page.port}/ws{query(page)}", headers={"Origin": here(page)})
        connection = await websocket_connect(request, subprotocols=["bokeh", token])
        left = set(wanted)
        while left:
            text = await asyncio.wait_for(connection.read_message(), 20.0)
            if text is None:
                connection.close()
                return False
            left -= {one for one in left if isinstance(text, str) and one in text}
            if '"ACK"' in str(text):  # then all of the document, as a browser: frames may have gone before
                message = Protocol().create("PULL-DOC-REQ")
                for part in (message.header_json, message.metadata_json, message.content_json):
                    await connection.write_message(part)
                if more:
                    page.take(more, {"n_samples": 3100})
        connection.close()
        while await asyncio.wait_for(connection.read_message(), 20.0) is not None:
            pass
        return True

    return asyncio.run(listen())


def here(page: Page) -> str:
    return f"http://localhost:{page.port}"


def query(page: Page) -> str:
    return "?" + page.address.partition("?")[2]


def text_of(page: Page) -> str:
    return fetch(page, f"/{query(page)}")[2]


def session_token(text: str) -> str:
    found = re.search(r'"token":"([^"]+)"', unescape(text))
    assert found
    return found[1]


def test_without_the_token_there_is_nothing(page: Page) -> None:
    for path in ("/", "/?token=", "/?token=wrong", "/metadata", "/autoload.js?bokeh-autoload-element=x", "/ws"):
        status, _, body = fetch(page, path)
        assert status == 403
        assert "axis" not in body
    assert fetch(page, "/", Cookie=query(page)[1:])[0] == 403
    token = session_token(text_of(page))
    assert handshake(page, token, "", here(page)) == 403
    assert handshake(page, token, "?token=wrong", here(page)) == 403
    assert handshake(page, token, query(page), "http://evil.example") == 403
    made_up = base64.urlsafe_b64encode(b'{"session_id": "mine", "session_expiry": 99999999999}').rstrip(b"=").decode()
    assert not gets(page, made_up, '"ACK"')


def test_who_has_it_gets_the_run_and_its_frames(page: Page) -> None:
    assert gets(page, session_token(text_of(page)), '"ACK"', '"PATCH-DOC"', "n_samples", "ndarray", more=rows(3000, 50))


def test_the_page_asks_this_machine_alone(page: Page) -> None:
    status, headers, body = fetch(page, f"/{query(page)}")
    assert status == 200
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"
    assert "<script>alert(1)</script>" not in body
    assert "an axis &lt;script&gt;" in body
    assert "not a controller" in body
    assert "default-src 'none'" in body
    addresses = re.findall(r"""(?:src|href)=["']([^"']+)""", body)
    assert addresses
    for one in addresses:
        assert one.startswith("/static/js/bokeh")
        assert fetch(page, one)[0] == 200


def test_it_is_bound_to_this_machine(page: Page) -> None:
    with socket.socket() as other, pytest.raises(OSError, match=r"."):
        other.connect(("127.0.0.2", page.port))
    with pytest.raises(ParameterError, match=rf"the page cannot be served at port {page.port}: .*\(--port\)"):
        Page(TITLE, SHOWN, page.port)


def test_the_end_is_told_and_the_process_ends() -> None:
    page = Page(TITLE, SHOWN)
    page.take(rows(0, 10), {})  # before it has begun: not shown
    page.begin(1e-3, 0)
    page.take(rows(0, 10), {"n_samples": 10})
    page.end("sample 7 is refused")
    assert gets(page, session_token(text_of(page)), "sample 7 is refused")
    page.close()
    page.wait()
    for _ in range(1010):  # nobody takes them: the run goes on, and says what was missed
        page.take(rows(10, 2), {})
    assert page.n_dropped == 20


FAILING = """
import threading, urllib.request
from hybridsep_live.page_server import PageServer
def fails(document):
    raise RuntimeError("a fault of the page")
server = PageServer(fails, 0, "the-token")
def ask():
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{server.port}/?token=the-token")
    except OSError as error:
        print(error.code)
    server.call(server.stop_later)
threading.Thread(target=ask).start()
server.run()
"""


def test_the_token_is_in_no_traceback() -> None:
    """Tornado logs the address of a request whose page fails."""
    done = subprocess.run([sys.executable, "-c", FAILING], capture_output=True, text=True)
    assert done.stdout == "500\n", done.stderr
    assert "a fault of the page" in done.stderr
    assert "?token=…" in done.stderr
    assert "the-token" not in done.stderr


def test_a_session_follows_what_its_page_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    from bokeh.document import Document

    now = [0.0]
    monkeypatch.setattr("hybridsep_live.page_server.monotonic", lambda: now[0])
    state, document = State(TITLE, SHOWN), Document()
    state.begin(1e-3, 0)
    state.take(table(rows(0, 20_000)), {})
    fill(document, state)
    assert [root.name for root in document.roots] == ["error", "residual", "position", "step"]
    lines, control, seen = (document.get_model_by_name(name) for name in ("lines", "control", "seen"))
    assert lines is not None
    assert control is not None
    assert seen is not None
    frame = document.session_callbacks[0].callback

    def last() -> float:
        return float(lines.data["t"][-1])

    def arrive(first: int) -> None:
        state.take(table(rows(first, 500)), {})
        now[0] += 0.05
        frame()

    assert last() == pytest.approx(19.99, abs=0.05)
    arrive(20_000)
    assert last() == pytest.approx(20.49, abs=0.05)
    arrive(20_500)
    assert last() == pytest.approx(20.49, abs=0.05)  # not yet painted
    seen.data = {"n": [1]}
    frame()
    assert last() == pytest.approx(20.99, abs=0.05)
    now[0] += 2.0  # never painted: behind another window
    arrive(21_000)
    assert last() == pytest.approx(21.49, abs=0.05)
    now[0] += 2.0
    control.data = {"paused": [1], "span": [10], "start": [3.0], "end": [4.0]}
    assert (lines.data["t"][0], last()) == pytest.approx((2.999, 4.001))
    assert len(lines.data["t"]) == 1003
    arrive(21_500)
    assert last() == pytest.approx(4.001)
    control.data = {"paused": [0], "span": [2], "start": [float("nan")], "end": [float("nan")]}
    frame()
    assert (lines.data["t"][0], last()) == pytest.approx((19.999, 21.999), abs=0.02)
    wrong: list[dict[str, list[Any]]] = [
        {},
        {"paused": [], "span": []},
        {"span": ["x"], "start": [None]},
        {"span": [1e300]},
    ]
    for nonsense in wrong:
        control.data = nonsense
        now[0] += 2.0
        frame()
    assert last() == pytest.approx(21.999, abs=0.05)
    state.end("")
    frame()
    status = document.get_model_by_name("status")
    assert status is not None
    assert json.loads(status.data["json"][0])["phase"] == "ended"
