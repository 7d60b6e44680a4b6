"""The trackers beside which ours is held: OpenCV's, run by another Python that has the contrib package."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from robot.errors import UserError
from robot.messages import Box, Image, Track

SERVER = Path(__file__).with_name("tracker_peer_server.py")
PEERS = ("CSRT", "KCF", "MIL")


class PeerServer:
    """A process with OpenCV's trackers.

    Args:
        python: interpreter of an environment with opencv-contrib-python-headless.

    Raises:
        UserError: it does not start.
    """

    def __init__(self, python: str) -> None:
        words = [python, str(SERVER)]
        try:
            self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as problem:
            raise UserError(
                f"the peers' Python does not start: {problem}; see `make bench-peers`"
            ) from problem

    def __enter__(self) -> PeerServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=10.0)

    def ask(self, tracker: str, frame: Image, box: Box | None) -> dict[str, Any]:
        """Start a tracker on a box, or update it with a frame.

        Raises:
            UserError: the process is gone (its own words are on standard error).
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        told: dict[str, Any] = {"tracker": tracker, "shape": frame.shape}
        if box is not None:
            told["box"] = [box.x, box.y, box.w, box.h]
        try:
            self._process.stdin.write(
                json.dumps(told).encode() + b"\n" + np.ascontiguousarray(frame).tobytes()
            )
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except OSError as problem:
            raise UserError(f"the peers' Python ended: {problem}") from problem
        if not line:
            raise UserError("the peers' Python ended: does it have opencv-contrib-python-headless?")
        answer: dict[str, Any] = json.loads(line)
        return answer


class Peer:
    """One of OpenCV's trackers, spoken to like ours; `seconds` is what it measured itself."""

    def __init__(self, server: PeerServer, name: str) -> None:
        self._server, self.name, self.seconds = server, name, 0.0

    def start(self, image: Image, box: Box) -> None:
        """Begin to follow what is in the box."""
        self._server.ask(self.name, image, box)

    def update(self, image: Image) -> Track:
        """Find it in the next frame."""
        answer = self._server.ask(self.name, image, None)
        self.seconds = float(answer["seconds"])
        return Track(Box(*answer["box"]), (0.0, 0.0), 1.0 if answer["found"] else 0.0, not answer["found"])
