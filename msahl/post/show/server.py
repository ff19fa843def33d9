"""Serve one page on this machine and tell it when it has changed: a small server for reading only.

    GET /TOKEN/                     the page as it is now
    GET /TOKEN/version?after=N      {"version": M} as soon as M is not N, or after some seconds

It listens on 127.0.0.1 alone. The token, which is in the address that is printed, keeps other users
of the machine from reading the deck, and the check of the host keeps other pages of the browser
from it. Nothing else is served, and no file is opened because of a request.
"""

import json
import secrets
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

HOST = "127.0.0.1"
PATIENCE = 20.0
"""Seconds after which a question for a change is answered without one."""


class PageServer:
    """A page that may be replaced while it is served, from ``start`` to ``close``."""

    def __init__(self) -> None:
        self.version = 0
        self._html = b""
        self._changed = threading.Condition()
        self._token = secrets.token_urlsafe(12)
        self._server = _Server((HOST, 0), _handler(self))
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def hosts(self) -> tuple[str, str]:
        """Hosts that a request may name."""
        port = self._server.server_address[1]
        return (f"{HOST}:{port}", f"localhost:{port}")

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{self.hosts[0]}/{self._token}/"

    def start(self) -> None:
        """Begin to answer requests, in a thread of its own."""
        self._thread.start()

    def close(self) -> None:
        """End the server."""
        self._server.shutdown()
        self._server.server_close()

    def replace(self, html: str) -> None:
        """Make this the page, with the next version."""
        with self._changed:
            self._html = html.encode()
            self.version += 1
            self._changed.notify_all()

    def answer(self, target: str) -> tuple[str, bytes] | None:
        """Return type and content of the answer to a request; None if there is nothing."""
        try:
            parts = urlsplit(target)
        except ValueError:  # such as http://[
            return None
        if parts.path == f"/{self._token}/":
            return "text/html; charset=utf-8", self._html
        if parts.path == f"/{self._token}/version":
            after = parse_qs(parts.query).get("after", ["-1"])[0]
            with self._changed:
                self._changed.wait_for(lambda: str(self.version) != after, PATIENCE)
                return "application/json", json.dumps({"version": self.version}).encode()
        return None


class _Server(ThreadingHTTPServer):
    """Answers each request in a thread of its own; that a browser hangs up is no fault."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print the fault of an answer, unless its connection is closed."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def _handler(page: PageServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Answers GET; every other method gets 501."""

        def do_GET(self) -> None:
            """Answer a request."""
            named = self.headers.get("Host", "")
            found = page.answer(self.path) if named in page.hosts else None
            if found is None:
                self.send_error(404)
                return
            kind, content = found
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: Any) -> None:
            """Print nothing."""

    return Handler
