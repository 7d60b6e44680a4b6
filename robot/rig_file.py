"""The pair's calibration file as the commands read it: what is wrong with it is the user's to mend."""

from __future__ import annotations

from pathlib import Path

from calib import files
from calib.model import StereoRig
from robot.errors import UserError


def load_rig(path: Path) -> StereoRig:
    """Read a calibration (calib/files.py says what is in it). Raises UserError, one line with the cure."""
    try:
        return files.load_rig(path)
    except files.CalibrationError as error:
        raise UserError(str(error)) from None
