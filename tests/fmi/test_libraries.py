"""Where the libraries of native FMUs come from: a wheel, a checkout's own, a compiler."""

import os
import re
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import Run
from places import ROOT
from programs import output_of

from hybridsep import load_machine
from hybridsep.base.errors import FmuError
from hybridsep.fmi import compile as module
from hybridsep.fmi.archive import build_here, other_platforms
from hybridsep.fmi.c_header import KINDS, c_sources
from hybridsep.fmi.compile import (
    ALL_TARGETS,
    TARGETS,
    ZIG,
    chosen_targets,
    compiler_for,
    default_targets,
    expanded,
    host_target,
    kept,
    libraries,
    library_paths,
    no_native,
    ready_targets,
)

ALL = [(kind, target) for kind in KINDS for target in ALL_TARGETS]


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine without compilers and kept libraries; the folder where they would be kept."""
    monkeypatch.setattr("hybridsep.fmi.compile.find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("HYBRIDSEP_TARGETS")
    monkeypatch.setenv("HYBRIDSEP_LIBRARIES", str(tmp_path / "kept"))
    monkeypatch.setattr(module, "_SHIPPED", tmp_path / "shipped")
    return tmp_path


def fill(folder: Path, wanted: list[tuple[str, str]]) -> None:
    for kind, target in wanted:
        (folder / kind).mkdir(parents=True, exist_ok=True)
        (folder / kind / f"{target}{TARGETS[target].suffix}").write_bytes(f"{kind} for {target}".encode())


def test_without_compiler_and_libraries_build_says_what_to_do(without: Path, hybridsep: Run) -> None:
    assert "pip install ziglang" in no_native()
    assert default_targets() == ("host",)
    error = hybridsep.refused("build", "FeedDrive", "--target", "host", "--out", without)
    assert "no C compiler: no ziglang and none of $CC, cc, gcc, clang; pip install ziglang" in " ".join(error.split())
    error = hybridsep.refused("build", "FeedDrive", "--target", "win64", "--out", without)
    pinned = ZIG.replace(" ", "==")
    needs = f"compiling for x86_64-windows needs ziglang: pip install {pinned}, or --target host"
    assert needs in " ".join(error.split())


def test_the_libraries_of_a_wheel_need_no_compiler(without: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(without / "shipped", ALL)
    assert not no_native()
    assert default_targets() == ready_targets() == ALL_TARGETS
    monkeypatch.setenv("HYBRIDSEP_TARGETS", "win64,x86_64-linux")
    assert default_targets() == ("x86_64-windows", "x86_64-linux")
    found = libraries("FeedDrive", ("host", "darwin64"))
    assert found == {
        target: f"FeedDrive for {target}".encode() for target in (host_target(), "x86_64-darwin", "aarch64-darwin")
    }


def test_a_wheel_has_this_machines_libraries_or_chosen_ones(without: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert chosen_targets() == (host_target(),)
    for chosen, targets in (("all", ALL_TARGETS), ("none", ()), ("host,win32", (host_target(), "x86-windows"))):
        monkeypatch.setenv("HYBRIDSEP_TARGETS", chosen)
        assert chosen_targets() == targets


def test_a_command_of_its_own_does_not_wait_for_other_platforms(without: Path) -> None:
    fill(without / "shipped", [(kind, host_target()) for kind in KINDS])
    assert not no_native()
    assert default_targets() == ready_targets() == ("host",)
    with pytest.raises(FmuError, match=r"compiling for .* needs ziglang"):
        libraries("FeedDrive", [target for target in ALL_TARGETS if target != host_target()])


def test_the_line_for_all_platforms_builds_the_same_fmu(hybridsep: Run, tmp_path: Path) -> None:
    """As ``fit`` prints it; run for only this machine."""
    machine = tmp_path / "axis.toml"
    hybridsep("init", machine)
    fmu = build_here(load_machine(machine), "HybridPredictor", tmp_path)
    says, line = other_platforms(fmu, machine)
    program, *arguments = shlex.split(line)
    assert (says, program) == (f"native FMUs are for {host_target()}; for all platforms", "hybridsep")
    first = fmu.read_bytes()
    fmu.unlink()
    hybridsep.done(*("host" if word == "all" else word for word in arguments))
    assert fmu.read_bytes() == first


def test_nothing_is_said_of_platforms_where_all_are_there(without: Path) -> None:
    fmu, machine, weights = Path("axis/HybridPredictor.fmu"), Path("axis/machine.toml"), Path("axis/trained.state")
    line = f"build HybridPredictor --target all -m {machine} --weights {weights} --out axis"
    assert other_platforms(fmu, machine, weights)[1].endswith(line)
    fill(without / "shipped", ALL)
    assert other_platforms(fmu, machine, weights) == ()


def test_what_is_missing_is_compiled_once_all_of_it_together(without: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a wheel's installation in the user's cache; the compiler is a stand-in that makes a file of its arguments."""
    fill(without / "shipped", [("FeedDrive", target) for target in ALL_TARGETS[:2]])
    program = "import sys; open(sys.argv[sys.argv.index('-o') + 1], 'w').write(sys.argv[-1])"
    compiler = (sys.executable, "-c", program), ZIG
    monkeypatch.setattr(module, "compiler_for", lambda target: compiler)
    wanted = [(kind, target) for target in ALL_TARGETS[:3] for kind in ("FeedDrive", "StageDrive")]
    began: list[tuple[str, str]] = []
    paths = library_paths(wanted, lambda library, _done: began.append(library))
    assert began == [library for library in wanted if library not in [("FeedDrive", t) for t in ALL_TARGETS[:2]]]
    assert all(path.is_relative_to(without / "kept") for library, path in paths.items() if library in began)
    assert library_paths(wanted, lambda library, _done: began.append(library)) == paths
    assert len(began) == 4


def test_a_library_is_kept_where_a_later_one_is_interrupted(without: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = "import sys; open(sys.argv[sys.argv.index('-o') + 1], 'w')"
    monkeypatch.setattr(module, "compiler_for", lambda target: ((sys.executable, "-c", program), ZIG))
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    wanted = [("FeedDrive", target) for target in ALL_TARGETS[:3]]

    def interrupt_at_the_second(library: tuple[str, str], _done: float) -> None:
        if library == wanted[1]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        library_paths(wanted, interrupt_at_the_second)
    assert [kept(library) is not None for library in wanted] == [True, True, False]


def test_what_was_compiled_is_kept_by_sources_and_compiler(without: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = module._place(ZIG, ("FeedDrive", "x86_64-linux"))
    assert place.parent.parent.parent == without / "kept"
    assert module._place("ziglang 0.1", ("FeedDrive", "x86_64-linux")) != place
    fill(place.parent.parent, [("FeedDrive", "x86_64-linux")])
    assert kept(("FeedDrive", "x86_64-linux")) == place
    monkeypatch.setattr(module, "c_sources", lambda: {**c_sources(), "all.c": b"int other;"})
    module._version.cache_clear()
    assert kept(("FeedDrive", "x86_64-linux")) is None
    module._version.cache_clear()


def test_only_a_few_versions_are_kept(without: Path) -> None:
    for i in range(7):
        fill(without / "kept" / f"version {i}", [("FeedDrive", "x86_64-linux")])
    module._forget_old_versions()
    assert len(list((without / "kept").iterdir())) == 4


def test_the_build_requirement_is_the_compiler_of_the_libraries() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert set(re.findall(r'"(ziglang==[\d.]+)', project)) == {ZIG.replace(" ", "==")}


def test_names_of_platforms() -> None:
    assert expanded(("linux64", "host", "x86_64-linux", "win32"))[0] == "x86_64-linux"
    assert len(expanded(("linux64", "x86_64-linux"))) == 1
    assert expanded(("win32", "all"))[0] == "x86-windows"
    assert set(expanded(("win32", "all"))) == set(ALL_TARGETS)
    with pytest.raises(FmuError, match="no target sparc; there are host, all, x86_64-linux"):
        expanded(("sparc",))


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang")
@pytest.mark.parametrize(
    "target",
    [pytest.param(target, marks=[] if target == "x86-windows" else [pytest.mark.release]) for target in ALL_TARGETS],
)
def test_the_look_ahead_fmus_compile_for_every_platform(tmp_path: Path, target: str) -> None:
    """Without optimisation; ``test_all_platforms`` links a drive's library, and libm is all that these need besides."""
    for kind in ("HybridPredictor", "SepCompensator"):
        for file, content in module._sources(kind).items():
            (tmp_path / file).write_bytes(content)
        flags = ["-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-D_GNU_SOURCE", "-I."]
        output_of(*compiler_for(target)[0], *flags, "-c", "all.c", "-o", "all.o", cwd=tmp_path)
