"""The page `try` in headless Chromium, over a pipe by its DevTools protocol: the library's figures, and no request."""

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.try_page import build
from hybridsep import HybridPredictor, backtest, read_log
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.peers import Piece, predict_peers
from hybridsep.model.physics import ModalModel, Mode

pytestmark = pytest.mark.nightly

BROWSERS = ("chromium", "google-chrome", "chrome")
FIRST, NP = 10_000, 100


class Tab:
    """A tab of a browser; what it reports meanwhile is kept in ``events``."""

    def __init__(self, to: int, back: int) -> None:
        self.to, self.back, self.rest, self.n = to, back, b"", 0
        self.session: dict[str, str] = {}
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self.session = {"sessionId": attached["sessionId"]}
        for domain in ("Page", "Runtime", "Network", "DOM"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> Any:
        self.n += 1
        os.write(
            self.to, json.dumps({"id": self.n, "method": method, "params": params, **self.session}).encode() + b"\0"
        )
        while True:
            while b"\0" not in self.rest:
                self.rest += os.read(self.back, 1 << 16) or b'{"method": "the browser has ended"}\0{}\0'
            text, _, self.rest = self.rest.partition(b"\0")
            answer = json.loads(text)
            if answer.get("id") == self.n:
                return answer["result"]
            assert "method" in answer, self.events[-1]
            self.events.append(answer)

    def value(self, expression: str) -> Any:
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, expression: str) -> Any:
        end = time.monotonic() + 60.0
        while not (value := self.value(expression)):
            assert time.monotonic() < end, expression
            time.sleep(0.05)
        return value


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    build(folder)
    return folder


@pytest.fixture(scope="module")
def tab(page: Path) -> Iterator[Tab]:
    name = next(filter(None, map(shutil.which, BROWSERS)), None)
    assert name, f"a browser is needed: one of {', '.join(BROWSERS)}"
    (read, to), (back, write) = os.pipe(), os.pipe()
    options = f"--headless --no-sandbox --disable-gpu --remote-debugging-pipe --user-data-dir={page / 'profile'}"
    command = ["bash", "-c", f"exec {name} {options} 3<&{read} 4>&{write}"]
    with subprocess.Popen(command, pass_fds=(read, write), stderr=subprocess.DEVNULL) as process:
        for end in (read, write):
            os.close(end)
        tab = Tab(to, back)
        tab.call("Page.navigate", url=(page / "index.html").as_uri())
        tab.wait("document.readyState === 'complete' && at('unit').length > 0")
        yield tab
        process.terminate()
    for end in (to, back):
        os.close(end)


def test_figures_are_the_librarys_and_nothing_is_asked_for(tab: Tab, page: Path) -> None:
    root = tab.call("DOM.getDocument")["root"]["nodeId"]
    node = tab.call("DOM.querySelector", nodeId=root, selector="#file")["nodeId"]
    tab.call("DOM.setFileInputFiles", files=[str(page / "example.csv")], nodeId=node)
    mode = tab.wait("shown && shown.mode")
    rows = tab.value("[...at('rows').rows].map((row) => [...row.cells].map((cell) => cell.textContent))")
    log = read_log(page / "example.csv")
    model = ModalModel(
        [Mode(mode["f_n"], mode["zeta"], (2 * np.pi * mode["f_n"]) ** 2, mode["beta"])], mode["dead_time"]
    )
    found = backtest(HybridPredictor(model, PredictorSettings(Np=NP, p=50)), log)
    peers = predict_peers([Piece(log.x_d, log.x_meas, 0, FIRST)], NP)
    predictions = {"physics model": found.x_pb, "hold": found.x_hold}
    predictions |= {peer.name: peer.predictions[0] for peer in peers} | {"hybrid": found.x_h}
    expected = []
    for name, predicted in predictions.items():
        error = 1e6 * np.abs(log.x_meas - predicted)[FIRST:]
        expected.append([name, *(f"{one:#.3g} µm" for one in (np.sqrt(np.mean(error**2)), np.max(error)))])
    assert rows == expected
    assert "20000 rows" in tab.value("at('status').textContent")
    assert tab.value("fetch('https://example.org').then(() => 'sent', () => 'refused')") == "refused"
    asked = [one["params"]["request"]["url"] for one in tab.events if one["method"] == "Network.requestWillBeSent"]
    assert {Path(one).name for one in asked if one.startswith(page.as_uri())} == {
        "index.html",
        "hsep.wasm.js",
        "try.js",
    }
    assert len(asked) == 3


LINES = [f"{2 * k};{k % 7},5;{k % 5}" for k in range(1000)]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["0;1;2", *LINES], "the first row must name the columns"),
        (["t;command;x_meas", *LINES], "choose commanded and measured"),
        (["t;command_mm;x_meas", *LINES[:500], "1000;1;", *LINES[501:]], 'row 501, x_meas: "" is no number'),
        (
            ["t_ms;command_mm;x_meas", *LINES[:600], *LINES[700:]],
            "row 601: the time changes by 0.202 s, elsewhere by 0.002 s",
        ),
        (["t_ms;command_mm;x_meas", *LINES[:900]], "900 rows are too few"),
        (["t;command_mm;x_meas", *LINES], "column 't' has an interval of 2.00000, no axis's in s"),
    ],
)
def test_a_log_that_cannot_be_predicted_is_refused(tab: Tab, lines: list[str], message: str) -> None:
    """Dropped on the page."""
    tab.value("at('error').textContent = ''")
    file = f"new File([{json.dumps(chr(10).join(lines))}], 'a.csv')"
    event = "new DragEvent('drop', { dataTransfer: files, cancelable: true })"
    tab.value(f"{{ const files = new DataTransfer(); files.items.add({file}); document.dispatchEvent({event}); }}")
    assert message in tab.wait("at('error').textContent")
    assert tab.value("at('result').hidden")
