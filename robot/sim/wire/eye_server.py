"""One eye on the network, spoken to as one speaks to mjpg-streamer.

    GET /?action=stream      multipart/x-mixed-replace, one part a picture, for ever
    GET /?action=snapshot    the next picture
    GET /input_0.json        the controls, every number as a string
    GET /?action=command&dest=0&plugin=0&id=ID&group=1&value=V     set a control

HTTP/1.0 with `Connection: close`, as that program does. A client that reads slowly is given the newest
picture when it is ready for one; what it missed is gone.
"""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import parse_qs, urlsplit

BOUNDARY = "boundarydonotcross"
_REQUEST_MOST = 8192
_CLIENT_TIMEOUT_S = 5.0
_SEND_BUFFER_BYTES = 65_536  # about one picture: what waits here is old when it arrives
_COMMON = (
    "Access-Control-Allow-Origin: *\r\n"
    "Connection: close\r\n"
    "Server: MJPG-Streamer/0.2\r\n"
    "Cache-Control: no-store, no-cache, must-revalidate, pre-check=0, post-check=0, max-age=0\r\n"
    "Pragma: no-cache\r\n"
    "Expires: Mon, 3 Jan 2000 12:34:56 GMT\r\n"
)


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture as JPEG, and the `time.monotonic()` of the moment it shows."""

    jpeg: bytes
    at: float

    @property
    def stamp(self) -> str:
        """SECONDS.MICROS of `at`."""
        micros = round(self.at * 1e6)
        return f"{micros // 1_000_000}.{micros % 1_000_000:06d}"


class Controls(Protocol):
    """The controls of a camera."""

    def listing(self) -> Sequence[dict[str, int | str]]:
        """Name, id, type, min, max, step, default, value, flags and group of each.

        Raises ConnectionError if the camera does not answer.
        """
        ...

    def set(self, control: int, value: int) -> bool:
        """Set one; False if there is no such control. Raises ConnectionError likewise."""
        ...


class NoControls:
    """A camera that has none."""

    def listing(self) -> Sequence[dict[str, int | str]]:
        """Nothing."""
        return ()

    def set(self, control: int, value: int) -> bool:
        """There is no such control."""
        return False


class EyeServer:
    """Serves one eye on 127.0.0.1; a thread for each client. `publish` pictures, `close` when done.

    Switches for faults: `unplug` (connections break, new ones are refused), `plug` (back at the same port),
    `hang` (True: it accepts and never answers, streams stand still).

    >>> server = EyeServer()
    >>> server.url.startswith("http://127.0.0.1:")
    True
    >>> server.close()
    """

    def __init__(self, controls: Controls | None = None) -> None:
        self._controls = controls or NoControls()
        self._fresh = threading.Condition()
        self._shot: Shot | None = None
        self._count = 0
        self._clients: set[socket.socket] = set()
        self._closed = False
        self.hang = False
        self._listener = self._listen(0)
        self._port = int(self._listener.getsockname()[1])
        self._accepting()

    @property
    def url(self) -> str:
        """http://127.0.0.1:PORT"""
        return f"http://127.0.0.1:{self._port}"

    def publish(self, shot: Shot) -> None:
        """The newest picture; whoever waits for one gets this."""
        with self._fresh:
            self._shot = shot
            self._count += 1
            self._fresh.notify_all()

    def unplug(self) -> None:
        """Break all connections and refuse new ones."""
        with self._fresh:
            listener, clients = self._listener, list(self._clients)
        _shut(listener)
        for client in clients:
            _shut(client)

    def plug(self) -> None:
        """Serve again, at the same address."""
        if not self._closed:
            self._listener = self._listen(self._port)
            self._accepting()

    def close(self) -> None:
        """End all. May be called twice."""
        self._closed = True
        self.unplug()
        with self._fresh:
            self._fresh.notify_all()

    # ------------------------------------------------------------------------------------------- clients

    def _listen(self, port: int) -> socket.socket:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen(16)
        return listener

    def _accepting(self) -> None:
        threading.Thread(target=self._accept, args=(self._listener,), name="eye", daemon=True).start()

    def _accept(self, listener: socket.socket) -> None:
        with listener:
            while True:
                try:
                    client, _ = listener.accept()
                except OSError:
                    return
                client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                client.settimeout(_CLIENT_TIMEOUT_S)
                with self._fresh:
                    self._clients.add(client)
                threading.Thread(target=self._serve, args=(client,), name="eye client", daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        try:
            with client, suppress(OSError):  # a client that goes is no error
                self._answer(client, _requested(client))
        finally:
            with self._fresh:
                self._clients.discard(client)

    def _answer(self, client: socket.socket, target: str | None) -> None:
        self._while_hanging()
        if target is None:
            client.sendall(_error(400, "Bad Request", "not a request"))
            return
        parts = urlsplit(target)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        if parts.path == "/input_0.json":
            client.sendall(self._listing())
        elif query.get("action") == "stream":
            self._stream(client)
        elif query.get("action") == "snapshot":
            self._snapshot(client)
        elif query.get("action") == "command":
            client.sendall(self._command(query))
        else:
            client.sendall(_error(404, "Not Found", "no such page"))

    def _stream(self, client: socket.socket) -> None:
        seen = self._count
        head = f"HTTP/1.0 200 OK\r\n{_COMMON}Content-Type: multipart/x-mixed-replace;boundary={BOUNDARY}\r\n"
        client.sendall(f"{head}\r\n--{BOUNDARY}\r\n".encode())
        while True:
            seen, shot = self._newer_than(seen)
            if shot is None:
                return
            self._while_hanging()
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(shot.jpeg)}\r\n"
            head += f"X-Timestamp: {shot.stamp}\r\n\r\n"
            client.sendall(head.encode() + shot.jpeg + f"\r\n--{BOUNDARY}\r\n".encode())

    def _snapshot(self, client: socket.socket) -> None:
        _, shot = self._newer_than(self._count)
        if shot is None:
            return
        head = f"HTTP/1.0 200 OK\r\n{_COMMON}Content-type: image/jpeg\r\nX-Timestamp: {shot.stamp}\r\n\r\n"
        client.sendall(head.encode() + shot.jpeg)

    def _newer_than(self, seen: int) -> tuple[int, Shot | None]:
        """Wait for a picture after number `seen`; None if the server ends first."""
        with self._fresh:
            self._fresh.wait_for(lambda: self._closed or self._count > seen)
            return self._count, None if self._closed else self._shot

    def _while_hanging(self) -> None:
        while self.hang and not self._closed:
            threading.Event().wait(0.05)

    # ------------------------------------------------------------------------------------------ controls

    def _listing(self) -> bytes:
        try:
            listed = self._controls.listing()
        except ConnectionError as error:
            return _error(500, "Internal Server Error", str(error))
        controls = [{key: str(value) for key, value in control.items()} for control in listed]
        body = json.dumps({"controls": controls, "formats": []}, indent=1)
        return _reply("application/x-javascript", body.encode())

    def _command(self, query: dict[str, str]) -> bytes:
        try:
            dest, plugin, group = (int(query[key]) for key in ("dest", "plugin", "group"))
            control, value = int(query["id"]), int(query["value"])
        except (KeyError, ValueError):
            return _error(400, "Bad Request", "a command needs dest, plugin, group, id and value as numbers")
        if (dest, plugin, group) != (0, 0, 1):
            return _error(
                404, "Not Found", "only the camera's own controls are here: dest 0, plugin 0, group 1"
            )
        try:
            done = self._controls.set(control, value)
        except ConnectionError as error:
            return _error(500, "Internal Server Error", str(error))
        return _reply("text/plain", f"{control}: {0 if done else -1}".encode())


def _requested(client: socket.socket) -> str | None:
    """The target of a GET request; None for anything else."""
    received = b""
    while b"\r\n\r\n" not in received and b"\n\n" not in received:
        piece = client.recv(2048)
        received += piece
        if not piece or len(received) > _REQUEST_MOST:
            return None
    words = received.split(b"\n", 1)[0].decode("latin-1").split()
    return words[1] if len(words) == 3 and words[0] == "GET" else None


def _reply(kind: str, body: bytes) -> bytes:
    return f"HTTP/1.0 200 OK\r\nContent-type: {kind}\r\n{_COMMON}\r\n".encode() + body


def _error(status: int, title: str, words: str) -> bytes:
    head = f"HTTP/1.0 {status} {title}\r\nContent-type: text/plain\r\n{_COMMON}\r\n"
    return f"{head}{status}: {title}!\r\n{words}".encode()


def _shut(connection: socket.socket) -> None:
    """Wake whoever waits on it, and let it go."""
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()
