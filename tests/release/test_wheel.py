"""Archives of a release: the wheel, built from the sdist, works in an environment of its own without a compiler."""

import json
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from built_once import built_once
from places import ROOT
from programs import output_of

from hybridsep import build_fmu, load_machine
from hybridsep.base.version import version_text
from hybridsep.fmi import compile as compiling
from hybridsep.fmi.c_header import KINDS
from hybridsep.fmi.compile import TARGETS, expanded, ready_targets

WINDOWS = sys.platform == "win32"
SCRIPTS = "Scripts" if WINDOWS else "bin"


def built(kind: str, source: Path, out: Path) -> Path:
    """Build a wheel or an sdist offline, with the libraries that this checkout has kept."""
    kept = {"HYBRIDSEP_LIBRARIES": str(compiling._cache()), "HYBRIDSEP_TARGETS": ",".join(ready_targets())}
    env = {**os.environ, **kept}
    output_of(sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", out, cwd=source, env=env)
    (archive,) = out.iterdir()
    return archive


def files_below(folder: Path) -> list[Path]:
    """Return the files of a folder of the checkout, from its root."""
    return [path.relative_to(ROOT) for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]


@pytest.fixture(scope="session")
def archives(session_folder: Path) -> Path:
    """Folder with ``sdist``, ``unpacked`` and ``wheel``, which was built from it."""

    def build(folder: Path) -> None:
        with tarfile.open(built("sdist", ROOT, folder / "sdist")) as sdist:
            sdist.extractall(folder / "unpacked", filter="data")
        (source,) = (folder / "unpacked").iterdir()
        built("wheel", source, folder / "wheel")

    return built_once(session_folder / "release", build)


@pytest.fixture(scope="session")
def scripts(archives: Path, session_folder: Path) -> Path:
    """Folder of the programs of an environment with the wheel; the packages it needs are this environment's."""

    folder = session_folder / "environment"  # it stays where it was made: its scripts name their Python

    def build(mark: Path) -> None:
        venv.create(folder, symlinks=not WINDOWS)
        python = folder / SCRIPTS / "python"
        (wheel,) = (archives / "wheel").iterdir()
        pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index"]
        output_of(*pip, wheel, cwd=folder)
        place = Path(output_of(python, "-c", "import sysconfig as s; print(s.get_path('purelib'))", cwd=folder).strip())
        shared = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
        without_zig = 'import sys; sys.modules["ziglang"] = None'
        (place / "shared.pth").write_text("\n".join([*shared, without_zig, ""]), encoding="utf-8")
        mark.touch()

    built_once(session_folder / "environment.made", build)
    return folder / SCRIPTS


@pytest.fixture
def environment(tmp_path: Path, scripts: Path) -> dict[str, str]:
    """Environment variables without a compiler, and without anything of this checkout."""
    kept = {name: os.environ[name] for name in ("SYSTEMROOT", "TEMP", "TMP") if name in os.environ}
    return {**kept, "PATH": str(scripts), "HOME": str(tmp_path), "USERPROFILE": str(tmp_path), "COLUMNS": "200"}


@pytest.mark.release
@pytest.mark.slow
def test_the_wheel_follows_from_the_sdist(archives: Path, tmp_path: Path) -> None:
    (wheel,) = (archives / "wheel").iterdir()
    assert built("wheel", ROOT, tmp_path / "wheel").read_bytes() == wheel.read_bytes()
    (source,) = (archives / "unpacked").iterdir()
    for file in (".ci/run", ".clang-format", "README.md", "tests/conftest.py"):
        assert (source / file).read_bytes() == (ROOT / file).read_bytes()
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    shipped = {tuple(name.split("/")[3:]) for name in names if name.startswith("hybridsep/_data/binaries/")}
    targets = expanded(ready_targets())
    assert shipped == {(kind, f"{key}{TARGETS[key].suffix}") for kind in KINDS for key in targets}
    assert {path.as_posix() for path in files_below(ROOT / "hybridsep")} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests/")]


@pytest.mark.release
@pytest.mark.slow
def test_the_wheel_runs_without_a_compiler(scripts: Path, environment: dict[str, str], tmp_path: Path) -> None:
    def hybridsep(*arguments: object) -> str:
        return output_of(scripts / "hybridsep", *arguments, cwd=tmp_path, env=environment)

    python = scripts / "python"
    where = output_of(python, "-c", "import hybridsep; print(hybridsep.__file__)", cwd=tmp_path, env=environment)
    assert Path(where.strip()).is_relative_to(scripts.parent)
    with_compiler = "from hybridsep.fmi.compile import compiler_for, host_target; compiler_for(host_target())"
    done = subprocess.run([python, "-c", with_compiler], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert "no C compiler" in done.stderr
    assert hybridsep("--version").strip() == f"hybridsep {version_text()}"

    hybridsep("build", "HybridPredictor", "FeedDrive", "--out", "fmus")
    machine = load_machine("spring_mass_damper")
    for name in ("HybridPredictor", "FeedDrive"):
        own = build_fmu(machine, name, tmp_path / "own", targets=ready_targets())
        assert (tmp_path / "fmus" / f"{name}.fmu").read_bytes() == own.read_bytes()

    simulate = ["cosim", "--predictor", "fmus/HybridPredictor.fmu", "--plant", "fmus/FeedDrive.fmu", "--json"]
    result = json.loads(hybridsep(*simulate))
    assert 0 < result["rms_h_um"] < 0.5 * result["rms_pb_um"]
