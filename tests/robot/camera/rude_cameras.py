"""Network cameras that behave like real ones: plain sockets, whose every byte the test chooses."""

import contextlib
import io
import socket
import struct
import threading
import time
from fractions import Fraction

import cv2
import numpy as np


def jpeg(gray, size=(640, 480), noise=0.0):
    pixels = np.full((size[1], size[0], 3), gray, np.uint8)
    if noise:
        pixels = np.random.default_rng(0).integers(0, 255, pixels.shape).astype(np.uint8)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def claiming(data, width=65500, height=65500):
    """A JPEG whose frame header says that it is larger."""
    at = data.index(b"\xff\xc0")
    return data[: at + 5] + height.to_bytes(2) + width.to_bytes(2) + data[at + 9 :]


def part(body, head=b""):
    head = head or b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(body)
    return b"--x\r\n" + head + body + b"\r\n"


def clock_picture(size, now_s):
    """A picture of noise that shows when it was taken: 24 blocks in its first rows, a bit of milliseconds each."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 255, (size[1] // 4, size[0] // 4, 3)).astype(np.uint8)
    pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_LINEAR)
    bits, step = round(now_s * 1000) & 0xFFFFFF, size[0] / 24
    for bit in range(24):
        pixels[: size[1] // 8, round(bit * step) : round((bit + 1) * step)] = 255 * (bits >> bit & 1)
    return pixels


def taken_s(pixels, near_s):
    """When a picture was taken by what it shows, seconds near `near_s`."""
    height, width = pixels.shape[:2]
    step = width / 24
    bits = sum(1 << bit for bit in range(24) if pixels[height // 16, round((bit + 0.5) * step)].mean() > 127)
    near = round(near_s * 1000)
    return (near - ((near - bits) & 0xFFFFFF)) / 1000


class Server:
    """Accepts on a port of its own and has `serve(connection, request)` answer; ends with the block."""

    def __init__(self, serve):
        self._serve = serve
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.05)
        self.port = self._listener.getsockname()[1]
        self.stop = threading.Event()
        self.requests = []
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop.set()
        for thread in self._threads:
            thread.join()
        self._listener.close()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def _accept(self):
        while not self.stop.is_set():
            with contextlib.suppress(TimeoutError):
                connection, _ = self._listener.accept()
                connection.settimeout(2.0)
                thread = threading.Thread(target=self._talk, args=[connection])
                self._threads.append(thread)
                thread.start()

    def _talk(self, connection):
        with connection, contextlib.suppress(OSError):
            request = b""
            while b"\r\n\r\n" not in request:
                data = connection.recv(4096)
                if not data:
                    return
                request += data
            self.requests.append(request.decode())
            self._serve(self, connection, self.requests[-1])


OK = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=x\r\n\r\n"


def stream(*pictures, head=OK, first_after_s=0.0, every_s=0.05):
    """Send these pictures over and over."""

    def serve(server, connection, _):
        connection.sendall(head)
        server.stop.wait(first_after_s)
        while not server.stop.is_set():
            for picture in pictures:
                connection.sendall(part(picture))
                server.stop.wait(every_s)

    return serve


def clock_stream(size, rate_hz, stamped=True):
    """Send pictures that show when they were taken; what the network does not take waits here, as in a real camera."""

    def serve(server, connection, _):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        connection.settimeout(20.0)
        connection.sendall(OK)
        due_s = time.monotonic()
        while not server.stop.is_set():
            due_s += 1 / rate_hz
            server.stop.wait(max(due_s - time.monotonic(), 0.0))
            now_s = time.monotonic()
            body = cv2.imencode(".jpg", clock_picture(size, now_s), [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
            stamp = b"X-Timestamp: %.6f\r\n" % now_s if stamped else b""
            connection.sendall(part(body, stamp + b"Content-Length: %d\r\n\r\n" % len(body)))

    return serve


class Packets(io.RawIOBase):
    """Where FFmpeg's muxer leaves the packets of a stream."""

    def __init__(self):
        self.waiting = []

    def writable(self):
        return True

    def write(self, data):
        self.waiting.append(bytes(data))
        return len(data)


TICKS_HZ = 90_000  # of RTP
SDP = (
    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=x\r\nt=0 0\r\n"
    "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=control:0\r\n"
)


def rtsp(size, rate_hz, stall=None):
    """An RTSP server that sends H.264 over the same connection. While `stall` is set it keeps what it would send."""

    def serve(server, connection, request):
        connection.settimeout(20.0)
        waiting = request
        while True:
            words = waiting.split()
            number = next(line.split(":")[1].strip() for line in waiting.split("\r\n") if line.startswith("CSeq"))
            more = {
                "OPTIONS": "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n",
                "DESCRIBE": f"Content-Type: application/sdp\r\nContent-Length: {len(SDP)}\r\n",
                "SETUP": "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n",
            }.get(words[0], "Session: 1\r\n")
            body = SDP if words[0] == "DESCRIBE" else ""
            connection.sendall(f"RTSP/1.0 200 OK\r\nCSeq: {number}\r\n{more}\r\n{body}".encode())
            if words[0] == "PLAY":
                break
            waiting = connection.recv(4096).decode()
        play(server, connection, size, rate_hz, stall)

    return serve


def play(server, connection, size, rate_hz, stall):
    import av

    packets = Packets()
    container = av.open(packets, "w", format="rtp", container_options={"packetsize": "1400"}, buffer_size=1400)
    options = {"tune": "zerolatency", "preset": "ultrafast", "g": "15", "x264-params": "repeat-headers=1"}
    video = container.add_stream("libx264", rate=rate_hz, options=options)
    video.width, video.height, video.pix_fmt = *size, "yuv420p"
    video.codec_context.time_base = Fraction(1, TICKS_HZ)
    start_s = time.monotonic()
    number = 0
    while not server.stop.is_set():
        number += 1
        server.stop.wait(max(start_s + number / rate_hz - time.monotonic(), 0.0))
        now_s = time.monotonic()
        frame = av.VideoFrame.from_ndarray(clock_picture(size, now_s), format="rgb24")
        frame.pts, frame.time_base = round((now_s - start_s) * TICKS_HZ), Fraction(1, TICKS_HZ)
        for packet in video.encode(frame):
            container.mux(packet)
        if stall is not None and stall.is_set():
            continue
        for data in packets.waiting:
            control = 200 <= data[1] <= 204
            connection.sendall(b"$" + struct.pack(">BH", control, len(data)) + data)
        packets.waiting.clear()
