"""A stream over HTTP: name and password, redirections, and a socket that can be told how long to wait."""

import contextlib
import http.client
import socket
import urllib.request
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit, urlunsplit

from lira.hal.errors import DeviceError
from lira.robot.camera.address import Address

ANSWER_S = 5.0  # to connect, and again until it answers
UNAUTHORISED = (http.HTTPStatus.UNAUTHORIZED, http.HTTPStatus.FORBIDDEN)
FAULTS = (OSError, ValueError, AttributeError, http.client.HTTPException)  # what the standard library lets through


class HttpStream:
    """The answer of the camera at `address`. Raises `DeviceError`, never with the password in it."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._sockets: list[socket.socket] = []
        self._answers: list[http.client.HTTPResponse] = []
        try:
            self._answer: Any = self._opener().open(address.url, timeout=ANSWER_S)
            self._close_all_but(self._answer)
        except HTTPError as error:
            error.close()
            self._close_all_but(None)
            raise self._refused(error.code) from error
        except FAULTS as error:
            self._close_all_but(None)
            what = f"no camera answers at {address.shown}: {words(error)}"
            raise DeviceError(what, "Check the address and the network.") from error

    @property
    def kind(self) -> str:
        """The content type, in lower case."""
        return str(self._answer.headers.get_content_type())

    @property
    def boundary(self) -> bytes:
        """What stands between two parts, without its dashes; empty if it does not say."""
        return str(self._answer.headers.get_boundary("") or "").removeprefix("--").encode()

    def set_timeout(self, seconds: float) -> None:
        """Wait so long for what comes next, from now on."""
        with contextlib.suppress(OSError):
            self._sockets[-1].settimeout(seconds)

    def read(self, most: int) -> bytes:
        """Return what has come, b"" at the end; raises `FAULTS`, also when nothing comes for too long."""
        data: bytes = self._answer.read1(most)
        return data

    @property
    def socket(self) -> socket.socket:
        """The socket that the stream comes over."""
        return self._sockets[-1]

    def shut_down(self) -> None:
        """End it from another thread: whoever waits for it comes back."""
        with contextlib.suppress(OSError):
            self._sockets[-1].shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Let go of it. May be called twice."""
        with contextlib.suppress(*FAULTS):
            self._answer.close()

    def _close_all_but(self, last: Any) -> None:
        """Let go of refusals and redirections that came on the way."""
        for answer in self._answers:
            if answer is not last:
                answer.close()
        for each in self._sockets if last is None else self._sockets[:-1]:
            each.close()

    def _opener(self) -> urllib.request.OpenerDirector:
        """Ask the camera itself, not a proxy; the password is for this camera only, wherever it redirects to."""
        parts = urlsplit(self._address.url)
        passwords = urllib.request.HTTPPasswordMgrWithDefaultRealm()
        if self._address.name or self._address.password:
            everything_there = urlunsplit((parts.scheme, parts.netloc, "/", "", ""))
            passwords.add_password(None, everything_there, self._address.name, self._address.password)
        opener = urllib.request.OpenerDirector()
        for handler in (
            _Http(self._connection_of(http.client.HTTPConnection)),
            _Https(self._connection_of(http.client.HTTPSConnection)),
            urllib.request.HTTPRedirectHandler(),
            urllib.request.HTTPDigestAuthHandler(passwords),
            urllib.request.HTTPBasicAuthHandler(passwords),
            urllib.request.HTTPErrorProcessor(),
            urllib.request.HTTPDefaultErrorHandler(),
        ):
            opener.add_handler(handler)
        return opener

    def _connection_of(self, kind: type[http.client.HTTPConnection]) -> Any:
        """Make a kind of connection that notes its sockets and answers: the library gives away neither."""
        sockets, answers = self._sockets, self._answers

        class Noting(kind):  # type: ignore[misc, valid-type]
            def connect(self) -> None:
                super().connect()
                sockets.append(self.sock)

            def getresponse(self) -> http.client.HTTPResponse:
                answer: http.client.HTTPResponse = super().getresponse()
                answers.append(answer)
                return answer

        return Noting

    def _refused(self, status: int) -> DeviceError:
        if status in UNAUTHORISED:
            what = f"the camera at {self._address.shown} wants a name and a password that it knows ({status})"
            return DeviceError(what, "Write them into its address: http://NAME:PASSWORD@HOST/...")
        return DeviceError(
            f"{self._address.shown} is no MJPEG stream ({status})", "Give the address of the stream itself."
        )


def words(error: Exception) -> str:
    """Say why a stream failed. What the library says of an address may hold all of it, so it is not quoted."""
    if isinstance(error, URLError):
        return str(error.reason)
    return error.strerror or str(error) if isinstance(error, OSError) else type(error).__name__


class _Http(urllib.request.HTTPHandler):
    def __init__(self, connection: Any) -> None:
        super().__init__()
        self._connection = connection

    def http_open(self, request: urllib.request.Request) -> http.client.HTTPResponse:
        return self.do_open(self._connection, request)


class _Https(urllib.request.HTTPSHandler):
    def __init__(self, connection: Any) -> None:
        super().__init__()
        self._connection = connection

    def https_open(self, request: urllib.request.Request) -> http.client.HTTPResponse:
        return self.do_open(self._connection, request)
