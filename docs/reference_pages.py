"""Pages of reference that are written from declarations: command line, machine file, FMU variables, messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import typer

from docs.messages import ERRORS, FINDINGS, Explanation
from hybridsep import load_machine
from hybridsep.app.cli import EXAMPLES, app
from hybridsep.base.files import DEFAULT_MACHINE
from hybridsep.base.parameters import Parameter
from hybridsep.base.settings import CompensatorSettings
from hybridsep.fmi.description import TERMINALS, grouped_table
from hybridsep.fmi.spec import table_of
from hybridsep.machines.machine import Machine
from hybridsep.machines.sections import Section, entries

FOLDER = Path(__file__).resolve().parent / "reference"

FMUS = {
    "HybridPredictor": "Between the interpolator and the drive: it delays the command by `Np` samples and predicts "
    "the position.",
    "SepCompensator": "In the predictor's place: it delays the command by `preview` samples and modifies it.",
    "FeedDrive": "The nonlinear drive of eq. (13), a plant to try the others with.",
    "ReferenceTrajectory": "Plays the staircase, the spiral or samples of yours, so that a system runs without a "
    "script. Built with samples (`--trajectory`) it has `3 samples` besides and starts with it; the samples in the "
    "archive set the interval.",
}
"""FMUs of the default machine, with what each is for."""

_WRITTEN = "<!-- Written by generate.py; a change here is lost. -->"

_SECTIONS = {
    "": "The head of the file.",
    "physics": "The linear model `G_pb`: either `[[physics.mode]]` entries, eq. (15), or one "
    "`[physics.spring_mass_damper]`, eq. (11), or one `[physics.cascade]`.",
    "physics.mode": "One mode, `(beta s + alpha) / (s² + 2 zeta ω s + ω²)` with `ω = 2π f_n`; each has a "
    "`[[physics.mode]]` of its own.",
    "physics.spring_mass_damper": "Moving mass, damping and stiffness.",
    "physics.cascade": "Gains of a position loop around a velocity loop: their closed loop is the model.",
    "predictor": "Settings of the predictor.",
    "compensator": "Settings of the compensator; where one is left out the setting of `[predictor]` is taken.",
    "plant": "A simulated drive, `feed_drive`, `stage`, or `identified`, which `fit` writes; it makes the plant FMU.",
    "limits": "Limits of the test trajectories.",
    "drive_limits": "What the drive allows the modified command; with it the machine gets a compensator FMU.",
    "log": "How logs of the axis are read.",
}
"""Sections of a machine file in the order of the page, with what each is for."""

_OWN = {
    "name": "name of the axis: letters, digits and underscores",
    "title": "one line of text",
    "sources": "where the data come from",
    "unit": "`m`, or `rad` for a rotary axis",
    "kind": "kind of drive",
    "log.t": "column of the time",
    "log.x_d": "column of the commanded position",
    "log.x": "column of the measured position",
    "log.error": "column of the error, commanded − measured, in the place of one of them",
    "log.unit": "unit of the positions in the file",
    "log.axis": "axis of a file that holds several",
    "physics.mode": "modes, at least one",
    "physics.spring_mass_damper": "instead of modes",
    "physics.cascade": "instead of modes",
    "plant.mode": "modes of an identified plant, with the keys of the physics model's; the same modes if left out",
    "drive_limits.estimated": "whether they are estimates from the motion of a log: your drive's own are better",
    "limits.velocity": "largest velocity of the trajectory",
    "limits.acceleration": "largest acceleration of the trajectory",
    "limits.jerk": "largest jerk of the trajectory",
}
"""What an entry means that is no parameter, or means something else in its section."""


def pages() -> dict[Path, str]:
    """Return the text of each page."""
    return {
        **command_pages(),
        FOLDER / "machine-file.md": machine_file(),
        FOLDER / "fmu.md": fmu_variables(),
        FOLDER / "messages.md": messages(),
    }


def command_pages() -> dict[Path, str]:
    """Return the page that lists the commands, and one for each with its arguments and options."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    parts = [
        "# Command line",
        _WRITTEN,
        "`hybridsep COMMAND --help` prints the same. An error is one line on standard error and exit status 2, Ctrl-C "
        "130; "
        "with `HYBRIDSEP_DEBUG=1` in the environment an unexpected error shows its traceback. "
        "[What messages mean](messages.md). Commands of plug-ins are on their pages: [`live`](../howto/live.md), "
        "[`fleet`](../howto/fleet.md), [`modal`](../howto/modal.md).",
        _table(
            ("command", "what"),
            ((f"[`{name}`](command-line/{name}.md)", one.help.partition("\n")[0]) for name, one in commands.items()),
        ),
        "```{toctree}\n:hidden:\n\n" + "\n".join(f"command-line/{name}" for name in commands) + "\n```",
    ]
    pages = {FOLDER / "command-line.md": _page(parts)}
    return pages | {FOLDER / "command-line" / f"{name}.md": _command(name, one) for name, one in commands.items()}


def _command(name: str, command: Any) -> str:
    """Return the page of a command: what it does, how it is called, its arguments, its options."""
    arguments = [one for one in command.params if not one.opts[0].startswith("-")]
    options = [one for one in command.params if one.opts[0].startswith("-")]
    usage = [f"{one.name.upper()}{'…' if one.nargs == -1 else ''}" for one in arguments]
    usage = [text if one.required else f"[{text}]" for text, one in zip(usage, arguments, strict=True)]
    parts = [
        f"# {name}",
        _WRITTEN,
        " ".join(command.help.split()),
        f"```text\n{' '.join(['hybridsep', name, *usage, '[OPTIONS]'])}\n```",
    ]
    if arguments:
        parts.append(_table(("argument", "what"), ((f"`{one.name.upper()}`", one.help) for one in arguments)))
    parts.append("```text\n" + "\n".join(EXAMPLES[name]) + "\n```")
    parts.append(_table(("option", "what"), ((_option(one), _described(one)) for one in options)))
    return _page(parts)


def machine_file() -> str:
    """Return the page of the sections and entries of a machine file."""
    parts = [
        "# Machine file",
        _WRITTEN,
        "A TOML file that says what an axis is. Values are SI; of a rotary axis (`unit = 'rad'`) wherever a unit has m "
        "it is rad. Unknown entries are refused. `hybridsep fit` and `init` write one, the library brings "
        "`spring_mass_damper`, `als25010_x`, `als25010_y` and `emps` by name; an example is in "
        "[log to FMU](../howto/log-to-fmu.md#machine-file).",
    ]
    found = dict(_sections(Machine, ""))
    for path, purpose in _SECTIONS.items():
        heading = f"`[{path}]`" if path else "Head"
        parts += [f"## {heading}", purpose, *found[path]]
    return _page(parts)


def fmu_variables() -> str:
    """Return the page of the FMUs' variables."""
    machine = load_machine(DEFAULT_MACHINE)
    parts = [
        "# FMU variables",
        _WRITTEN,
        "FMI 2.0 for co-simulation, communication step size `T_s`; [FMI 3.0](#fmi-30) below. The tables are of the "
        "machine "
        "`spring_mass_damper`; start values "
        "follow from the machine file that an FMU is built from, and there are as many `mode[i].*` as modes. "
        "[How they are wired](../howto/run-fmus.md), [when inputs are read](../explanation/timing.md).",
        "Parameters are fixed, set before the initialization has ended, but for three of SepCompensator that are "
        "tunable: `compensate`, `change_max` and `following_error_max` "
        "[may change in a run](../howto/close-the-loop.md#in-a-run).",
    ]
    for model, purpose in FMUS.items():
        parts += [f"## {model}", purpose]
        for heading, rows in grouped_table(table_of(machine, model, model).shown).items():
            cells = ((f"`{name}`", kind, start, allowed, meaning) for name, kind, _, start, allowed, meaning in rows)
            parts += [f"**{heading}**", _table(("name", "type, unit", "start", "range", "meaning"), cells)]
    types = (
        ("Real", "Float64"),
        ("Integer", "Int32"),
        ("Boolean", "Boolean"),
        ("Enumeration", "Enumeration, read and written as Int64"),
        ("`Np` of a HybridPredictor", "UInt64, a structural parameter"),
        ("`name[i]` of a window, local", "one array `name` of `Np` samples, Float64, an output"),
        ("–", "`time`, Float64, the independent variable"),
    )
    parts += [
        "## FMI 3.0",
        "Native FMUs whose names have `Fmi3` (`HybridPredictorFmi3`) are the twins of those above: the same "
        "variables, units, ranges, start values and dependencies, with other types.",
        _table(("FMI 2.0", "FMI 3.0"), types),
        "No output follows an input at once, and there are no directional derivatives. "
        "`Np` is set in Configuration Mode, or when the instance is there, and the arrays take its size; a state is "
        "taken by an instance of the same `Np`. `mode[i].*` stay scalars. There is no event mode, no early return, no "
        "intermediate update and no clock, and inputs have no derivatives. The state can be saved, restored and "
        "serialised. The "
        "`instantiationToken` differs from the FMI 2.0 twin's GUID, so states are not exchanged between the two.",
        "Terminals, each a plug whose members belong together by name:",
        _table(
            ("model", "terminal", "member: variable"),
            (
                (
                    f"`{model}`",
                    f"`{name}`",
                    ", ".join(f"{member}: `{variable}`" for member, variable in members.items()),
                )
                for model, terminals in TERMINALS.items()
                for name, members in terminals.items()
            ),
        ),
        "## Other machines",
        "A plant of kind `stage` or `identified` has `mode[i].*`, the friction `f`, the velocity `friction_on` that it "
        "acts on, the velocity `v_friction` over which it changes sign, the cable stiffness `kappa`, and sampling "
        "interval `T_s`, `dead_time` and `input_hold` of the command instead of `m`, `c`, `k`, `c_nl`, `k_nl`. "
        "An identified one is the model that a log gave, for trying: no measurement. "
        "FMUs are named "
        "after their machine (`HybridPredictor_als25010_x`), but of `spring_mass_damper` plainly; the Python flavour "
        "ends in `Py`, FMI 3.0 in `Fmi3`, before the machine.",
    ]
    return _page(parts)


def messages() -> str:
    """Return the page of exceptions and findings with cause and remedy."""
    parts = [
        "# What a message means",
        _WRITTEN,
        "On the command line an error is one line, `error: …`; in Python it is one of the [exceptions](#exceptions). "
        "Where it "
        "speaks of a log, it may be a [finding of the log's checks](#findings); others are printed as `note: …`.",
    ]
    rows = ((f"`{text}`", f"[{name}](#{name.lower()})") for name, one in ERRORS.items() for text in one.printed)
    parts += [
        _table(("a message with", "is a"), rows),
        "## Findings",
        "For the first eleven a log is refused: its columns do not mean what they were read for. The others are "
        "**notes**, each with its statistic; the report shows both positions below them; nothing is changed for them.",
    ]
    for name, one in FINDINGS.items():
        parts += [f"### {name}", *_explained(one)]
    parts += ["## Exceptions"]
    for name, one in ERRORS.items():
        parts += [f"### {name}", *_explained(one)]
    return _page(parts)


def _explained(one: Explanation) -> tuple[str, str]:
    return f"**Cause.** {one.cause}", f"**Remedy.** {one.remedy}"


def _option(one: Any) -> str:
    names = ", ".join(f"`{name}`" for name in one.opts if name.count("-") <= 2 or "_" not in "".join(one.opts))
    return names + ("" if one.is_flag or not one.metavar else f" {one.metavar}")


def _described(one: Any) -> str:
    text = " ".join((one.help or "").split())
    text = text[:1].upper() + text[1:]
    default = one.default
    if default is not None and default is not False and not callable(default) and default not in ((), []):
        text += f" Default: `{default}`."
    return text + (" Required." if one.required else "")


def _sections(section: type[Section], path: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each section's path and tables, its own before those inside it."""
    rows, inner = [], []
    for entry, field in entries(section).items():
        place = f"{path}.{entry}" if path else entry
        if "settings" in field.metadata or "sections" in field.metadata:
            inner.append((place, field.metadata))
            if place in _OWN:
                rows.append((f"`{entry}`", "table", "", _OWN[place]))
        else:
            rows.append(_entry(entry, place, field.default, field.metadata))
    yield path, [_entries_table(rows)] if rows else []
    for place, found in inner:
        if "settings" in found:
            settings = found["settings"].items()
            yield place, [_entries_table(_setting(entry, f"{place}.{entry}", one) for entry, (_, one) in settings)]
        elif len(found["sections"]) == 1:
            yield from _sections(found["sections"][0], place)
        else:
            tables = []
            for one in found["sections"]:
                [kind] = entries(one)["kind"].metadata["choices"]
                tables += [f'`kind = "{kind}"`:', *next(_sections(one, place))[1]]
            yield place, tables


def _entries_table(rows: Iterable[tuple[str, ...]]) -> str:
    return _table(("entry", "type, unit", "if left out", "meaning"), rows)


def _setting(entry: str, place: str, parameter: Parameter) -> tuple[str, str, str, str]:
    """Return the row of an entry of ``[predictor]`` or ``[compensator]``."""
    row = _entry(entry, place, parameter.default, {"parameter": parameter})
    if place.startswith("compensator.") and _LIBRARY.get(entry) is None:
        row = (*row[:2], "automatic" if entry in _LIBRARY else "as `[predictor]`", row[3])
    return row


def _entry(entry: str, place: str, default: Any, found: Mapping[str, Any]) -> tuple[str, str, str, str]:
    default = "required" if default is MISSING else _shown(default)
    parameter = found.get("parameter")
    if parameter is None:
        items = [str(item) for item in found.get("choices", ())]
        return (
            f"`{entry}`",
            " or ".join(f"`{item}`" for item in items)
            or ("true or false" if default in ("`true`", "`false`") else "text"),
            default,
            _OWN.get(place) or _OWN[entry],
        )
    unit = "" if parameter.unit == "1" else f", {parameter.unit}"
    kind = {int: "whole number", float: "number", bool: "true or false", str: ""}[parameter.kind]
    span = "" if parameter.kind is bool else f" ({parameter.range_text})" if kind else parameter.range_text
    return f"`{entry}`", f"{kind}{unit}{span}", default, _OWN.get(place) or parameter.description


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    if value == () or value == "":
        return "empty"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def _page(parts: Iterable[str]) -> str:
    return "\n\n".join(parts) + "\n"


_LIBRARY = {one.name: one.default for one in fields(CompensatorSettings)}
"""Defaults of a compensator's settings in the library; None: automatic."""
