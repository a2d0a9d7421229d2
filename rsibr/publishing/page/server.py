"""Server of one page on the loopback interface."""

from __future__ import annotations

from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from rsibr.errors import InputError

HOST = "127.0.0.1"
"""Loopback: no other machine reaches it."""


class PageServer(ThreadingHTTPServer):
    """Serves one page at `/`, and nothing else.

    Parameters
    ----------
    html : str
        The page.
    port : int
        Port; 0 has the system choose a free one.

    Raises
    ------
    InputError
        If the port is taken, or not allowed.
    """

    daemon_threads = True  # a browser that keeps its connection open holds up no end

    def __init__(self, html: str, port: int = 0) -> None:
        self.page = html.encode()
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "it is none"
            what = f"port {port} cannot be used ({reason})"
            raise InputError(what, where="--port", fix="give another, or leave it out") from error

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.server_port}/"

    def is_own(self, host: str | None) -> bool:
        """Whether a request was addressed to this server: a name of another's that leads here reads nothing."""
        return host in (f"{HOST}:{self.server_port}", f"localhost:{self.server_port}")


class _Handler(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        self._answer(with_page=True)

    def do_HEAD(self) -> None:
        self._answer(with_page=False)

    def _answer(self, *, with_page: bool) -> None:
        if not self.server.is_own(self.headers.get("Host")):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
            return
        if self.path.partition("?")[0] != "/":
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(self.server.page)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if with_page:
            self.wfile.write(self.server.page)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: stderr belongs to the command."""
