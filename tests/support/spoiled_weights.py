"""Weights files that must be refused, most of them with the checksum of their content."""

import struct
import zlib

_HEAD, _SETTING = 32, 32  # bytes of the head, and of a setting: its name in 24, its value


def sealed(body: bytes) -> bytes:
    """Append the checksum that makes any content pass for undamaged."""
    return body + struct.pack("<Q", zlib.crc32(body))


def spoiled(content: bytes) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """Return what is damaged, and what was learned with other settings, by what is wrong.

    ``content``: of a good file, of a model with one mode at least.
    """
    body = content[:-8]
    n_settings, n_modes, n_learned = struct.unpack_from("<3Q", body, 8)
    settings = [body[_HEAD + _SETTING * i : _HEAD + _SETTING * (i + 1)] for i in range(n_settings)]
    after = body[_HEAD + _SETTING * n_settings :]
    names = [setting[:24].rstrip(b"\0") for setting in settings]

    def with_setting(i: int, name: bytes, value: float) -> bytes:
        changed = [*settings[:i], struct.pack("<24sd", name, value), *settings[i + 1 :]]
        return sealed(body[:_HEAD] + b"".join(changed) + after)

    def with_head(place: int, number: int) -> bytes:
        at = 8 + 8 * place
        return sealed(body[:at] + struct.pack("<Q", number) + body[at + 8 :])

    first_mode = next(i for i, name in enumerate(names) if name.startswith(b"mode["))
    numbers = _HEAD + _SETTING * n_settings
    damaged = {
        "nothing": b"",
        "no checksum": content[:-1],
        "a number that was changed": content[:-16] + bytes([content[-16] ^ 1]) + content[-15:],
        "only a checksum": sealed(b""),
        "a head that is cut": sealed(body[:20]),
        "another version": sealed(b"HSEPWG00" + body[8:]),
        "settings that are cut": sealed(body[: _HEAD + 40]),
        "a name without an end": with_setting(0, b"x" * 24, 1.0),
        "another number of numbers": with_head(2, n_learned + 1),
        "numbers that are cut": sealed(body[: numbers + 8]),
        "a factor that is cut": sealed(body[:-8]),
        "a number that is none": sealed(body[:numbers] + struct.pack("<d", float("nan")) + body[numbers + 8 :]),
        "a factor that is not finite": sealed(body[:-8] + struct.pack("<d", float("inf"))),
        "more after it": sealed(body + bytes(8)),
    }
    other = {f"another {name.decode()}": with_setting(i, name, -7.5) for i, name in enumerate(names)}
    other |= {
        "another number of settings": with_head(0, n_settings - 1),
        "another number of modes": with_head(1, n_modes + 1),
        "a setting that nothing depends on": with_setting(0, b"Np", 1.0),
        "a mode that is not there": with_setting(first_mode, b"mode[99].f_n", 1.0),
        "no number of a mode": with_setting(first_mode, b"mode[1].mass", 1.0),
    }
    return damaged, other
