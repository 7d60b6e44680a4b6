"""`robot look`: range and free passage of one stereo pair of pictures, and a picture that shows them."""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from pathlib import Path

import cv2
import numpy as np

from calib.model import StereoRig
from robot import look_picture, model_file
from robot.errors import UserError
from robot.look_measure import BODY, Look, Sight, look
from robot.messages import Image, Passage
from robot.rig_file import load_rig
from robot.taught import parse_box

DONE, FAILED = 0, 1
SMALLEST_PX = 48
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def look_at(
    left: Path, right: Path, calibration: Path, target: Path | None, box: str | None, out: Path
) -> int:
    """Measure a pair of picture files, print the result and write the annotated picture to `out`.

    Exit code 0, or 1 if the target was not found or what was asked for has no range. Raises UserError, one
    line with the cure, before anything is written.
    """
    if target is not None and box is not None:
        raise UserError("--target and --box exclude each other: give one of them")
    if out.suffix.lower() not in SUFFIXES:
        raise UserError(f"--out {out}: the name must end in one of {', '.join(SUFFIXES)}")
    wanted = None if box is None else parse_box(box)
    rig = load_rig(calibration)
    picture_left, picture_right = read_pair(left, right, rig)
    model = None if target is None else model_file.load(target)
    found = look(picture_left, picture_right, rig, wanted, None if model is None else model.finder)
    write_picture(out, look_picture.draw(found))
    for line in words(found, None if model is None else model.name):
        print(line)
    print(f"picture: {out}")
    asked = target is not None or box is not None
    measured = any(sight.distance is not None for sight in found.sights)
    return FAILED if asked and not measured else DONE


def read_pair(left: Path, right: Path, rig: StereoRig) -> tuple[Image, Image]:
    """Both pictures as BGR (H, W, 3) uint8. Raises UserError if they are no pair of this calibration."""
    pictures = read_picture(left), read_picture(right)
    sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in pictures]
    if sizes[0] != sizes[1]:
        raise UserError(
            f"{left} is {sizes[0]}, {right} {sizes[1]}: give two pictures of equal size, one of each eye"
        )
    if min(pictures[0].shape[:2]) < SMALLEST_PX:
        raise UserError(
            f"{left} is {sizes[0]}: too small to measure on; give at least {SMALLEST_PX}x{SMALLEST_PX} pixels"
        )
    calibrated = f"{rig.left.width}x{rig.left.height}"
    if sizes[0] != calibrated:
        raise UserError(
            f"{left} is {sizes[0]}, the calibration is for {calibrated}: "
            "give the calibration of these pictures"
        )
    return pictures


def read_picture(path: Path) -> Image:
    """One picture file as BGR (H, W, 3) uint8. Raises UserError if it cannot be read."""
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); give a picture file") from None
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    except cv2.error:
        picture = None
    if picture is None:
        raise UserError(f"{path}: not a picture, or cut short; give a PNG or JPEG file")
    return np.asarray(picture, dtype=np.uint8)


def write_picture(path: Path, picture: Image) -> None:
    """Write a picture so that the file is whole or not there. Raises UserError where that cannot be."""
    _, data = cv2.imencode(path.suffix.lower(), picture)
    part: str | None = None
    try:
        handle, part = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data.tobytes())
        os.chmod(part, 0o644)
        os.replace(part, path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror}); give another --out") from None
    finally:
        if part is not None:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(part)


# ------------------------------------------------------------------------------------------ in words


def words(found: Look, target: str | None) -> list[str]:
    """The result as lines for a person; target: the taught name that was looked for, if any."""
    lines = [_sight_words(sight) for sight in found.sights]
    if target is not None and not found.sights:
        lines.append(f"{target}: not in the picture")
    if found.complaint is not None:
        lines.append(f"careful: {found.complaint}")
    # Where the floor is known, the way over it says more than a hole in the picture.
    passage = [] if found.ways is not None else [_passage_words(found)]
    return [*lines, *_floor_words(found), *passage, _coverage_words(found)]


def _sight_words(sight: Sight) -> str:
    box = sight.box
    name = sight.label or "box"
    at = f"{name} at {box.x:.0f},{box.y:.0f},{box.w:.0f},{box.h:.0f}"
    dense = "" if sight.dense is None else f" (dense stereo {sight.dense:.3f} m)"
    if sight.distance is None:
        return f"{at}: no range, its middle does not match clearly in the right picture{dense}"
    bearing = f"{math.degrees(sight.bearing):+.1f} degrees"
    return f"{at}: {sight.distance:.3f} m +- {sight.sigma:.3f} m, bearing {bearing}{dense}"


def _floor_words(found: Look) -> list[str]:
    """The floor, what stands on it, and whether the base would pass."""
    floor, ways = found.floor, found.ways
    if floor is None:
        return ["floor: none found in the picture, so nothing is said of what stands on it"]
    hangs = (
        f"floor: {floor.height:.2f} m below the eye, which looks {math.degrees(floor.tilt):.0f} degrees down"
    )
    if ways is None:
        aslant = f"{math.degrees(floor.roll):+.0f} degrees"
        return [f"{hangs}; the camera is held aslant ({aslant}): what stands on it cannot be told"]
    away = np.hypot(ways.obstacles[:, 0], ways.obstacles[:, 1])
    if len(away):
        nearest = int(away.argmin())
        bearing = math.degrees(math.atan2(ways.obstacles[nearest, 1], ways.obstacles[nearest, 0]))
        told = f"obstacles: the nearest at {away[nearest]:.2f} m, bearing {bearing:+.1f} degrees"
    else:
        told = "obstacles: none seen"
    return [hangs, told, _way_words(ways.passage)]


def _way_words(passage: Passage | None) -> str:
    """Whether the base would pass between what stands on the floor."""
    body = f"a base {BODY.width:.2f} m wide and {BODY.height:.2f} m high"
    if passage is None:
        return f"way: none seen for {body}"
    wide = f"way: {passage.diameter:.2f} +- {passage.sigma_diameter:.2f} m wide"
    x, y, _ = passage.position
    there = f"at {math.hypot(x, y):.2f} m, bearing {math.degrees(math.atan2(y, x)):+.1f} degrees"
    if passage.safe:
        return f"{wide} {there}; {body} fits"
    if passage.diameter < BODY.width:
        return f"{wide} {there}; too narrow for {body}"
    return f"{wide} {there}; not safe for {body}: not all of its way is seen to be free"


def _passage_words(found: Look) -> str:
    passage = found.passage
    if passage is None:
        return f"free passage: none seen beyond {found.beyond:.2f} m"
    x, y, _ = passage.position
    return (
        f"free passage: {passage.diameter:.2f} m wide beyond {found.beyond:.2f} m, circle at "
        f"({passage.centre[0]:.0f}, {passage.centre[1]:.0f}) px, radius {passage.radius_px:.0f} px, "
        f"bearing {math.degrees(math.atan2(y, x)):+.1f} degrees"
    )


def _coverage_words(found: Look) -> str:
    share = float(found.disparity.valid.mean())
    return f"depth measured on {100.0 * share:.0f} % of the picture"
