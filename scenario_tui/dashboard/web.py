"""The dashboard in a browser: each open page has its own dashboard, a process of this machine.

Browsers let any web page open websockets to this machine, and the owner of a name can point it to
127.0.0.1. Therefore requests must name the address of the dashboard, and websockets must come from
its page, which loads nothing from elsewhere. Other accounts of this machine reach the port, too, so
the address has a key, which the browser keeps as a cookie.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import shlex
from base64 import b64encode
from collections.abc import Awaitable, Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import aiohttp_jinja2
import psutil
from aiohttp import web
from textual_serve.server import Server

_HOST: Final = "127.0.0.1"
_PATIENCE: Final = 5.0
"""Seconds for dashboards to end with the server."""
_FOCUS: Final = (
    "addEventListener('load', () => document.querySelector('.xterm-helper-textarea').focus())"
)
"""Script of the page: it gives keys to the dashboard without a click."""
_DIGEST: Final = b64encode(sha256(_FOCUS.encode()).digest()).decode()
_POLICY: Final = (
    f"default-src 'self'; script-src 'self' 'sha256-{_DIGEST}';"
    " style-src 'self' 'unsafe-inline'; img-src 'self' data:;"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_TERMINAL: Final = {
    "TERM": "xterm-256color",
    "COLORTERM": "truecolor",
    "SCENARIO_GLYPHS": "unicode",
}
"""Variables of the terminal in the page, in place of those of the server's terminal."""
_OTHER_TERMINAL: Final = ("TMUX", "COLORFGBG", "NO_COLOR")

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class DashboardServer(Server):
    """Serves the dashboard of a ``command`` on a port of this machine, to this machine alone.

    ``public_url`` is the address at which the user's proxy shows it to others. Then the proxy
    decides who may see it, and there is no key. Users open ``address``.
    """

    def __init__(self, command: Sequence[str], port: int, public_url: str = "") -> None:
        super().__init__(
            f"exec {shlex.join(command)}",
            _HOST,
            port,
            "scenario",
            public_url.rstrip("/") or f"http://{_HOST}:{port}",
            templates_path=Path(__file__).parent / "page",
        )
        public = urlsplit(self.public_url)
        self._origin = f"{public.scheme}://{public.netloc}"
        self._hosts = {public.netloc, f"{_HOST}:{port}"}
        self._key = "" if public_url else secrets.token_urlsafe(16)
        self._cookie = f"scenario-{port}"
        self.address = f"{self.public_url}/" + (f"?key={self._key}" if self._key else "")
        self._sessions: set[asyncio.Task[Any]] = set()

    async def _make_app(self) -> web.Application:
        app = await super()._make_app()
        aiohttp_jinja2.get_env(app).globals["focus"] = _FOCUS
        app.middlewares.append(self._refuse_foreign_pages)
        app.on_response_prepare.append(_set_policy)
        return app

    async def on_startup(self, _: web.Application) -> None:
        """Print nothing: the command prints the address."""

    async def on_shutdown(self, _: web.Application) -> None:
        """End all dashboards."""
        for session in self._sessions:
            session.cancel()
        if self._sessions:
            await asyncio.wait(self._sessions, timeout=_PATIENCE)

    @web.middleware
    async def _refuse_foreign_pages(
        self, request: web.Request, handler: _Handler
    ) -> web.StreamResponse:
        origin = request.headers.get("Origin", "" if request.path == "/ws" else self._origin)
        if request.host not in self._hosts or origin != self._origin:
            raise web.HTTPForbidden(text=f"the dashboard is at {self.public_url}/\n")
        key = request.query.get("key", request.cookies.get(self._cookie, ""))
        is_open = request.path.startswith("/static/") or not self._key
        if not is_open and not secrets.compare_digest(key.encode(), self._key.encode()):
            raise web.HTTPForbidden(text="open the address that `scenario tui --web` has printed\n")
        response = await handler(request)
        if request.path == "/":
            response.set_cookie(self._cookie, self._key, httponly=True, samesite="Strict")
        return response

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """Run a dashboard for a page until either is closed."""
        session = asyncio.current_task()
        assert session is not None
        self._sessions.add(session)
        try:
            return await super().handle_websocket(request)
        finally:
            self._sessions.discard(session)

    def serve_until_stopped(self, on_ready: Callable[[], None]) -> None:
        """Serve until SIGINT or SIGTERM, then end all dashboards.

        Calls ``on_ready`` once pages can be opened. Raises ``OSError`` if the port is taken.
        """
        for name in _OTHER_TERMINAL:
            os.environ.pop(name, None)
        os.environ.update(_TERMINAL)
        try:
            web.run_app(
                self._make_app(),
                host=_HOST,
                port=self.port,
                shutdown_timeout=_PATIENCE,
                print=lambda _: on_ready(),
            )
        finally:
            children = psutil.Process().children(recursive=True)
            for child in psutil.wait_procs(children, _PATIENCE)[1]:
                child.kill()


async def _set_policy(_: web.Request, response: web.StreamResponse) -> None:
    response.headers["Content-Security-Policy"] = _POLICY
    response.headers["X-Content-Type-Options"] = "nosniff"
