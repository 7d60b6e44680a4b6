"""MJPEG over HTTP: the stream taken apart, stamps, servers that break and servers that hang."""

from __future__ import annotations

import itertools
import socket
import threading
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from webcam_far_end import BOUNDARY, FakeStreamer, jpeg, part

from robot.clock import SteppedClock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.http_exchange import Address, Connection, fetch, parse_address, parse_head
from robot.hal.webcam.http_source import HttpSource
from robot.hal.webcam.multipart import MultipartParser, StampMapper, boundary_of, stamp_of

# ----------------------------------------------------------------------------------------------- parser

START = f"--{BOUNDARY}\r\n".encode()
BODIES = st.lists(st.binary(min_size=1, max_size=60), max_size=5)


def bodies_of(stream: bytes, cuts: list[int], boundary: str = BOUNDARY) -> list[bytes]:
    parser = MultipartParser(boundary)
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    return [p.body for a, b in itertools.pairwise(edges) for p in parser.feed(stream[a:b])]


@settings(deadline=None, max_examples=100)
@given(BODIES, st.lists(st.integers(0, 2000), max_size=12))
@example([b"\r\n\r\n--boundarydonotcross\r\n", b"x"], [])
def test_parts_come_out_whole_however_the_bytes_arrive(bodies, cuts) -> None:  # type: ignore[no-untyped-def]
    stream = START + b"".join(part(body, 1.5) for body in bodies)
    assert bodies_of(stream, cuts) == bodies


@settings(deadline=None, max_examples=100)
@given(st.lists(st.binary(min_size=1, max_size=40).filter(lambda b: b"--" not in b), max_size=4))
def test_without_a_length_a_part_ends_at_the_next_boundary(bodies) -> None:  # type: ignore[no-untyped-def]
    stream = START + b"".join(b"Content-Type: image/jpeg\r\n\r\n" + body + b"\r\n" + START for body in bodies)
    assert [body[:-2] for body in bodies_of(stream, [5, 17, 40])] == bodies


@settings(deadline=None, max_examples=200)
@given(st.binary(max_size=300), st.integers(0, 299), st.binary(min_size=1, max_size=8))
def test_a_damaged_stream_never_does_more_than_raise_and_is_found_again(noise, at, damage) -> None:  # type: ignore[no-untyped-def]
    stream = bytearray(START + part(b"one") + part(b"two"))
    stream[at % len(stream) : at % len(stream) + len(damage)] = damage
    parser = MultipartParser(BOUNDARY, most_bytes=100)
    try:
        for piece in (noise, bytes(stream)):
            parser.feed(piece)
    except DeviceError:
        return
    seen: list[bytes] = []
    try:
        for _ in range(60):  # a damaged length swallows at most most_bytes
            seen += [p.body for p in parser.feed(part(b"good"))]
    except DeviceError:
        return
    assert b"good" in seen[-1:]


def test_headers_of_a_part_and_dashes_in_the_announced_boundary() -> None:
    [only] = MultipartParser(f"--{BOUNDARY}").feed(START + part(b"hi", 12.000345))
    assert only.headers["content-type"] == "image/jpeg"
    assert stamp_of(only.headers) == 12.000345
    assert only.body == b"hi"


def test_bare_line_feeds_and_parts_without_headers_are_understood() -> None:
    assert bodies_of(b"--b\nContent-Length: 2\n\nhi\n--b\n\nyo\n--b", [], "b") == [b"hi", b"yo\n"]


@pytest.mark.parametrize("length", ["-1", "abc", "", "1e9", "0", "9" * 13])
def test_a_length_that_is_none_is_not_believed(length: str) -> None:
    stream = f"--b\r\nContent-Length: {length}\r\n\r\nhi\r\n--b\r\n".encode()
    assert bodies_of(stream, [], "b") == [b"hi\r\n"]


def test_nothing_grows_without_bound() -> None:
    with pytest.raises(DeviceError, match="announces 101 bytes"):
        MultipartParser("b", most_bytes=100).feed(b"--b\r\nContent-Length: 101\r\n\r\n")
    with pytest.raises(DeviceError, match="headers without end"):
        MultipartParser("b").feed(b"--b\r\n" + b"x" * 9000)
    with pytest.raises(DeviceError, match="longer than 100"):
        MultipartParser("b", most_bytes=100).feed(b"--b\r\n\r\n" + b"x" * 101)
    parser = MultipartParser("b")
    for _ in range(1000):
        parser.feed(b"x" * 1000)
    assert len(parser._buffer) < 3


@pytest.mark.parametrize(
    ("text", "boundary"),
    [
        ("multipart/x-mixed-replace;boundary=boundarydonotcross", "boundarydonotcross"),
        ('Multipart/X-Mixed-Replace; charset=x; boundary="a b"', "a b"),
        ("image/jpeg", None),
        ("multipart/x-mixed-replace", None),
        ("", None),
    ],
)
def test_boundary(text: str, boundary: str | None) -> None:
    assert boundary_of(text) == boundary


@pytest.mark.parametrize("text", ["", "nan", "-1.0", "1e5", "1.2.3", "\u0661.\u0662"])
def test_a_stamp_that_is_none_is_not_used(text: str) -> None:
    assert stamp_of({"x-timestamp": text}) is None


# ----------------------------------------------------------------------------------------------- stamps


@settings(deadline=None, max_examples=60)
@given(st.floats(-1e6, 1e6), st.lists(st.floats(0.002, 0.4), min_size=30, max_size=60), st.randoms())
def test_capture_times_are_true_up_to_the_quickest_way(offset, delays, random) -> None:  # type: ignore[no-untyped-def]
    mapper = StampMapper()
    delays[random.randrange(5)] = 0.002
    for n, delay in enumerate(delays):
        truth = 100.0 + 0.5 * n
        at = mapper.captured_at(truth - offset, truth + delay)
        assert at <= truth + delay
        assert at >= truth - 1e-6
        if n >= 5:
            assert at == pytest.approx(truth + 0.002, abs=1e-6)


def test_a_restarted_server_and_a_drifting_clock_are_followed() -> None:
    mapper = StampMapper(window=10.0)
    assert mapper.captured_at(5000.0, 1.0) == 1.0
    assert mapper.captured_at(3.0, 2.0) == 2.0  # it counts anew
    assert mapper.captured_at(3.5, 2.6) == pytest.approx(2.5)
    assert mapper.captured_at(4.0, 9.9) == pytest.approx(9.9)  # its clock was set back: not seven seconds old
    back = StampMapper()
    back.captured_at(5000.0, 1.0)
    assert back.captured_at(4999.0, 1.5) == 1.5  # no stamp goes back but by a restart
    drifting = StampMapper(window=10.0)
    for n in range(2000):
        arrival = n * 0.04
        assert arrival - drifting.captured_at(arrival * 0.9999, arrival) <= 10.1 * 1e-4


# -------------------------------------------------------------------------------------------- exchanges


@pytest.fixture
def server():  # type: ignore[no-untyped-def]
    streamer = FakeStreamer()
    yield streamer
    streamer.down()


def source_of(url: str, **settings) -> HttpSource:  # type: ignore[no-untyped-def]
    return HttpSource(url, SteppedClock(), **{"connect_timeout": 0.5, "silence": 0.3} | settings)


def grab_on(source: HttpSource) -> None:
    for _ in range(40):
        source.grab(0.05)


def next_of(source: HttpSource, tries: int = 20):  # type: ignore[no-untyped-def]
    for _ in range(tries):
        picture = source.grab(0.2)
        if picture is not None:
            return picture
    raise AssertionError("no picture came")


def test_pictures_come_with_their_capture_times(server: FakeStreamer) -> None:
    clock = SteppedClock(0.1)
    source = HttpSource(server.base, clock)
    source.open()
    server.connected.acquire(timeout=5)
    server.push(part(jpeg(100), 5000.0))
    first = next_of(source)
    for _ in range(10):
        clock.step()  # 1 s passes, but the picture is only 0.4 s younger: 0.6 s on its way
    server.push(part(jpeg(200), 5000.4))
    second = next_of(source)
    assert (first.at, second.at) == pytest.approx((0.0, 0.4))
    assert first.image.shape == (48, 64, 3)
    assert abs(int(first.image[0, 0, 0]) - 100) < 3
    assert abs(int(second.image[0, 0, 0]) - 200) < 3
    source.close()
    source.close()


def test_of_what_waits_the_newest_is_taken_and_a_broken_picture_is_passed_over(server: FakeStreamer) -> None:
    source = source_of(server.url)
    source.open()
    server.connected.acquire(timeout=5)
    server.push(b"".join(part(jpeg(value)) for value in (10, 60, 110)))
    assert abs(int(next_of(source).image[0, 0, 0]) - 110) < 3
    server.push(part(b"no jpeg"))
    assert source.grab(2.0) is None
    server.push(part(jpeg(50)))
    assert abs(int(next_of(source).image[0, 0, 0]) - 50) < 3
    source.close()


class Backlog:
    """A connection on which everything has arrived already."""

    def __init__(self, pieces: list[bytes]) -> None:
        self.pieces = pieces

    def receive(self, timeout: float) -> bytes | None:
        return self.pieces.pop(0) if self.pieces else None

    def close(self) -> None:
        pass


def test_a_backlog_is_drained_to_its_newest_picture(server: FakeStreamer) -> None:
    source = source_of(server.url)
    source.open()
    source._connection = Backlog([part(jpeg(value)) for value in (10, 60, 110, 160)])  # type: ignore[assignment]
    assert abs(int(next_of(source).image[0, 0, 0]) - 160) < 3
    assert source.grab(0.0) is None


def test_a_stream_of_rubbish_a_silent_and_an_ended_stream_are_broken(server: FakeStreamer) -> None:
    source = source_of(server.url)
    source.open()
    server.connected.acquire(timeout=5)
    for _ in range(9):
        server.push(part(b"no jpeg"))
        assert source.grab(2.0) is None
    server.push(part(b"no jpeg"))
    with pytest.raises(DeviceError, match=r"10 pictures in a row are no JPEG"):
        source.grab(2.0)
    source.open()
    with pytest.raises(DeviceError, match=r"sends no picture for 0.3 s"):
        grab_on(source)
    source.open()
    server.down()
    with pytest.raises(DeviceError, match=r"ended the stream|broke"):
        grab_on(source)


def test_servers_that_are_not_there_or_say_no_are_told_with_the_cure(server: FakeStreamer) -> None:
    with pytest.raises(DeviceError, match=r"answers 404: check the path"):
        source_of(server.base + "/nowhere").open()
    gone = server.url
    server.down()
    with pytest.raises(DeviceError, match="cannot be reached"):
        source_of(gone).open()


def test_a_server_that_takes_the_call_and_never_answers_holds_nobody(server: FakeStreamer) -> None:
    server.mute = True
    begun = time.monotonic()
    with pytest.raises(DeviceError, match="does not answer"):
        source_of(server.url).open()
    assert time.monotonic() - begun < 2.0


def dripping(piece: bytes):  # type: ignore[no-untyped-def]
    """A server that sends the piece again and again; returns its port and what ends it."""
    listener = socket.create_server(("127.0.0.1", 0))
    over = threading.Event()

    def serve() -> None:
        client, _ = listener.accept()
        with client, listener:
            while not over.wait(0.02):
                try:
                    client.sendall(piece)
                except OSError:
                    return

    threading.Thread(target=serve, daemon=True).start()
    return listener.getsockname()[1], over


@pytest.mark.parametrize(
    ("piece", "words"),
    [(b"x", "does not answer"), (b"x" * 9000, "without end"), (b"SSH-2.0\r\n\r\n", "speak HTTP")],
)
def test_a_server_that_drips_or_floods_or_speaks_otherwise_ends_in_words(piece: bytes, words: str) -> None:
    port, over = dripping(piece)
    begun = time.monotonic()
    with pytest.raises(DeviceError, match=words):
        Connection(Address("127.0.0.1", port, "/"), 0.4)
    assert time.monotonic() - begun < 2.0
    over.set()


def test_a_document_has_a_deadline_and_a_bound() -> None:
    port, over = dripping(b"HTTP/1.0 200 OK\r\n\r\n")
    with pytest.raises(DeviceError, match="does not finish"):
        fetch(Address("127.0.0.1", port, "/"), 0.3)
    over.set()
    port, over = dripping(b"HTTP/1.0 200 OK\r\n\r\n" + b"x" * 2000)
    with pytest.raises(DeviceError, match="longer than 1000 bytes"):
        fetch(Address("127.0.0.1", port, "/"), 2.0, most=1000)
    over.set()


def test_addresses() -> None:
    secret = parse_address("http://us%40er:pa%3Ass@phone/video")
    assert secret == Address("phone", 80, "/video", "Basic dXNAZXI6cGE6c3M=")
    for bad in ("https://x/", "x", "http://", "http://x:99999/", "http://x/a b", "rtsp://x", "http://ü/"):
        with pytest.raises(DeviceError, match="write http://"):
            parse_address(bad)


def test_secrets_are_not_in_names_and_errors() -> None:
    source = source_of("http://user:secret@127.0.0.1:9/stream")
    assert "secret" not in source.name
    with pytest.raises(DeviceError) as error:
        source.open()
    assert "secret" not in str(error.value)


@settings(deadline=None, max_examples=100)
@given(st.binary(max_size=100))
def test_any_head_is_understood_or_refused(head: bytes) -> None:
    try:
        assert 100 <= parse_head(head, "x").status <= 999
    except DeviceError:
        return


def test_the_password_is_sent() -> None:
    listener = socket.create_server(("127.0.0.1", 0))
    heard: list[bytes] = []

    def serve() -> None:
        client, _ = listener.accept()
        with client, listener:
            heard.append(client.recv(4096))
            client.sendall(b"HTTP/1.0 401 No\r\n\r\n")

    threading.Thread(target=serve, daemon=True).start()
    port = listener.getsockname()[1]
    with pytest.raises(DeviceError, match=r"answers 401: put USER:PASSWORD@"):
        source_of(f"http://a:b@127.0.0.1:{port}/v").open()
    assert heard == [
        f"GET /v HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\nAuthorization: Basic YTpi\r\n\r\n".encode()
    ]
