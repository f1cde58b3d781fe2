"""Binaries for other platforms against x86-64 Linux, under Wine and qemu where installed; of nights and releases."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from pathlib import Path

import pytest
from foreign import compare

pytestmark = [pytest.mark.nightly, pytest.mark.release]

TOLERANCE = 1e-12  # m


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The FMUs and their host, compiled for every platform that can be run here."""
    folder = tmp_path_factory.mktemp("foreign")
    compare.build(folder, [compare.HERE, *(there for there in compare.FOREIGN.values() if there.runs)])
    yield folder
    compare.end_wine(folder)


@pytest.mark.slow
@pytest.mark.skipif(
    (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="the comparison starts from x86-64 Linux"
)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.skipif(not there.runs, reason=f"needs apt-get install {there.packages}"))
        for name, there in compare.FOREIGN.items()
    ],
)
def test_outputs_are_those_of_linux(request: pytest.FixtureRequest, name: str) -> None:
    deviations = compare.deviations(request.getfixturevalue("out"), compare.FOREIGN[name])
    assert set(deviations) == {f"{model}.{output}" for model, outputs in compare.OUTPUTS.items() for output in outputs}
    assert {name: deviation for name, deviation in deviations.items() if not deviation <= TOLERANCE} == {}
