"""The eye on the network answers as mjpg-streamer does; a slow reader gets the newest, never a queue."""

from __future__ import annotations

import json
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import suppress

import pytest

from robot.sim.wire.eye_server import EyeServer, Shot

DEADLINE_S = 10.0


class OneControl:
    """A camera with one control, and a cable that may break."""

    def __init__(self) -> None:
        self.value = 0
        self.broken = False

    def listing(self) -> Sequence[dict[str, int | str]]:
        if self.broken:
            raise ConnectionError("gone")
        return ({"name": "Pan", "id": 7, "value": self.value},)

    def set(self, control: int, value: int) -> bool:
        if self.broken:
            raise ConnectionError("gone")
        if control != 7:
            return False
        self.value = value
        return True


@pytest.fixture
def control() -> OneControl:
    return OneControl()


@pytest.fixture
def server(control: OneControl) -> Iterator[EyeServer]:
    server = EyeServer(control)
    yield server
    server.close()


def port_of(server: EyeServer) -> int:
    return int(server.url.rsplit(":", 1)[1])


def connected(server: EyeServer, request: str, receive_buffer: int | None = None) -> socket.socket:
    client = socket.socket()
    if receive_buffer is not None:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.settimeout(DEADLINE_S)
    client.connect(("127.0.0.1", port_of(server)))
    client.sendall(f"GET {request} HTTP/1.1\r\nHost: eye\r\n\r\n".encode())
    return client


def read_until(client: socket.socket, end: bytes) -> bytes:
    """Everything up to and with `end`, not a byte more."""
    received = b""
    while not received.endswith(end):
        piece = client.recv(1)
        assert piece, received[-200:]
        received += piece
    return received


def streaming(server: EyeServer, receive_buffer: int | None = None) -> socket.socket:
    """A client that has read everything before the first part."""
    client = connected(server, "/?action=stream", receive_buffer)
    read_until(client, b"\r\n\r\n")
    assert read_until(client, b"\r\n") == b"--boundarydonotcross\r\n"
    return client


def whole(client: socket.socket) -> bytes:
    received = b""
    while piece := client.recv(65536):
        received += piece
    return received


def keep_publishing(server: EyeServer, shot: Shot) -> threading.Event:
    """Until the event is set: whoever connects finds a fresh picture."""
    enough = threading.Event()

    def publish() -> None:
        while not enough.wait(0.005):
            server.publish(shot)

    threading.Thread(target=publish, daemon=True).start()
    return enough


# ----------------------------------------------------------------------------------------------- pictures


def test_a_stream_is_one_part_a_picture_with_length_and_capture_time(server: EyeServer) -> None:
    with connected(server, "/?action=stream") as client:
        head = read_until(client, b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.0 200 OK\r\n")
        assert b"\r\nContent-Type: multipart/x-mixed-replace;boundary=boundarydonotcross\r\n" in head
        assert read_until(client, b"\r\n") == b"--boundarydonotcross\r\n"
        for k, at in enumerate((12.0000015, 12.04)):
            server.publish(Shot(bytes([k]) * 10, at))
            stamp = (b"12.000002", b"12.040000")[k]
            expected = b"Content-Type: image/jpeg\r\nContent-Length: 10\r\nX-Timestamp: " + stamp
            expected += b"\r\n\r\n" + bytes([k]) * 10 + b"\r\n--boundarydonotcross\r\n"
            assert read_until(client, b"cross\r\n") == expected


def test_a_snapshot_is_the_next_picture_alone(server: EyeServer) -> None:
    server.publish(Shot(b"old", 1.0))
    client = connected(server, "/?action=snapshot")
    enough = keep_publishing(server, Shot(b"new", 2.25))
    with client:
        head, _, body = whole(client).partition(b"\r\n\r\n")
    enough.set()
    assert b"\r\nX-Timestamp: 2.250000" in head
    assert b"Content-type: image/jpeg" in head
    assert body == b"new"


def test_who_reads_slowly_gets_the_newest_picture_and_no_queue(server: EyeServer) -> None:
    """What the sockets hold by themselves is two pictures or three; two hundred were taken meanwhile."""
    with streaming(server, receive_buffer=4096) as client:
        size = 200_000
        for k in range(200):
            server.publish(Shot(bytes([k]) * size, float(k)))
        received = []
        for _ in range(4):
            read_until(client, b"\r\n\r\n")
            body = b""
            while len(body) < size:
                body += client.recv(size - len(body))
            received.append(body[0])
            read_until(client, b"cross\r\n")
            server.publish(Shot(bytes([200 + len(received)]) * size, 300.0))
        assert max(received) >= 199, received
        assert received == sorted(set(received)), "none twice"
        assert len([k for k in received if k < 199]) <= 2, "what was old had to be dropped"


def test_a_picture_that_nobody_wants_costs_nothing_and_clients_come_and_go(server: EyeServer) -> None:
    server.publish(Shot(b"x", 1.0))
    for _ in range(3):
        with connected(server, "/?action=stream") as client:
            read_until(client, b"cross\r\n")
        server.publish(Shot(b"x", 1.0))
    with streaming(server) as client:
        server.publish(Shot(b"still", 1.0))
        assert b"still" in read_until(client, b"cross\r\n")


# ----------------------------------------------------------------------------------------------- controls


def fetch(server: EyeServer, target: str) -> bytes:
    with urllib.request.urlopen(server.url + target, timeout=DEADLINE_S) as reply:
        return bytes(reply.read())


def test_controls_are_listed_with_numbers_as_strings(server: EyeServer, control: OneControl) -> None:
    control.value = -36
    assert json.loads(fetch(server, "/input_0.json")) == {
        "controls": [{"name": "Pan", "id": "7", "value": "-36"}],
        "formats": [],
    }


def test_a_command_sets_a_control_and_tells_an_unknown_one(server: EyeServer, control: OneControl) -> None:
    command = "/?action=command&dest=0&plugin=0&group=1"
    assert fetch(server, f"{command}&id=7&value=-720") == b"7: 0"
    assert control.value == -720
    assert fetch(server, f"{command}&id=8&value=1") == b"8: -1"


@pytest.mark.parametrize(
    ("target", "status"),
    [
        ("/?action=command&dest=0&plugin=0&group=1&id=7", 400),
        ("/?action=command&dest=0&plugin=0&group=1&id=7&value=far", 400),
        ("/?action=command&dest=1&plugin=0&group=1&id=7&value=1", 404),
        ("/?action=command&dest=0&plugin=0&group=3&id=7&value=1", 404),
        ("/?action=dance", 404),
        ("/index.html", 404),
    ],
)
def test_what_it_cannot_do_it_refuses(
    server: EyeServer, control: OneControl, target: str, status: int
) -> None:
    with pytest.raises(urllib.error.HTTPError) as refused:
        fetch(server, target)
    assert refused.value.code == status
    assert control.value == 0


def test_a_camera_without_controls_lists_none_and_takes_none() -> None:
    server = EyeServer()
    try:
        assert json.loads(fetch(server, "/input_0.json"))["controls"] == []
        assert fetch(server, "/?action=command&dest=0&plugin=0&group=1&id=7&value=1") == b"7: -1"
    finally:
        server.close()


def test_a_control_cable_that_broke_answers_500(server: EyeServer, control: OneControl) -> None:
    control.broken = True
    for target in ("/?action=command&dest=0&plugin=0&group=1&id=7&value=1", "/input_0.json"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            fetch(server, target)
        assert refused.value.code == 500


@pytest.mark.parametrize("noise", [b"\x00\xff" * 6000, b"POST / HTTP/1.0\r\n\r\n", b"GET\r\n\r\n", b"\n\n"])
def test_noise_is_refused(server: EyeServer, noise: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port_of(server)), DEADLINE_S) as client:
        client.sendall(noise)
        with suppress(ConnectionResetError):  # it did not even read all of it
            assert whole(client).startswith(b"HTTP/1.0 400")
    assert fetch(server, "/input_0.json"), "and goes on"


# ------------------------------------------------------------------------------------------------- faults


def test_unplugged_its_streams_break_and_nobody_gets_in_plugged_it_is_where_it_was(server: EyeServer) -> None:
    url = server.url
    with streaming(server) as client:
        server.unplug()
        assert client.recv(100) == b""
    with pytest.raises(urllib.error.URLError):
        fetch(server, "/input_0.json")
    server.plug()
    assert server.url == url
    assert fetch(server, "/input_0.json")


def test_hanging_it_accepts_and_says_nothing_until_it_is_over(server: EyeServer) -> None:
    server.hang = True
    with connected(server, "/input_0.json") as client:
        client.settimeout(0.2)
        with pytest.raises(TimeoutError):
            client.recv(1)
        server.hang = False
        client.settimeout(DEADLINE_S)
        assert client.recv(100).startswith(b"HTTP/1.0 200")


def test_closed_it_leaves_no_thread_and_no_port() -> None:
    before = set(threading.enumerate())
    server = EyeServer()
    with streaming(server) as client:
        server.close()
        server.close()
        assert client.recv(100) == b""
    for thread in set(threading.enumerate()) - before:
        thread.join(DEADLINE_S)
        assert not thread.is_alive(), thread
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port_of(server)), 1.0)
