"""OpenCV's trackers behind a pipe, for a virtual environment of their own: the contrib package holds them.

Reads messages from standard input, answers on standard output; needs numpy and opencv alone. A message is a
JSON line (`tracker` with the frame's `shape` and `box` starts one; with `shape` alone updates the last
started one of that name) and the frame's bytes; the answer a JSON line: `box`, `found`, `seconds`.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import cv2
import numpy as np

CREATORS = {"CSRT": "TrackerCSRT_create", "KCF": "TrackerKCF_create", "MIL": "TrackerMIL_create"}


def main() -> int:
    """Answer until standard input ends."""
    cv2.setNumThreads(1)
    running: dict[str, Any] = {}
    while line := sys.stdin.buffer.readline():
        told = json.loads(line)
        shape = tuple(told["shape"])
        frame = np.frombuffer(sys.stdin.buffer.read(int(np.prod(shape))), np.uint8).reshape(shape)
        name, box, found = told["tracker"], told.get("box"), True
        start = time.perf_counter()
        if box is not None:
            running[name] = getattr(cv2, CREATORS[name])()
            running[name].init(frame, tuple(round(edge) for edge in box))
        else:
            found, box = running[name].update(frame)
        answer = {
            "box": [float(edge) for edge in box],
            "found": bool(found),
            "seconds": time.perf_counter() - start,
        }
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
