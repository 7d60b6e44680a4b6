"""The `robot` command: parses, calls, prints. Heavy imports happen in the commands, so `--help` is quick."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from robot import __version__
from robot.errors import UserError

DONE, FAILED, USER_ERROR, HARDWARE_FAULT = 0, 1, 2, 3


def main() -> None:
    """Run the command line; user errors are one line on standard error and exit 2."""
    try:
        sys.exit(commands(prog_name="robot", standalone_mode=False) or DONE)
    except UserError as error:
        click.echo(f"robot: {error}", err=True)
        sys.exit(USER_ERROR)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        sys.exit(USER_ERROR)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else "robot"
        click.echo(f"{command}: {' '.join(error.format_message().split())} See: {command} --help", err=True)
        sys.exit(USER_ERROR)
    except click.Abort:
        click.echo("robot: stopped by the keyboard", err=True)
        sys.exit(130)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="robot")
def commands() -> None:
    """A robot that searches for a target it was taught, recognizes and ranges it, follows it and avoids
    what stands in the way."""


PATH = click.Path(path_type=Path)


@commands.command()
@click.option("--seed", default=1, show_default=True, help="Which room: everything random follows from it.")
@click.option("--video/--no-video", default=True, show_default=True, help="Record run.mp4.")
def demo(seed: int, video: bool) -> int:
    """Watch the whole robot do its job in a simulated room."""
    from robot import missions

    return missions.demo(seed, video)


@commands.command()
@click.option("--config", "config_path", type=PATH, help="The robot's settings (TOML).")
@click.option(
    "--sim", "scene", help="Run in a simulated room: a shipped scene's name, a TOML file, or 'all'."
)
@click.option("--seed", default=1, show_default=True, help="Seed of a simulated run.")
@click.option("--seeds", type=click.IntRange(1, 1000), help="Run seeds 1..N instead of one.")
@click.option(
    "--jobs", default=1, show_default=True, type=click.IntRange(1, 64), help="Simulated runs at a time."
)
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON on standard output.")
@click.option("--video", is_flag=True, help="Record run.mp4.")
@click.option(
    "--slow",
    default=1.0,
    show_default=True,
    type=click.FloatRange(0.1, 20),
    help="Vision stages take so many times longer (simulated).",
)
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="DEVICE.KIND@TIME[:DURATION]",
    help="Break a simulated or a mock device, e.g. camera.black@5:2; repeatable.",
)
@click.option(
    "--wire",
    is_flag=True,
    help="Simulated room in a second process, in real time, over real links to the drivers.",
)
@click.option("--duration", type=click.FloatRange(min=0.1), help="Stop a hardware run after so many seconds.")
def run(**options: Any) -> int:
    """Run the robot: on its hardware (--config) or in a simulated room (--sim)."""
    if options["scene"] is None:
        if options["config_path"] is None:
            raise UserError(
                "nothing to run: give --config FILE for the hardware or --sim SCENE for a simulated room"
            )
        if options["wire"]:
            raise UserError("--wire is for simulated rooms: add --sim SCENE")
        from robot.run_hardware import run_hardware

        return run_hardware(options["config_path"], Path("runs"), options["duration"], options["faults"])
    if options["wire"] and (options["video"] or options["slow"] != 1.0 or options["jobs"] != 1):
        raise UserError("--wire runs in real time, one run at a time: without --video, --slow and --jobs")
    if options["duration"] is not None:
        raise UserError("--duration is for hardware runs: a scene's own duration_s ends a simulated one")
    from robot import missions

    seeds = range(1, options["seeds"] + 1) if options["seeds"] else (options["seed"],)
    return missions.run_sim(
        options["scene"],
        seeds,
        options["jobs"],
        options["as_json"],
        options["video"],
        options["slow"],
        options["faults"],
        options["config_path"],
        options["wire"],
    )


@commands.command()
@click.argument("port")
@click.option("--baud", default=115200, show_default=True, help="Rate of the serial line.")
@click.option(
    "--gamepad/--no-gamepad", default=True, show_default=True, help="Use a gamepad if there is one."
)
def teleop(port: str, baud: int, gamepad: bool) -> int:
    """Drive the robot over the serial line PORT, e.g. /dev/ttyUSB0, with keys or a gamepad."""
    from robot.teleop_client import run_teleop

    return run_teleop(port, gamepad, baud)


@commands.command()
@click.option(
    "--from",
    "source",
    required=True,
    help="Folder of pictures, video file, 'cameras' (the robot's own), or a simulated teaching scene.",
)
@click.option("--name", required=True, help="What the target is called.")
@click.option("--box", help="The object in a video's first frame: x,y,w,h in pixels.")
@click.option("--out", type=PATH, help="Model file to write  [default: models/NAME.model]")
@click.option("--seed", default=0, show_default=True, help="Seed of the factorisation's random start.")
@click.option("--config", "eyes", type=PATH, help="Config of the robot whose cameras are used.")
@click.option(
    "--seconds",
    default=60.0,
    show_default=True,
    type=click.FloatRange(5, 600),
    help="With cameras: how long the object is looked at.",
)
def teach(
    source: str, name: str, box: str | None, out: Path | None, seed: int, eyes: Path | None, seconds: float
) -> int:
    """Teach the robot a target from pictures of it."""
    from robot import missions

    return missions.teach_target(source, name, box, out, seed, eyes, seconds)


@commands.command()
@click.argument("left", type=PATH)
@click.argument("right", type=PATH)
@click.option("--calib", "calibration", type=PATH, required=True, help="Calibration file of the pair (TOML).")
@click.option("--target", type=PATH, help="Model of a taught target to look for.")
@click.option("--box", help="Measure this box instead: x,y,w,h in pixels of the left picture.")
@click.option(
    "--out", type=PATH, default=Path("look.png"), show_default=True, help="Annotated picture to write."
)
def look(left: Path, right: Path, calibration: Path, target: Path | None, box: str | None, out: Path) -> int:
    """Measure range and free passage on a stereo pair of pictures."""
    from robot.look import look_at

    return look_at(left, right, calibration, target, box, out)


@commands.command("faults")
@click.option("--json", "as_json", is_flag=True, help="Print the table as JSON.")
def fault_table(as_json: bool) -> int:
    """Print the fault table: every way a device can fail, what the robot does, and the cure."""
    from robot import fault_page

    click.echo(fault_page.as_json() if as_json else fault_page.as_text(), nl=False)
    return DONE


@commands.command()
def chart() -> int:
    """Print the state chart as a mermaid diagram."""
    from robot.chart import mermaid

    click.echo(mermaid(), nl=False)
    return DONE


@commands.group()
def config() -> None:
    """Check settings, or show them all."""


@config.command("check")
@click.argument("file", type=PATH)
def config_check(file: Path) -> int:
    """Say whether FILE is a valid config."""
    from robot.config import load

    load(file)
    click.echo(f"{file}: valid")
    return DONE


@config.command("show")
def config_show() -> int:
    """Print every setting with its default, range and meaning."""
    from robot.config import commented_defaults

    click.echo(commented_defaults(), nl=False)
    return DONE


if __name__ == "__main__":
    main()
