"""The teleop client's live screen. Pure: a model in, something rich can print out."""

from __future__ import annotations

import textwrap
from typing import Final

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from robot.faults import TABLE
from robot.hal.teleop.frames import Button
from robot.teleop_model import ClientModel, axes, buttons

WIDTH: Final = 78
_BAR: Final = 21
_NAMES: Final = {" ": "space", "interrupt": "Ctrl-C", "": "none yet"}
_STATE_STYLES: Final = {"teleop": "bold green", "idle": "bold", "halted": "bold red"}
_KEYS: Final = (
    ("u i o", "drive (hold the key;", "t", "take", "space", "stop"),
    ("j k l", "the arrow keys too)", "r", "release", "q/z", "all speeds"),
    ("m , .", "k or any other: stop", "g", "give back", "w/x e/c", "forward, turning"),
)
_PAD: Final = "gamepad: left stick drives, A take, B stop, X give back, Y release"


def render(model: ClientModel, port: str, link: str, now: float) -> RenderableType:
    """The whole screen. link: what is wrong with the port, empty if nothing is."""
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim", width=8)
    facts.add_column(no_wrap=True, overflow="ellipsis", width=WIDTH - 14)  # a steady height
    for name, value in _facts(model, link, now):
        facts.add_row(name, value)
    parts: list[RenderableType] = [facts, Text(), _help()]
    if model.pad.present:
        parts.append(Text(_PAD, style="dim"))
    return Panel(
        Group(*parts), title=f"robot teleop {port}", subtitle="Ctrl-C ends: stop, release", width=WIDTH
    )


def _facts(model: ClientModel, link: str, now: float) -> list[tuple[str, Text]]:
    robot = model.robot if model.heard(now) else None
    v, w = axes(model, now)
    nothing = Text("?", style="dim")
    return [
        ("link", _link(model, link, now)),
        ("robot", _robot(model) if robot else nothing),
        ("wheels", Text(f"{robot.v:+.2f} m/s   {robot.w:+.2f} rad/s") if robot else nothing),
        ("battery", Text("?" if robot.volts is None else f"{robot.volts:.1f} V") if robot else nothing),
        *(_notice(robot.trouble) if robot else [("notice", nothing), ("", Text())]),
        ("forward", _bar(v, "ahead", "back")),
        ("turning", _bar(-w, "right", "left")),
        (
            "speeds",
            Text(f"forward {model.speeds.forward:.0%}, turning {model.speeds.turning:.0%} of the top"),
        ),
        ("input", _input(model, now)),
    ]


def _notice(trouble: str) -> list[tuple[str, Text]]:
    """What holds the robot up, two lines always; a fault with its cure out of the table."""
    if not trouble:
        return [("notice", Text("none")), ("", Text())]
    key = trouble.removeprefix("! ").split(" ")[0]
    words = f"{trouble.removeprefix('! ')}: {TABLE[key].words}" if key in TABLE else trouble
    lines = [*textwrap.wrap(words, WIDTH - 14, max_lines=2, placeholder=" ..."), ""][:2]
    return [("notice", Text(lines[0], style="yellow")), ("", Text(lines[1], style="yellow"))]


def _link(model: ClientModel, link: str, now: float) -> Text:
    if link:
        return Text(link, style="bold red")
    if model.status is None:
        return Text("no answer yet: is the robot running, its teleop on?", style="yellow")
    if not model.heard(now):
        return Text(f"no answer for {now - model.status_at:.0f} s", style="bold red")
    delay = f", {model.delay_s * 1e3:.0f} ms there and back" if model.delay_s is not None else ""
    return Text("answers" + delay, style="green")


def _robot(model: ClientModel) -> Text:
    robot = model.robot
    if robot is None:
        return Text(model.status.text if model.status else "")
    return Text.assemble(
        (robot.state.upper(), _STATE_STYLES.get(robot.state, "bold cyan")), f"   {robot.who}"
    )


def _bar(share: float, above: str, below: str) -> Text:
    """A bar with its middle marked, and in words which way it goes: `above` (right of it) or `below`."""
    half = _BAR // 2
    filled = round(abs(share) * half)
    cells = ["·"] * _BAR
    for step in range(1, filled + 1):
        cells[half + (step if share > 0 else -step)] = "█"
    cells[half] = "│"
    words = f"{abs(share):4.0%} {above if share > 0 else below}" if share else "  0%"
    return Text.assemble("[", ("".join(cells), "cyan"), "] ", words)


def _input(model: ClientModel, now: float) -> Text:
    key = f"key {_NAMES.get(model.key, model.key)}"
    pad = "gamepad there" if model.pad.present else "no gamepad"
    text = Text(f"{key}, {pad}")
    down = buttons(model, now)
    for button, style in (
        (Button.STOP, "bold red"),
        (Button.TAKE, "green"),
        (Button.RELEASE, ""),
        (Button.GIVE, ""),
    ):
        if button in down:
            text.append(f"   {(button.name or '').lower()}!", style)
    if now < model.drive_until:
        text.append("   driving", "cyan")
    if model.note:
        text.append(f"   {model.note}", "yellow")
    return text


def _help() -> Table:
    table = Table.grid(padding=(0, 2))
    for column in range(6):
        table.add_column(style="bold" if column % 2 == 0 else "dim")
    for row in _KEYS:
        table.add_row(*row)
    return table
