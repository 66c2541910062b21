"""A network camera: the twin's pictures as an MJPEG stream over HTTP on this machine."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

BOUNDARY = "picture"
WAIT_S = 0.5


class MjpegServer:
    """Serves at `url` the JPEG that was shown last, to whoever asks, from construction until `close`."""

    def __init__(self, port: int = 0) -> None:
        self._changed = threading.Condition()
        self._picture: bytes | None = None
        self._count = 0
        self._ended = False
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
                self.end_headers()
                camera._stream(self)

            def log_message(self, *_: object) -> None:
                """Say nothing."""

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
        self._thread.start()

    def show(self, jpeg: bytes) -> None:
        """Send this picture to everybody."""
        with self._changed:
            self._picture, self._count = jpeg, self._count + 1
            self._changed.notify_all()

    def close(self) -> None:
        """End all streams. May be called twice."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def _stream(self, handler: BaseHTTPRequestHandler) -> None:
        seen = 0
        while not self._ended:
            with self._changed:
                self._changed.wait_for(lambda seen=seen: self._ended or self._count != seen, WAIT_S)  # type: ignore[misc]
                picture, count = self._picture, self._count
            if picture is None or count == seen or self._ended:
                continue
            seen = count
            head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
            try:
                handler.wfile.write(head.encode() + picture + b"\r\n")
            except OSError:
                return  # whoever watched has gone
