"""The way in: each request is looked at before anything answers it, and a page on which to log in."""

from __future__ import annotations

import secrets
import time
from http.cookies import SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from lupin_gateway.doors import TOKEN_COOKIE, Doors, NotAdmitted, cookie_of

LOGIN = "/login"
#: The cookie by which a page that is loaded anew is known; it opens nothing.
BROWSER_COOKIE = "lupin_browser"
#: Seconds that a browser is known.
BROWSER_KNOWN_S = 86_400
#: Bytes of a form that is read.
LONGEST_FORM = 4_000

_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Log in</title>
<meta name="viewport" content="width=device-width">
<style>body{{font:16px system-ui;margin:4rem auto;max-width:24rem}}input,button{{font:inherit;width:100%;
box-sizing:border-box;padding:.5rem;margin:.5rem 0}}p{{color:#a00}}</style>
<form method="post"><label>Your token <input type="password" name="token" autofocus
autocomplete="current-password"></label><button>Log in</button></form><p role="alert">{}</p></html>"""
#: Nobody else may show the console in a frame of theirs, and no address goes with a link.
SHIELDS = {
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


class Entrance:
    """Lets requests through to an application that may come in; connections are asked when they are made."""

    def __init__(self, application: ASGIApp, doors: Doors) -> None:
        self._application = application
        self._doors = doors

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, as ASGI has it."""
        if scope["type"] != "http":
            await self._application(scope, receive, send)
            return
        request = Request(scope, receive)
        try:
            if request.url.path == LOGIN and self._doors.asks_for_token:
                response = await self._log_in(request)
            else:
                self._doors.admit(request.headers, time.time())
                await self._application(scope, receive, send)
                return
        except NotAdmitted as refused:
            wants_page = "text/html" in request.headers.get("accept", "")
            response = PlainTextResponse(f"{refused}\n", refused.status)
            if refused.status == 401 and wants_page and request.method == "GET":
                response = RedirectResponse(LOGIN, 303)
        response.headers.update({**SHIELDS, "cache-control": "no-store"})
        await response(scope, receive, send)

    async def _log_in(self, request: Request) -> Response:
        self._doors.check_origin(request.headers)
        if request.method != "POST":
            return HTMLResponse(_PAGE.format(""))
        form = bytearray()
        async for part in request.stream():
            form += part
            if len(form) > LONGEST_FORM:
                return HTMLResponse(_PAGE.format("this is no token"), 413)
        token = parse_qs(form.decode("utf-8", "replace")).get("token", [""])[0].strip()
        try:
            bearer = {**request.headers, "authorization": f"Bearer {token}", "cookie": ""}
            visitor = self._doors.admit(bearer, time.time())
        except NotAdmitted as refused:
            return HTMLResponse(_PAGE.format(refused), refused.status)
        response = RedirectResponse("/", 303)
        response.headers["set-cookie"] = _cookie(TOKEN_COOKIE, token, visitor.expires - time.time(), True)
        return response


def browser_of(headers: Headers, secure: bool) -> tuple[str, list[tuple[bytes, bytes]]]:
    """Return by what a browser is known, and the headers that let it be known again."""
    known = cookie_of(headers, BROWSER_COOKIE)
    if known:
        return known, []
    fresh = secrets.token_urlsafe(16)
    return fresh, [(b"set-cookie", _cookie(BROWSER_COOKIE, fresh, BROWSER_KNOWN_S, secure).encode())]


def _cookie(name: str, value: str, seconds: float, secure: bool) -> str:
    cookie: SimpleCookie = SimpleCookie()
    cookie[name] = value
    about = {"path": "/", "max-age": int(seconds), "httponly": True, "samesite": "Strict", "secure": secure}
    for key, value_ in about.items():
        cookie[name][key] = value_
    return cookie[name].OutputString()
