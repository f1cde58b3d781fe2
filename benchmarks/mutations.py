"""Random damage to files of every kind that the command line reads, for :mod:`benchmarks.hostile`.

Half of the damage goes past checksums: arrays, members of archives and saved states are changed and sealed again.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import stat
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import h5py
import numpy as np
from scipy import io as scipy_io

from benchmarks import recorders
from hybridsep import HybridPredictor, build_fmu, load_machine
from hybridsep.base.settings import PredictorSettings
from hybridsep.machines.machine import machine_path
from hybridsep.plants.trajectory import staircase

__all__ = ["FMUS", "KINDS", "MACHINE", "good_log", "log_text", "mutated", "originals"]

MACHINE = "spring_mass_damper"
FMUS = ("HybridPredictor", "FeedDrive", "HybridPredictorPy", "FeedDrivePy")

TOKENS = (
    *("", "-", ".", "+", "nan", "NaN", "inf", "-inf", "Infinity", "null", "true", "[]", "{}", '""', "0", "-1", "1e308"),
    *("-1e308", "1e-320", "1e400", "9" * 400, "9" * 5000, "0x10", "1_0", "1,5", "2147483648", "18446744073709551616"),
    *("\0", "\ufeff", "\u0661", "µm", "\U0001f600", "\\", '"', "'", "\n", "\r", "\t", ";", "#", "%", "<", "&", "]]>"),
    *("[" * 2000, "(" * 300, "{" * 300, '{"a":' * 2000, "-" * 3000, "a." * 3000, "a" * 3000, "../" * 5, "/dev/zero"),
    *("2026-03-05 10:20:30.5", "12:00:00", "1970-01-01T00:00:00Z", "x [mm]", "x [parsec]"),
)
"""Texts that stand where a number, a word or a sign was."""

_SEARCHED_MAX = 2**20
"""Bytes of a text in which a token is looked for: a member of 110 MB would have as many."""

_TOKEN = re.compile(rb"[A-Za-z_]\w*|[-+]?[\d.]+(?:[eE][-+]?\d+)?|[^\s\w]")
_NUMBERS = (0.0, -1.0, 1e-320, 1e9, 1e99, 1e308, float("nan"), float("inf"), float("-inf"))
_EVIL = ("../evil", "/tmp/evil", "C:/evil", "a\\b", "resources/x/../../../evil", "modelDescription.xml", "x" * 70_000)


def good_log() -> dict[str, Any]:
    """Return a short log of the machine: 300 samples at 1 kHz of a move, with some noise."""
    whole = staircase()
    x_d = np.concatenate((np.full(50, whole[0]), whole[:250]))
    x = np.concatenate((np.full(4, x_d[0]), x_d[:-4])) + np.random.default_rng(0).normal(0.0, 2e-6, len(x_d))
    return {"t": np.arange(len(x_d)) * 1e-3, "x_d": x_d, "x": x}


def log_text(log: Mapping[str, Any], delimiter: str = ",") -> bytes:
    """Return a log as text."""
    rows = zip(*log.values(), strict=True)
    lines = [delimiter.join(log), *(delimiter.join(map(repr, map(float, row))) for row in rows)]
    return "\n".join(lines).encode() + b"\n"


def originals(kind: str, folder: Path) -> list[tuple[str, bytes]]:
    """Return the intact files of a kind: names and contents."""
    return [(name, content) for name, content in KINDS[kind][0](folder)]


def mutated(kind: str, content: bytes, chance: Random) -> bytes:
    """Return a file of a kind with some damage."""
    damage = KINDS[kind][1]
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        content = (damage if chance.random() < 0.6 else broken)(content, chance)
    return content


def broken(content: bytes, chance: Random) -> bytes:
    """Change bytes anywhere, the first ones more often: headers are there."""
    if not content:
        return bytes([chance.randrange(256)])
    end = len(content) if chance.random() < 0.5 else min(len(content), 512)
    place, length = chance.randrange(end), chance.choice((1, 1, 1, 2, 4, 8, 64, 1000))
    head, rest = content[:place], content[place:]
    match chance.randrange(9):
        case 0:
            return head
        case 1:
            return head + rest[length:]
        case 2:
            return head + rest[:length] * chance.choice((2, 3, 50)) + rest
        case 3:
            return head + chance.randbytes(length) + rest[length:]
        case 4:
            return head + chance.choice((b"\0", b"\xff", b"\x7f", b"\x80")) * length + rest[length:]
        case 5:
            return head + chance.randbytes(length) + rest
        case 6:
            return rest + head
        case _:
            return head + bytes([rest[0] ^ 1 << chance.randrange(8)]) + rest[1:]


def retold(content: bytes, chance: Random) -> bytes:
    """Replace, repeat or leave out a word, a number or a sign of a text."""
    end = 20_000 if chance.random() < 0.7 else _SEARCHED_MAX
    tokens = [token.span() for token in _TOKEN.finditer(content[:end])]
    if not tokens:
        return broken(content, chance)
    (a, b), (c, d) = chance.choice(tokens), chance.choice(tokens)
    new = chance.choice((chance.choice(TOKENS).encode(), content[c:d], b"", content[a:b] * 2))
    return content[:a] + new + content[b:]


# Logs ---------------------------------------------------------------------------------------------------------------


def _texts(_: Path) -> list[tuple[str, bytes]]:
    log = good_log()
    stamps = "".join(
        f"10:20:{30 + t:09.6f};{1e3 * x_d:.9g};{1e3 * x:.9g}\n" for t, x_d, x in zip(*log.values(), strict=True)
    )
    named = b"# scope\nTime;pos_cmd;pos_act\ns;mm;mm\n" + stamps.encode()
    return [("log.csv", log_text(log)), ("log.tsv", log_text(log, "\t")), ("stamps.csv", named)]


def _text(content: bytes, chance: Random) -> bytes:
    found = retold(content, chance)
    return gzip.compress(found, mtime=0) if chance.random() < 0.05 else found


def _npz_files(_: Path) -> list[tuple[str, bytes]]:
    plain, packed = io.BytesIO(), io.BytesIO()
    np.savez(plain, **good_log())
    np.savez_compressed(packed, **good_log())
    return [("plain.npz", plain.getvalue()), ("packed.npz", packed.getvalue())]


def _npz(content: bytes, chance: Random) -> bytes:
    def header(name: str, member: bytes) -> bytes:
        return (retold if chance.random() < 0.5 else broken)(member[:128], chance) + member[128:]

    return _resealed(content, chance, header)


def _mat_files(_: Path) -> list[tuple[str, bytes]]:
    files = []
    for name, how in (("5.mat", {}), ("4.mat", {"format": "4"}), ("packed.mat", {"do_compression": True})):
        stream = io.BytesIO()
        scipy_io.savemat(stream, good_log(), **how)
        files.append((name, stream.getvalue()))
    stream = io.BytesIO()
    scipy_io.savemat(stream, good_log() | {"log": good_log(), "name": "axis"})
    return [*files, ("struct.mat", stream.getvalue())]


def _hdf5_files(_: Path) -> list[tuple[str, bytes]]:
    files = []
    for name, how in (("plain.h5", {}), ("chunked.h5", {"chunks": (100,), "compression": "gzip"})):
        stream = io.BytesIO()
        with h5py.File(stream, "w") as file:
            for column, values in good_log().items():
                file.create_dataset(column, data=values, **how)
        files.append((name, stream.getvalue()))
    return files


def _capture_files(_: Path) -> list[tuple[str, bytes]]:
    log = good_log()
    names = ("CYCLE", "DES_POS|1", "ENC_POS|1")
    signals = [{"Name": name, "Axis": axis} for name, axis in zip(names, ("Cycle", "X1", "X1"), strict=True)]
    rows = [[k, 1e3 * float(x_d), 1e3 * float(x)] for k, (x_d, x) in enumerate(zip(log["x_d"], log["x"], strict=True))]
    header = {"CycleTimeMs": 1, "SignalListHFData": signals}
    content = {"Header": header, "Payload": [{"HFData": rows[:100]}, {"HFBlockEvent": {}}, {"HFData": rows[100:]}]}
    return [("capture.json", json.dumps(content).encode())]


def _mdf_files(folder: Path) -> list[tuple[str, bytes]]:
    log, files = good_log(), []
    for name, version in (("4.mf4", "4.10"), ("3.mf4", "3.30")):
        files.append((name, recorders.write_mdf(folder / "good.mf4", [log], version).read_bytes()))
    return files


def _rated() -> dict[str, tuple[float, Any]]:
    return {name: (1e-3, values) for name, values in good_log().items() if name != "t"}


def _tdms_files(folder: Path) -> list[tuple[str, bytes]]:
    return [("log.tdms", recorders.write_tdms(folder / "good.tdms", _rated()).read_bytes())]


def _parquet_files(folder: Path) -> list[tuple[str, bytes]]:
    return [("log.parquet", recorders.write_parquet(folder / "good.parquet", good_log(), 100).read_bytes())]


def _arrow_files(folder: Path) -> list[tuple[str, bytes]]:
    path = folder / "good.arrow"
    return [
        (f"{name}.arrow", recorders.write_arrow(path, good_log(), stream=stream).read_bytes())
        for name, stream in (("file", False), ("stream", True))
    ]


def _xlsx_files(folder: Path) -> list[tuple[str, bytes]]:
    return [("log.xlsx", recorders.write_xlsx(folder / "good.xlsx", good_log()).read_bytes())]


def _xlsx(content: bytes, chance: Random) -> bytes:
    return _resealed(content, chance, lambda _, member: (retold if chance.random() < 0.7 else broken)(member, chance))


def _sinumerik_files(_: Path) -> list[tuple[str, bytes]]:
    log = good_log()
    signals = {f"{name} [u1, 1]": (0.0, 1e-3, 1e3 * log[key]) for name, key in (("CmdPos", "x_d"), ("ActPos", "x"))}
    return [("trace.xml", recorders.trace_xml(signals).encode())]


def _twincat_files(_: Path) -> list[tuple[str, bytes]]:
    return [(f"scope{i}.csv", recorders.twincat_csv(_rated(), full=bool(i), shared=bool(i)).encode()) for i in range(2)]


def _halscope_files(_: Path) -> list[tuple[str, bytes]]:
    log = {f"joint.0.motor-pos-{name}": good_log()[key] for name, key in (("cmd", "x_d"), ("fb", "x"))}
    pairs = recorders.halscope_pairs(log, comma=True)
    return [("log.csv", recorders.halscope_csv(log).encode()), ("pairs.txt", pairs.encode())]


# Machine files and states -------------------------------------------------------------------------------------------


def _machine_files(_: Path) -> list[tuple[str, bytes]]:
    return [(f"{name}.toml", machine_path(name).read_bytes()) for name in (MACHINE, "als25010_x")]


def _states(_: Path) -> list[tuple[str, bytes]]:
    files, log = [], good_log()
    for trust in (False, True):
        settings = PredictorSettings(trust=trust, Np=20, p=3, q=2, t_init=0.0)
        predictor = HybridPredictor(load_machine(MACHINE).model, settings)
        for i in range(0, 300, 20):
            predictor.predict(log["x_d"][i : i + 20])
            predictor.update(log["x"][i : i + 20])
        files.append((f"trust_{trust}.state", predictor.to_bytes()))
    return files


def _state(blob: bytes, chance: Random) -> bytes:
    """Change a saved state, or one of its parts, and repair its checksums."""
    if len(blob) < 20 or blob[:4] != b"HSEP":
        return broken(blob, chance)
    _, version, length = struct.unpack_from("<4sII", blob)
    header, body = blob[12 : 12 + length], blob[12 + length : -4]
    part = body.rfind(b"HSEP")
    if part >= 0 and chance.random() < 0.5:
        body = body[:part] + _state(body[part:], chance)
    elif chance.random() < 0.5 and len(body) >= 8:
        place = 8 * chance.randrange(len(body) // 8)
        body = body[:place] + struct.pack("<d", chance.choice(_NUMBERS)) + body[place + 8 :]
    else:
        header = retold(header, chance)
    sealed = struct.pack("<4sII", b"HSEP", version, len(header)) + header + body
    return sealed + struct.pack("<I", zlib.crc32(sealed))


# FMUs ---------------------------------------------------------------------------------------------------------------


def _fmus(folder: Path) -> list[tuple[str, bytes]]:
    machine, files = load_machine(MACHINE), []
    for name in FMUS:
        how = {"flavour": "python"} if name.endswith("Py") else {"flavour": "native", "targets": ("host",)}
        files.append((f"{name}.fmu", build_fmu(machine, name, folder, **how).read_bytes()))
    return files


def _fmu(content: bytes, chance: Random) -> bytes:
    if chance.random() < 0.15:
        return _with_evil_member(content, chance)
    chosen = chance.choice(("modelDescription.xml", "modelDescription.xml", ".so", ".so", ""))

    def member(name: str, text: bytes) -> bytes:
        return (retold if name.endswith((".xml", ".py", ".json", ".txt")) and chance.random() < 0.6 else broken)(
            text, chance
        )

    return _resealed(content, chance, member, chosen)


def _resealed(content: bytes, chance: Random, change: Callable[[str, bytes], bytes], ending: str = "") -> bytes:
    """Change one member of an archive, or leave it out, and write it again with its checksum."""
    stream = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as old:
            members = {name: old.read(name) for name in old.namelist()}
    except Exception:
        return broken(content, chance)
    name = chance.choice([name for name in members if name.endswith(ending)] or list(members) or [""])
    method = chance.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(stream, "w") as new:
        for other, text in members.items():
            if other != name:
                new.writestr(zipfile.ZipInfo(other), text, method)
            elif chance.random() < 0.95:
                new.writestr(zipfile.ZipInfo(other), change(name, text), method)
    return stream.getvalue()


def _with_evil_member(content: bytes, chance: Random) -> bytes:
    """Add a member that is a link, has an evil name, occurs twice, or is large."""
    stream = io.BytesIO(content)
    member = zipfile.ZipInfo(chance.choice(_EVIL))
    text = chance.choice((b"evil", bytes(2**20), bytes(110 * 2**20)) if chance.random() < 0.2 else (b"evil",))
    if chance.random() < 0.3:
        member.filename, member.external_attr = "resources/link", (stat.S_IFLNK | 0o777) << 16
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a member that occurs twice
            with zipfile.ZipFile(stream, "a", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr(member, text, zipfile.ZIP_DEFLATED)
    except Exception:
        return broken(content, chance)
    return stream.getvalue()


Originals = Callable[[Path], list[tuple[str, bytes]]]
Damage = Callable[[bytes, Random], bytes]

KINDS: Mapping[str, tuple[Originals, Damage]] = {
    "text": (_texts, _text),
    "npz": (_npz_files, _npz),
    "mat": (_mat_files, broken),
    "hdf5": (_hdf5_files, broken),
    "capture": (_capture_files, retold),
    "mdf": (_mdf_files, broken),
    "tdms": (_tdms_files, broken),
    "parquet": (_parquet_files, broken),
    "arrow": (_arrow_files, broken),
    "xlsx": (_xlsx_files, _xlsx),
    "sinumerik": (_sinumerik_files, retold),
    "twincat": (_twincat_files, retold),
    "halscope": (_halscope_files, retold),
    "machine": (_machine_files, retold),
    "state": (_states, _state),
    "fmu": (_fmus, _fmu),
}
"""Kinds of files: their intact originals, and the damage that is their own."""
