"""Access control: tokens, origins, roles, the allow list of names, and rate limits of one client.

Pure: the wall clock is an argument. A refusal is a sentence that says what to do; none has a token in it.
"""

from __future__ import annotations

import enum
import hashlib
import hmac
import math
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from fnmatch import translate
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import urlsplit

from lupin_engine.errors import LupinError, Problems, meant, nearest, or_else, shortened
from lupin_engine.plugin import Access
from lupin_gateway.motion.names import MotionNames
from lupin_greenhouse import HMI_TOPIC

#: The topic on which pages publish their software stops. Every visitor may publish there: `stop` judges.
STOP_TOPIC = HMI_TOPIC
#: The cookie that carries a token.
TOKEN_COOKIE = "lupin_token"
#: The longest frame, in bytes; what one client may subscribe to; and its operations a second.
LONGEST_FRAME, MOST_SUBSCRIPTIONS, OPERATIONS_PER_S = 1_000_000, 64, 100
#: Bytes of a long frame that count as one operation: what is in it is read, checked and kept.
BYTES_AN_OPERATION = 10_000
#: Letters of a token: `openssl rand -hex 32` writes 64.
SHORTEST_TOKEN = 32
_HERE = frozenset({"localhost", "127.0.0.1", "::1"})


class UserRole(enum.IntEnum):
    """The roles, ascending: each has the permissions of the lower ones."""

    VIEWER = 1
    OPERATOR = 2
    ENGINEER = 3

    @property
    def word(self) -> str:
        """The role in texts and files."""
        return self.name.lower()


class Use(enum.Enum):
    """How a name of the network is used, as words of a sentence."""

    SUBSCRIBE = "subscribing to"
    PUBLISH = "publishing on"
    CALL = "calling"
    ACTION = "commanding the action"


#: Returns why a client may not use a name so, or know of it; '' where it may.
UseRefusal = Callable[[Use, str], str]


@dataclass(frozen=True)
class Visitor:
    """An authenticated client: name, role, and until when, in seconds of the wall clock (UNIX).

    `mark` is the hash of the token; '' where none is asked for.
    """

    name: str
    role: UserRole
    expires: float = math.inf
    mark: str = field(default="", repr=False, compare=False)

    def has_expired(self, wall: float) -> str:
        """Return a sentence that the token has expired; '' while it has not."""
        if self.expires > wall:
            return ""
        day = datetime.fromtimestamp(self.expires - 1, timezone.utc).date()
        return f"the token of {self.name} has expired with {day}; ask for a new one"


class NotAdmitted(LupinError):
    """A client is refused: the status of HTTP, and whether it gave a wrong token or code."""

    def __init__(self, status: int, text: str, *, wrong: bool = False) -> None:
        super().__init__(text)
        self.status = status
        self.wrong = wrong


# -- tokens -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class IssuedToken:
    """A line of the file of tokens. The token itself is in no text of this object."""

    visitor: Visitor
    secret: str = field(repr=False)


class BadTokens(LupinError):
    """A file of tokens has errors; `good` are the tokens of its correct lines."""

    def __init__(self, text: str, good: Iterable[IssuedToken] = ()) -> None:
        super().__init__(text)
        self.good = tuple(good)


def read_tokens(file: Path) -> tuple[IssuedToken, ...]:
    """Return the tokens of a file; each line is `NAME ROLE EXPIRES TOKEN`, and `#` begins a remark.

    EXPIRES is a day (its end, UTC), such as 2026-12-31.

    Raises:
        BadTokens: all errors of the file, each with its line; no text has a token in it.
    """
    problems, found = Problems(), dict[str, IssuedToken]()
    try:
        with file.open(encoding="utf-8") as lines:
            problems.add(*_too_open(file, os.fstat(lines.fileno())))
            for number, line in enumerate(lines, 1):
                words = line.partition("#")[0].split()
                if not words:
                    continue
                wrong = list(_token_problems(words, found))
                problems.add(*(f"{file}:{number}: {text}" for text in wrong))
                if not wrong:
                    name, role, day, secret = words
                    mark = hashlib.sha256(secret.encode()).hexdigest()
                    visitor = Visitor(name, UserRole[role.upper()], _end_of(day) or 0.0, mark)
                    found[name] = IssuedToken(visitor, secret)
    except (OSError, UnicodeDecodeError) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else "it is not a text in UTF-8"
        raise BadTokens(f"{file}: the tokens cannot be read: {reason}") from None
    try:
        problems.raise_any()
    except LupinError as wrong:
        raise BadTokens(str(wrong), found.values()) from None
    if not found:
        raise BadTokens(f"{file}: there is no token in it; write lines of NAME ROLE EXPIRES TOKEN")
    return tuple(found.values())


def _too_open(file: Path, status: os.stat_result) -> Iterator[str]:
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        mode = stat.S_IMODE(status.st_mode)
        yield f"{file}: others can read or change these tokens (mode {mode:o}); write: chmod 600 {file}"


def _token_problems(words: Sequence[str], before: Mapping[str, IssuedToken]) -> Iterator[str]:
    if len(words) != 4:
        yield f"expected NAME ROLE EXPIRES TOKEN, got {len(words)} words"
        return
    name, role, day, secret = words
    roles = [one.word for one in UserRole]
    if name in before:
        yield f"{name} has a token already"
    if not re.fullmatch(r"[A-Za-z][\w.]*", name):
        yield "a name has letters, digits, dots and underscores, and begins with a letter"
    if role not in roles:
        yield f"unknown role{_shown(role)}; {nearest(role, roles)}"
    if _end_of(day) is None:
        yield f"EXPIRES must be a day such as 2026-12-31, not{_shown(day) or ' this'}"
    if len(secret) < SHORTEST_TOKEN:
        wanted = f"at least {SHORTEST_TOKEN} are needed: openssl rand -hex 32"
        yield f"the token has {len(secret)} letters, {wanted}"
    if any(hmac.compare_digest(secret.encode(), other.secret.encode()) for other in before.values()):
        yield "the token is another line's already"


def _shown(word: str) -> str:
    """Return a wrong word for a message; '' where it is so long that it may be a misplaced token."""
    return f" {word!r}" if len(word) < SHORTEST_TOKEN // 2 else ""


def _end_of(day: str) -> float | None:
    """Return the end of a day (UTC) in POSIX time; None where the text is no day."""
    try:
        begin = datetime.strptime(day, "%Y-%m-%d").replace(tzinfo=timezone.utc)
    except ValueError:
        return None
    return (begin + timedelta(days=1)).timestamp()


def admitted(token: str, tokens: Iterable[IssuedToken], wall: float) -> Visitor:
    """Return the visitor that a token belongs to; all tokens are compared, in constant time.

    Raises:
        NotAdmitted: the token is missing, unknown or expired.
    """
    if not token:
        raise NotAdmitted(
            401, "a token is needed: log in at /login, or send it as Authorization: Bearer TOKEN"
        )
    given, found = token.encode(), None
    for one in tokens:  # all of them: how long it takes says nothing
        if hmac.compare_digest(given, one.secret.encode()):
            found = one.visitor
    if found is None:
        raise NotAdmitted(401, "this token is nobody's; ask who runs the gateway for one", wrong=True)
    if expired := found.has_expired(wall):
        raise NotAdmitted(401, expired, wrong=True)
    return found


def token_of(headers: Mapping[str, str]) -> str:
    """Return the bearer token of a request, else that of its cookie, else ''; never from the URL."""
    scheme, _, value = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and value.strip():
        return value.strip()
    return cookie_of(headers, TOKEN_COOKIE)


def cookie_of(headers: Mapping[str, str], name: str) -> str:
    """Return the value of a cookie; '' without it."""
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return morsel.value if morsel is not None else ""


# -- names ------------------------------------------------------------------------------------------------


class AllowList:
    """The allow list: the least role for each name, as plugins, missions and settings declare it.

    An engineer may subscribe to every topic; every other use of an undeclared name is refused.
    """

    def __init__(self, declared: Iterable[Access]) -> None:
        declared = tuple(declared)
        #: Which of their operations move the robot.
        self.moving = MotionNames(declared)
        self._read: dict[str, UserRole] = {}
        self._commanded: dict[str, UserRole] = {}
        self._patterns: list[tuple[re.Pattern[str], UserRole]] = []
        for access in declared:
            for role in UserRole:
                for name in getattr(access, role.word):
                    self._add(name, role)

    def _add(self, name: str, role: UserRole) -> None:
        if "*" in name:
            self._patterns.append((re.compile(translate(name)), role))
            return
        known = [self._read] if role is UserRole.VIEWER else [self._read, self._commanded]
        for names in known:
            names[name] = min(role, names.get(name, role))

    def least(self, use: Use, name: str) -> UserRole | None:
        """Return the least role that may use a name so; None: no role may."""
        known = self._known(use)
        found = [known.get(name)]
        found += [role for pattern, role in self._patterns if pattern.fullmatch(name)]
        found += [UserRole.ENGINEER] if use is Use.SUBSCRIBE else []
        read = known is self._read
        roles = [role for role in found if role is not None and (read or role is not UserRole.VIEWER)]
        return min(roles, default=None)

    def _known(self, use: Use) -> Mapping[str, UserRole]:
        """Return the names that are declared for a use, without those with `*`."""
        return self._read if use in (Use.SUBSCRIBE, Use.CALL) else self._commanded

    def refusal(self, visitor: Visitor, use: Use, name: str) -> str:
        """Return why a visitor may not use a name so; '' where it may. The stop's topic is always allowed."""
        name = f"/{name.lstrip('/')}"
        if use in (Use.PUBLISH, Use.SUBSCRIBE) and name == STOP_TOPIC:
            return ""
        least = self.least(use, name)
        if least is None:
            what = f"{use.value} {name} is not offered to pages: no plugin or mission declares this name"
            settings = "offer it by the gateway's setting operator_names or engineer_names"
            return f"{what}; {or_else(meant(name, self._known(use)), settings)}"
        if visitor.role < least:
            return f"{use.value} {name} needs the role {least.word}; {visitor.name} is {visitor.role.word}"
        return ""


# -- doors ------------------------------------------------------------------------------------------------


class AccessControl:
    """Authentication: without tokens every client of this machine is an engineer; else a token is needed."""

    def __init__(
        self,
        tokens: Callable[[], Sequence[IssuedToken]] | None = None,
        origins: Iterable[str] = (),
    ) -> None:
        """`tokens` is read for each visitor; None: the gateway listens on this machine only, and needs none.

        `origins` are those of pages that other servers serve, such as https://hmi.example:8443.
        """
        self._tokens = tokens
        self._origins = frozenset(origin.rstrip("/").lower() for origin in origins)

    @property
    def asks_for_token(self) -> bool:
        """Whether a token is needed to come in."""
        return self._tokens is not None

    def admit(self, headers: Mapping[str, str], wall: float) -> Visitor:
        """Return the visitor who sends a request; its headers are in lower case.

        Raises:
            NotAdmitted: the page's origin is foreign, the token is missing, wrong or expired, or the file of
                tokens cannot be used.
        """
        self.check_origin(headers)
        if self._tokens is None:
            return Visitor("page", UserRole.ENGINEER)
        return admitted(token_of(headers), self._usable(self._tokens), wall)

    def token_for(self, name: str, wall: float) -> tuple[str, Visitor]:
        """Return the token and the visitor of a person who was authenticated otherwise (by an invitation).

        Raises:
            NotAdmitted: the file has no such name any more, or the token has expired.
        """
        for one in self._usable(self._tokens) if self._tokens else ():
            if one.visitor.name == name:
                return one.secret, admitted(one.secret, [one], wall)
        raise NotAdmitted(401, f"{name} has no token any more; ask who runs the gateway for one", wrong=True)

    @staticmethod
    def _usable(tokens: Callable[[], Sequence[IssuedToken]]) -> Sequence[IssuedToken]:
        try:
            return tokens()
        except LupinError:
            text = "nobody can come in now: the gateway cannot use its file of tokens, and its log says why"
            raise NotAdmitted(503, text) from None

    def reasons_to_go(self, visitors: Sequence[Visitor], wall: float) -> list[str]:
        """Return for each connected visitor why its connection must end; '' where it may stay.

        That is an expired token, or one that is not in the file any more with its name and role. Errors in
        other lines of the file end no connection.
        """
        if self._tokens is None:
            return [""] * len(visitors)
        try:
            tokens = self._tokens()
        except BadTokens as problem:
            tokens = problem.good
        stay = {(one.visitor, one.visitor.mark) for one in tokens}
        taken = "this token was taken out of the file of tokens"
        return [one.has_expired(wall) or ("" if (one, one.mark) in stay else taken) for one in visitors]

    def check_origin(self, headers: Mapping[str, str]) -> None:
        """Refuse a request from a page of another host, on any port: cross-site requests, DNS rebinding.

        Raises:
            NotAdmitted: with the setting that would allow it.
        """
        host, origin = _host(f"//{headers.get('host', '')}"), headers.get("origin", "").lower()
        if self._tokens is None and host not in _HERE:
            # A name that somebody lets lead to this machine, so that pages of theirs are of the same host.
            raise NotAdmitted(
                403, f"this gateway is for this machine alone: open http://localhost, not {host!r}"
            )
        if origin and origin not in self._origins and not _is_same(_host(origin), host):
            shown = shortened(origin)
            raise NotAdmitted(
                403, f"pages of {shown!r} may not use this gateway; its setting `origins` lets them"
            )


def _host(address: str) -> str:
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def _is_same(one: str, other: str) -> bool:
    return bool(one) and (one == other or {one, other} <= _HERE)


def open_problems(certificate: str, key: str, tokens: str) -> Iterator[str]:
    """Yield the settings that an open gateway lacks: files that are not named, or do not exist."""
    wanted = {
        "tls_certificate": (certificate, "the certificate of this machine (PEM)"),
        "tls_key": (key, "its key (PEM)"),
        "tokens": (tokens, "who may come in: lines of NAME ROLE EXPIRES TOKEN, mode 600"),
    }
    for setting, (file, what) in wanted.items():
        if not file:
            yield f"an open gateway needs {setting}: {what}"
        elif not Path(file).is_file():
            yield f"{setting}: there is no file {file}; it is {what}"


# -- limits -----------------------------------------------------------------------------------------------


class Allowance:
    """Rate limits of one client (token bucket); each method returns why something is refused, else ''."""

    def __init__(self) -> None:
        self._left = float(OPERATIONS_PER_S)
        self._more = 0
        self._at = -math.inf

    def frame(self, size: int) -> str:
        """Check the size of a frame in bytes."""
        if size <= LONGEST_FRAME:
            return ""
        return f"the frame has {size} bytes, at most {LONGEST_FRAME} are taken; nothing of it was carried out"

    def long_frame(self, size: int, now: float) -> str:
        """Check a long frame, at a time of the steady clock; it counts once for each 10,000 bytes."""
        self._more = size // BYTES_AN_OPERATION
        return self.used_up(now)

    def operation(self, now: float) -> str:
        """Take one operation, at a time of the steady clock. Stops are not counted: they never get here."""
        refused = self.used_up(now)
        if not refused:
            self._left -= max(1, self._more)
        self._more = 0
        return refused

    def used_up(self, now: float) -> str:
        """Refill the bucket; return why no further operation is allowed, '' where one is. Takes nothing."""
        gained = max(0.0, now - self._at) * OPERATIONS_PER_S
        self._left = min(float(OPERATIONS_PER_S), self._left + gained)
        self._at = now
        if self._left >= 1.0:
            return ""
        return f"more than {OPERATIONS_PER_S} operations a second; this one was not carried out"

    def subscription(self, have: int) -> str:
        """Check one more subscription than `have`."""
        if have < MOST_SUBSCRIPTIONS:
            return ""
        return f"a client has at most {MOST_SUBSCRIPTIONS} subscriptions; unsubscribe from something first"
