"""ASGI middleware that authenticates each HTTP request, and serves the login page and the browser's cookie.

WebSocket connections pass through: the server authenticates them by `admit_visitor` when they are made.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import html
import secrets
from http.cookies import SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from lupin_gateway.access import TOKEN_COOKIE, NotAdmitted, Visitor, cookie_of
from lupin_gateway.entry.gate import CONNECTION, Gate
from lupin_gateway.guard import GatewayRules

LOGIN = "/login"
#: Key in the scope of a request: what stands before the paths of its robot; none where there is one only.
BASE = "lupin_base"
#: The cookie by which a page that is loaded anew is known; it opens nothing.
BROWSER_COOKIE = "lupin_browser"
#: Seconds that a browser is known.
BROWSER_KNOWN_S = 86_400
#: Bytes of a form that is read.
LONGEST_FORM = 4_000

#: Seconds in which it is to be there.
FORM_WITHIN_S = 10.0

_STYLE = (
    "body{font:16px system-ui;margin:4rem auto;max-width:24rem;padding:0 1rem}input,button{font:inherit;"
    "width:100%;box-sizing:border-box;padding:.5rem;margin:.5rem 0}p{color:#a00}"
)
#: A link has its code behind the #, which no browser sends to a server, and no server logs.
_SCRIPT = (
    "const code=location.hash.slice(1);if(code){history.replaceState(null,'',location.pathname);"
    "const form=document.forms[0];form.code.value=code;form.submit()}"
)
_HEAD = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>Log in</title>
<meta name="viewport" content="width=device-width"><style>{_STYLE}</style>
<form method="post"><label>Your token <input type="password" name="token" autofocus
autocomplete="current-password"></label><input type="hidden" name="code"><button>Log in</button></form>
<p role="alert">"""
_FOOT = f"</p><script>{_SCRIPT}</script></html>"


def _only(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


_POLICY = (
    f"default-src 'none'; style-src {_only(_STYLE)}; script-src {_only(_SCRIPT)}; form-action 'self'; "
    "base-uri 'none'; frame-ancestors 'none'"
)
#: Nobody else may show the console in a frame of theirs, and no address goes with a link to others. (Without
#: any address at all, browsers would not say either that the form to log in is this gateway's own.)
SECURITY_HEADERS = {
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "same-origin",
    "x-content-type-options": "nosniff",
}


async def admit_visitor(rules: GatewayRules, gate: Gate, connection: HTTPConnection) -> Visitor:
    """Authenticate a request or connection, and give it a visitor's place at the gate.

    Raises:
        NotAdmitted: refused; after a delay where a wrong token was sent.
    """
    try:
        visitor = rules.access.admit(connection.headers, rules.clocks.wall())
    except NotAdmitted as refused:
        await asyncio.sleep(rules.refused_entry(address_of(connection), refused))
        raise
    gate.admit(connection.scope.get(CONNECTION), visitor)
    return visitor


def address_of(connection: HTTPConnection) -> str:
    """Return the address of the client; '' where it is not known."""
    return connection.client.host if connection.client else ""


class AuthMiddleware:
    """Answers a request of a client that is not authenticated; passes all others to the application."""

    def __init__(self, application: ASGIApp, rules: GatewayRules, gate: Gate) -> None:
        self._application = application
        self._rules = rules
        self._gate = gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request (ASGI). A browser without a token is redirected to the login page."""
        if scope["type"] != "http":
            await self._application(scope, receive, send)
            return
        request = Request(scope, receive)
        try:
            if request.url.path == LOGIN and self._rules.access.asks_for_token:
                response = await self._log_in(request)
            else:
                await admit_visitor(self._rules, self._gate, request)
                await self._application(scope, receive, send)
                return
        except NotAdmitted as refused:
            wants_page = "text/html" in request.headers.get("accept", "")
            response = PlainTextResponse(f"{refused}\n", refused.status)
            if refused.status == 401 and wants_page and request.method == "GET":
                response = RedirectResponse(scope.get(BASE, "") + LOGIN, 303)
        response.headers.update({**SECURITY_HEADERS, "cache-control": "no-store"})
        await response(scope, receive, send)

    async def _log_in(self, request: Request) -> Response:
        self._rules.access.check_origin(request.headers)
        if request.method != "POST":
            return _page("")
        try:
            form = await asyncio.wait_for(_form(request), FORM_WITHIN_S)
        except asyncio.TimeoutError:
            return _page("the form did not arrive in time", 408)
        if form is None:
            return _page("this is no token", 413)
        wall, address = self._rules.clocks.wall(), address_of(request)
        try:
            if code := form.get("code", ""):
                name = self._rules.use_invitation(code)
                token, visitor = self._rules.access.token_for(name, wall)
            else:
                token = form.get("token", "")
                headers = {**request.headers, "authorization": f"Bearer {token}", "cookie": ""}
                visitor = self._rules.access.admit(headers, wall)
        except NotAdmitted as refused:
            await asyncio.sleep(self._rules.refused_entry(address, refused))
            return _page(str(refused), refused.status)
        self._rules.write_login(visitor.name, address, True, "by a link" if code else "by token")
        response = RedirectResponse(request.scope.get(BASE, "") + "/", 303)
        response.headers["set-cookie"] = _cookie(TOKEN_COOKIE, token, visitor.expires - wall, True)
        return response


def _page(problem: str, status: int = 200) -> Response:
    page = f"{_HEAD}{html.escape(problem)}{_FOOT}"
    return HTMLResponse(page, status, {"content-security-policy": _POLICY})


async def _form(request: Request) -> dict[str, str] | None:
    """Return the fields of a form; None where it is too long."""
    form = bytearray()
    async for part in request.stream():
        form += part
        if len(form) > LONGEST_FORM:
            return None
    fields = parse_qs(form.decode("utf-8", "replace"))
    return {name: values[0].strip() for name, values in fields.items()}


def browser_of(headers: Headers, secure: bool) -> tuple[str, list[tuple[bytes, bytes]]]:
    """Return the id of a browser, from its cookie or a new one, and the headers that set the cookie."""
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
