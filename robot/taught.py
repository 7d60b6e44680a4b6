"""Taught targets on disk: `robot teach` writes them, simulated runs find or make the one they need."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from robot import model_file, teach, teach_sources, teach_views
from robot.errors import UserError
from robot.messages import Box

FOLDER = Path("models")
FOCAL_PX = 305.0  # of the simulated eyes the studio's pictures are taken with
STUDIO_SEED = 0  # studios have their own room, textures and light, which no scored scene uses


def from_studio(name: str, scene: str, seed: int, console: Console) -> teach.Lesson:
    """Teach from a simulated studio, with a progress bar."""
    from robot.sim import teaching

    return _with_progress(
        lambda tell: teach.teach(
            teaching.views(scene, seed),
            name,
            seed,
            tell,
            focal_px=FOCAL_PX,
            created_from=f"studio {scene}, seed {seed}",
        ),
        f"Teaching the robot the {name}",
        console,
    )


def from_pictures(name: str, source: Path, box: Box | None, seed: int, console: Console) -> teach.Lesson:
    """Teach from a folder of pictures, or from a video with the object's box in its first frame."""
    if source.is_dir():
        views = teach_sources.views_from_folder(source)
    elif box is None:
        raise UserError(f"{source} is a video: say where the object is in its first frame with --box x,y,w,h")
    else:
        views = teach_sources.views_from_video(source, box)
    return _with_progress(
        lambda tell: teach.teach(views, name, seed, tell, created_from=source.name),
        f"Learning {name}",
        console,
    )


def model_for(target: str, console: Console) -> Path:
    """The model file of a simulated target; made in the studio if it is not there or of an old format."""
    path = FOLDER / f"{target}.model"
    if not path.exists() or model_file.is_outdated(path):
        make_folder()
        lesson = from_studio(target, f"teach-{target}", STUDIO_SEED, console)
        model_file.save(path, lesson.model)
    return path


def make_folder() -> None:
    """Make the folder of the models. Raises UserError where that cannot be."""
    try:
        FOLDER.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot make the folder {FOLDER.absolute()} for taught models ({error.strerror}); "
            "work in a folder you may write to"
        ) from None


def target_for(target: str, console: Console | None = None) -> model_file.Model:
    """The model of a simulated target, taught first if need be."""
    return model_file.load(model_for(target, console or Console(stderr=True)))


def parse_box(text: str) -> Box:
    """A box from 'x,y,w,h'. Raises UserError."""
    try:
        x, y, w, h = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"--box {text!r}: give four numbers x,y,w,h in pixels, e.g. 120,80,60,90") from None
    if not (np.isfinite([x, y, w, h]).all() and w > 0 and h > 0):
        raise UserError(f"--box {text!r}: width and height must be positive")
    return Box(x, y, w, h)


def _with_progress(
    work: Callable[[teach_views.Progress], teach.Lesson], words: str, console: Console
) -> teach.Lesson:
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[stage]}"),
    )
    quiet = not console.is_terminal  # a bar that cannot move is only noise in a log
    with Progress(*columns, console=console, transient=True, disable=quiet) as progress:
        task = progress.add_task(words, total=None, stage="")
        return work(lambda count, stage: progress.update(task, stage=f"{count} views: {stage}"))
