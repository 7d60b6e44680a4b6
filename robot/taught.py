"""Taught targets on disk: `robot teach` writes them, simulated runs find or make the one they need."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from calib.rectify import rectifier
from robot import config, model_file, teach, teach_sources, teach_views
from robot.clock import Clock, MonotonicClock
from robot.errors import UserError
from robot.hal.factory import open_camera
from robot.hal.interfaces import DeviceError, StereoCamera, WaitsForPictures
from robot.hal.rectified import RectifiedCamera
from robot.messages import Box
from robot.run_hardware import rig_of, stopped_by_signals
from robot.teach_camera import Sitting, views_from_camera
from robot.vision.stereo import AdaptiveWeightMatcher

FOLDER = Path("models")
EYES_DISPARITIES = 96  # searched while teaching: what is held is nearer than what is driven to
EYES_PAUSE_S = 0.04
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


def from_eyes(name: str, config_path: Path, seconds: float, seed: int, console: Console) -> teach.Lesson:
    """Teach from the robot's own cameras, before which a person holds the object. Ctrl-C ends the sitting.

    Raises UserError for a config or cameras that cannot be used, and for too few views.
    """
    settings = config.load(config_path)
    straight = rectifier(rig_of(settings))
    clock = MonotonicClock()
    stop = threading.Event()
    with stopped_by_signals(stop), closing(opened_eyes(settings, clock)) as eyes:

        def pause() -> bool:
            waited = isinstance(eyes, WaitsForPictures) and eyes.wait_newer(EYES_PAUSE_S)
            return not stop.wait(0.0 if waited else EYES_PAUSE_S)

        views = views_from_camera(
            RectifiedCamera(eyes, straight),
            straight.rig,
            AdaptiveWeightMatcher.floors(EYES_DISPARITIES),
            clock,
            pause,
            lambda words: console.print(words, soft_wrap=True, markup=False),
            Sitting(seconds=seconds),
        )
        return _with_progress(
            lambda tell: teach.teach(
                views, name, seed, tell, focal_px=straight.rig.left.fx, created_from="the robot's own eyes"
            ),
            f"Learning {name}",
            console,
        )


def opened_eyes(settings: config.Config, clock: Clock) -> StereoCamera:
    """The cameras alone. Raises UserError."""
    try:
        return open_camera(settings.cameras, clock)
    except DeviceError as error:
        raise UserError(f"config key cameras: {error}") from error


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
