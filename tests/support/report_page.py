"""What draws the charts of a report's page."""

from __future__ import annotations

import re
import zlib

import numpy as np

from hybridsep.evaluate.chart_script import DIGITS


def scripts(page: str) -> str:
    """Return plotly.js and what draws the charts, digit by digit as a browser unpacks it."""
    found = re.search(r'<script type="text/plain" id="packed" data-bytes="(\d+)">([^<]*)</script>', page)
    assert found
    places = {digit: value for value, digit in enumerate(DIGITS)}
    assert len(places) == 85
    digits = np.array([places[digit] for digit in found[2]], dtype=np.uint64).reshape(-1, 5)
    words = digits @ 85 ** np.arange(4, -1, -1, dtype=np.uint64)
    return zlib.decompress(words.astype(">u4").tobytes()[: int(found[1])]).decode("utf-8")
