"""The webcam drivers' far end in tests: a small MJPEG server with controls, written from its protocol."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
import numpy.typing as npt

BOUNDARY = "boundarydonotcross"
PAN, TILT, ZOOM = 0x009A0908, 0x009A0909, 0x009A090D


def picture(value: int, size: tuple[int, int] = (64, 48)) -> npt.NDArray[np.uint8]:
    """A plain grey picture."""
    return np.full((size[1], size[0], 3), value, dtype=np.uint8)


def jpeg(value: int, size: tuple[int, int] = (64, 48)) -> bytes:
    """The same as a JPEG."""
    return bytes(cv2.imencode(".jpg", picture(value, size))[1])


def part(body: bytes, stamp: float | None = None) -> bytes:
    """One picture as mjpg-streamer sends it."""
    head = f"Content-Type: image/jpeg\r\nContent-Length: {len(body)}\r\n"
    if stamp is not None:
        seconds, micros = divmod(round(stamp * 1e6), 1_000_000)
        head += f"X-Timestamp: {seconds}.{micros:06}\r\n"
    return head.encode() + b"\r\n" + body + f"\r\n--{BOUNDARY}\r\n".encode()


def control(number: int, name: str, low: int, high: int, step: int = 1, value: int = 0) -> dict[str, str]:
    """An entry of the control list: every number as text, as mjpg-streamer writes them."""
    numbers = {"id": number, "min": low, "max": high, "step": step, "default": 0, "value": value}
    return {"name": name, "type": "1", "dest": "0", "flags": "0", "group": "1"} | {
        key: str(number) for key, number in numbers.items()
    }


class FakeStreamer:
    """Streams what is pushed, lists and sets controls; `down` hangs up and refuses, `mute`: never answers."""

    def __init__(self, controls: list[dict[str, str]] | None = None) -> None:
        self.controls = {int(entry["id"]): entry for entry in controls or []}
        self.has_controls = controls is not None
        self.requests: list[str] = []
        self.mute = False
        self.connected = threading.Semaphore(0)
        self._streams: list[socket.socket] = []
        self._all: list[socket.socket] = []
        self._lock = threading.Lock()
        self._port = 0
        self._listener: socket.socket | None = None
        self.up()

    @property
    def url(self) -> str:
        """Of the stream."""
        return f"http://127.0.0.1:{self._port}/?action=stream"

    @property
    def base(self) -> str:
        """Of the server."""
        return f"http://127.0.0.1:{self._port}"

    @property
    def is_up(self) -> bool:
        """True if it takes calls."""
        return self._listener is not None

    def up(self) -> None:
        """Listen (again, on the same port)."""
        if self._listener is not None:
            return
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", self._port))
        listener.listen()
        self._listener, self._port = listener, listener.getsockname()[1]
        threading.Thread(target=self._accept, args=(listener,), daemon=True).start()

    def down(self) -> None:
        """Hang up on everybody and take no more calls."""
        listener, self._listener = self._listener, None
        if listener is not None:
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()
        with self._lock:
            for client in self._all:
                with contextlib.suppress(OSError):
                    client.shutdown(socket.SHUT_RDWR)
                client.close()
            self._all.clear()
            self._streams.clear()

    def push(self, data: bytes) -> None:
        """Send to every stream."""
        with self._lock:
            for client in self._streams:
                with contextlib.suppress(OSError):
                    client.sendall(data)

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            with self._lock:
                self._all.append(client)
            if not self.mute:
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        request = b""
        with contextlib.suppress(OSError):
            while b"\r\n\r\n" not in request:
                piece = client.recv(4096)
                if not piece:
                    return
                request += piece
            target = request.decode().split(" ")[1]
            self.requests.append(target)
            self._answer(client, target)

    def _answer(self, client: socket.socket, target: str) -> None:
        query = parse_qs(urlsplit(target).query)
        if query.get("action") == ["stream"]:
            client.sendall(
                b"HTTP/1.0 200 OK\r\nConnection: close\r\nServer: MJPG-Streamer/0.2\r\n"
                + f"Content-Type: multipart/x-mixed-replace;boundary={BOUNDARY}\r\n\r\n".encode()
                + f"--{BOUNDARY}\r\n".encode()
            )
            with self._lock:
                self._streams.append(client)
            self.connected.release()
            return
        if target == "/input_0.json" and self.has_controls:
            body = json.dumps({"controls": list(self.controls.values())}).encode()
        elif query.get("action") == ["command"] and int(query["id"][0]) in self.controls:
            self.controls[int(query["id"][0])]["value"] = query["value"][0]
            body = b"command: 0"
        else:
            client.sendall(b"HTTP/1.0 404 Not Found\r\n\r\n")
            client.close()
            return
        client.sendall(b"HTTP/1.0 200 OK\r\nContent-type: application/json\r\n\r\n" + body)
        client.close()
