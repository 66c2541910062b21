import base64
import contextlib
import hashlib
import re
import socket
import threading

import pytest
from camera_watch import Watch, grab_on
from hypothesis import given, settings
from hypothesis import strategies as st
from rude_cameras import Server, claiming, jpeg, part, stream

from lira.hal.errors import DeviceError
from lira.robot.camera.sources.multipart import find_boundary, parse_parts
from lira.robot.camera.sources.opening import open_source

PARTS = b"".join(b"--x\r\nContent-Type: image/jpeg\r\n%s\r\n%s\r\n" % (b"Content-Length: %d\r\n" % 40, body)
                 for body in (b"--x\r\n\r\n" + b"a" * 33, b"b" * 40))  # fmt: skip
LENGTHLESS = b"".join(b"--x\r\nContent-Type: image/jpeg\r\n\r\n%s\r\n" % body for body in (b"a" * 40, b"b" * 40))


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(0, len(PARTS)), stream=st.sampled_from([PARTS, LENGTHLESS + b"--x\r\n"]))
def test_parts_are_found_however_they_are_cut(cut, stream):
    first, rest = parse_parts(stream[:cut], b"x")
    second, _ = parse_parts(rest + stream[cut:], b"x")
    bodies = [part.body for part in first + second]
    assert [body[-1:] for body in bodies] == [b"a", b"b"]
    assert all(len(body) == 40 for body in bodies)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300))
def test_noise_in_a_stream_is_no_error(data):
    parse_parts(data, b"x")


@contextlib.contextmanager
def raw_stream(*pieces):
    """An MJPEG server that sends these bytes, with a pause after each; yields its URL and who has asked."""
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(0.05)
    stop, asked = threading.Event(), []

    def serve():
        while not stop.is_set():
            with contextlib.suppress(OSError):
                connection, _ = listener.accept()
                asked.append(connection)
                connection.settimeout(5.0)
                connection.recv(4096)
                connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=x\r\n\r\n")
                for piece in pieces:
                    connection.sendall(piece)
                    stop.wait(0.1)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/", asked
    finally:
        stop.set()
        thread.join()
        for connection in asked:
            connection.close()
        listener.close()


@pytest.mark.parametrize(
    "odd",
    [
        part(b"", b"X: " + b"y" * 20_000),
        part(b"", b"Content-Length: 99999999999\r\n\r\n"),
        part(b"", b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n"),
        part(b"z" * 600_000, b"X: y\r\n\r\n"),
        b"--x" * 10_000,
        b"\0" * 300_000,
    ],
    ids=["endless head", "long", "longest", "endless body", "boundaries", "noise"],
)
def test_an_odd_part_of_a_stream_is_passed_over(odd, monkeypatch):
    monkeypatch.setattr("lira.robot.camera.sources.multipart.LARGEST_BYTES", 500_000)
    with raw_stream(part(jpeg(1)), odd, part(jpeg(2)) * 2) as (url, asked), Watch(url) as watch:
        assert watch.wait(2).data == jpeg(2)
        assert len(asked) == 1


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.sampled_from([b"--x", b"\r\n", b"\r\n\r\n", b"Content-Length: ", b"7", b"-1", b"a" * 9000]), max_size=60
    )
)
def test_what_is_left_of_a_stream_is_bounded_and_nothing_is_found_twice(pieces):
    data = b"".join(pieces)
    parts, rest = parse_parts(data, b"x")
    assert len(rest) <= len(data)
    assert sum(len(part.body) for part in parts) + len(rest) <= len(data)
    again, _ = parse_parts(rest, b"x")
    assert again == []


ODD = (
    st.binary(max_size=300) | st.builds(part, st.binary(max_size=300)) | st.just(claiming(jpeg(0, noise=1.0))).map(part)
)


@settings(max_examples=6, deadline=None)
@given(st.lists(ODD, max_size=4).map(b"".join))
def test_whatever_a_camera_sends_it_shows_the_next_picture(odd):
    with raw_stream(odd, part(jpeg(2)) * 2) as (url, _), Watch(url) as watch:
        assert watch.wait(1, 10.0).data == jpeg(2)


PICTURE = jpeg(3)
HEAD = "HTTP/1.0 %s\r\n%s\r\n\r\n"


@pytest.mark.parametrize(
    ("kind", "lead"),
    [
        ("multipart/mixed; boundary=x", b""),
        ("multipart/x-mixed-replace", b""),
        ("multipart/x-mixed-replace;boundary=--x", b""),
        ('Multipart/X-Mixed-Replace; Boundary="x"', b"\r\n"),
        ("application/octet-stream", b""),
        ("application/octet-stream", b"\r\n"),
    ],
)
def test_a_stream_is_known_by_what_it_holds(kind, lead):
    head = (HEAD % ("200 OK", f"Content-Type: {kind}")).encode() + lead
    with Server(stream(PICTURE, head=head)) as server, Watch(server.url) as watch:
        assert watch.wait(2).data == PICTURE


def test_a_boundary_is_found_or_there_is_none():
    assert find_boundary(b"\r\n--ffmpeg\r\nContent-type: image/jpeg\r\n") == b"ffmpeg"
    assert find_boundary(b"--my boundary\r\nContent-type: image/jpeg\r\n") == b""
    assert find_boundary(b"\xff\xd8\xff\xe0--") == b""


def test_what_has_no_boundaries_is_no_stream():
    def serve(server, connection, _):
        connection.sendall((HEAD % ("200 OK", "Content-Type: application/octet-stream")).encode())
        while not server.stop.wait(0.01):
            connection.sendall(PICTURE)

    with Server(serve) as server:
        source = open_source(server.url, (640, 480), None)
        with pytest.raises(DeviceError, match="no boundaries"):
            grab_on(source)
        source.close()


def test_a_first_picture_may_take_four_seconds():
    with Server(stream(PICTURE, first_after_s=4.0)) as server, Watch(server.url) as watch:
        assert watch.wait(1, 8.0).data == PICTURE
        assert len(server.requests) == 1


NAME, PASSWORD = "op", "se cr@t/:"
LOGIN = f"{NAME}:se%20cr%40t%2F%3A@"


def wanting(scheme):
    """Serve pictures to whoever knows the password."""

    def knows(request):
        answer = re.search(r"Authorization: (\w+) (.*)", request)
        if answer is None or answer[1] != scheme:
            return False
        if scheme == "Basic":
            return base64.b64decode(answer[2]).decode() == f"{NAME}:{PASSWORD}"
        said = dict(re.findall(r'(\w+)="?([^",\r]*)', answer[2]))
        secret = hashlib.md5(f"{NAME}:camera:{PASSWORD}".encode()).hexdigest()
        asked = hashlib.md5(f"GET:{said['uri']}".encode()).hexdigest()
        whole = f"{secret}:{said['nonce']}:{said['nc']}:{said['cnonce']}:auth:{asked}"
        return said["response"] == hashlib.md5(whole.encode()).hexdigest()

    def serve(server, connection, request):
        if knows(request):
            stream(PICTURE)(server, connection, request)
        more = ', nonce="abc", qop="auth"' if scheme == "Digest" else ""
        head = f'WWW-Authenticate: {scheme} realm="camera"{more}\r\nContent-Length: 0'
        connection.sendall((HEAD % ("401 Unauthorized", head)).encode())

    return serve


@pytest.mark.parametrize("scheme", ["Basic", "Digest"])
def test_a_camera_that_wants_a_password_gets_it_and_nobody_else_reads_it(scheme, capfd):
    with Server(wanting(scheme)) as server:
        url = server.url.replace("//", f"//{LOGIN}") + "video?pwd=hunter2"
        with Watch(url) as watch:
            assert watch.wait(1).data == PICTURE
        with pytest.raises(DeviceError, match="wants a name and a password") as refused:
            open_source(url.replace("se%20", "x"), (640, 480), None)
        source = open_source(url, (640, 480), None)
        server.stop.set()
        with pytest.raises(DeviceError, match="was lost") as lost:
            grab_on(source)
        source.close()
        for told in (refused, lost):
            assert not any(secret in str(told.value) for secret in (PASSWORD, "se%20", "xcr", "hunter2"))
    assert "cr@t" not in "".join(capfd.readouterr())


def test_a_redirection_is_followed_and_the_password_does_not_go_along():
    with Server(stream(PICTURE)) as other:

        def redirect(server, connection, _):
            connection.sendall((HEAD % ("302 Found", f"Location: {other.url}there\r\nContent-Length: 0")).encode())

        with Server(redirect) as server, Watch(server.url.replace("//", f"//{LOGIN}")) as watch:
            assert watch.wait(1).data == PICTURE
        assert other.requests[0].startswith("GET /there ")
        assert "Authorization" not in "".join(other.requests)


def test_a_camera_that_redirects_to_itself_is_refused():
    def redirect(server, connection, _):
        connection.sendall((HEAD % ("302 Found", f"Location: {server.url}\r\nContent-Length: 0")).encode())

    with Server(redirect) as server, pytest.raises(DeviceError, match="no MJPEG stream"):
        open_source(server.url, (640, 480), None)
