"""Rigs of the camera that reads picture folders."""

from __future__ import annotations

from pathlib import Path

import cv2
from rig import Make, RealRig, Rig

from robot.hal.folder import FolderCamera, pairs_in
from robot.hal.interfaces import StereoCamera
from robot.hal.mock.camera import wall_pair


def _folder_camera(folder: Path) -> Rig[StereoCamera]:
    for index in range(4):
        left, right = wall_pair(64, 48)
        cv2.imwrite(str(folder / f"left_{index}.png"), left + index)
        cv2.imwrite(str(folder / f"right_{index}.png"), right + index)
    return FolderRig(FolderCamera(pairs_in(folder), 25.0), folder)


class FolderRig(Rig[StereoCamera]):
    """Pictures that can be spoilt on disk."""

    def __init__(self, device: StereoCamera, folder: Path) -> None:
        super().__init__(device)
        self._folder = folder

    def break_down(self) -> None:
        """Spoil every picture but the last."""
        for path in self._folder.iterdir():
            if "3" not in path.name:
                path.write_bytes(b"no picture")

    def mend(self) -> None:
        """The last one is good; it comes by itself."""


def real(address: str) -> Make | None:
    """LEFT,RIGHT or one folder of pictures; None if the address names no folder."""
    left, _, right = address.partition(",")
    if not Path(left).is_dir():
        return None
    return lambda folder: RealRig(FolderCamera(pairs_in(Path(left), Path(right) if right else None)))


MAKERS = {"camera": {"folder": _folder_camera}}
REAL = {"camera": real}
