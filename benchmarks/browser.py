"""Headless Chromium by its DevTools protocol: a page, its console, what it asks of the network, pictures, keys."""

from __future__ import annotations

import asyncio
import base64
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import WebSocketClientConnection, websocket_connect

__all__ = ["Browser", "browser"]

_OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", "--disable-sync",
            "--disable-background-networking", "--disable-component-update", "--disable-extensions",
            "--remote-debugging-port=0")  # fmt: skip


class Browser:
    """Page of a browser.

    Attributes
    ----------
    console : list of str
        Errors and warnings of its console, and errors that no script caught.
    asked : list of str
        Addresses that it asked for.
    """

    def __init__(self, connection: WebSocketClientConnection) -> None:
        self._connection, self._waiting, self._n = connection, dict[int, asyncio.Future[Any]](), 0
        self.console: list[str] = []
        self.asked: list[str] = []
        self._reader = asyncio.create_task(self._read())

    async def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol."""
        self._n += 1
        answer = self._waiting[self._n] = asyncio.get_running_loop().create_future()
        await self._connection.write_message(json.dumps({"id": self._n, "method": method, "params": parameters}))
        return await asyncio.wait_for(answer, 60.0)

    async def open(self, address: str) -> None:
        """Go to an address."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            await self.call(f"{domain}.enable")
        await self.call("Page.navigate", url=address)

    async def value(self, script: str) -> Any:
        """Return the value of an expression on the page."""
        found = await self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        return found["result"].get("value")

    async def until(self, script: str, most: float = 60.0) -> None:
        """Wait until an expression on the page is true."""
        for _ in range(round(most / 0.1)):
            if await self.value(script):
                return
            await asyncio.sleep(0.1)
        raise TimeoutError(f"{script} is not true: {self.console}")

    async def look(self, width: int, height: int, *, dark: bool, phone: bool = False) -> None:
        """Take a size and a theme."""
        await self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if phone else 1,
            mobile=phone,
        )
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        await self.call("Emulation.setEmulatedMedia", features=[theme])

    async def picture(self, path: Path) -> None:
        """Write a picture of the whole page."""
        found = await self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(found["data"]))

    async def key(self, key: str, text: str = "") -> None:
        """Press a key."""
        for kind in ("keyDown", "keyUp"):
            await self.call("Input.dispatchKeyEvent", type=kind, key=key, text=text if kind == "keyDown" else "")

    async def _read(self) -> None:
        while (text := await self._connection.read_message()) is not None:
            message = json.loads(text)
            if "id" in message:
                future = self._waiting.pop(message["id"])
                if "error" in message:
                    future.set_exception(RuntimeError(str(message["error"])))
                else:
                    future.set_result(message["result"])
            else:
                self._event(message["method"], message["params"])

    def _event(self, method: str, told: Any) -> None:
        if method == "Network.requestWillBeSent":
            self.asked.append(told["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.asked.append(told["url"])
        elif method == "Runtime.exceptionThrown":
            self.console.append(json.dumps(told["exceptionDetails"])[:500])
        elif method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.console.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.console.append(json.dumps([one.get("value", one.get("description")) for one in told["args"]]))


@asynccontextmanager
async def browser(program: str = shutil.which("chromium") or "chromium") -> AsyncIterator[Browser]:
    """Start Chromium, Debian's package or any other, with an empty page."""
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [program, *_OPTIONS, f"--user-data-dir={folder}", "about:blank"], stderr=subprocess.PIPE, text=True
        )
        assert process.stderr is not None
        try:
            found = next(found for line in process.stderr if (found := re.search(r"ws://([\d.:]+)/", line)))
            connection = await websocket_connect(await _target(found[1]), max_message_size=1 << 28)
            yield Browser(connection)
            connection.close()
        finally:
            process.terminate()
            process.wait()
            process.stderr.close()


async def _target(host: str) -> str:
    """Return the address of the empty page, which the browser opens a moment after it listens."""
    for _ in range(100):
        pages = json.loads((await AsyncHTTPClient().fetch(f"http://{host}/json/list")).body)
        for page in pages:
            if page["type"] == "page":
                return str(page["webSocketDebuggerUrl"])
        await asyncio.sleep(0.1)
    raise TimeoutError("the browser has opened no page")
