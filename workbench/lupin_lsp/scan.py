"""Keys and values of a text that is being typed, each with its place and its path from the top.

`chart.source` reads a file as YAML does, and stops at the first mistake. While a user types there is always
one, so this scanner never stops: it follows indentation and brackets, and closes an open bracket or quote at
the first line that cannot belong to it. On YAML without mistakes both find the same keys and values in the
same places; a test compares them for every mission of the repository.

Offsets count characters from 0. A path is made of keys and of indices in lists.
"""

from __future__ import annotations

import bisect
import enum
import re
from dataclasses import dataclass, replace
from functools import lru_cache

Steps = tuple["str | int", ...]

#: What a scalar without quotes is made of: a colon ends it when a blank follows, a # when one stands before.
_PLAIN = re.compile(r"(?:[^:#\n]|:(?=[^\s])|(?<=[^\s])#)+")
#: The same between brackets, where commas and brackets end it too.
_PLAIN_IN_FLOW = re.compile(r"(?:[^:#\n,\[\]{}]|:(?=[^\s,\[\]{}])|(?<=[^\s])#)+")
_ANCHOR = re.compile(r"&\S+[ \t]*")
_BLANKS = re.compile(r"[ \t]*")
_DOUBLE = re.compile(r'(?:[^"\\\n]|\\.)*')
_SINGLE = re.compile(r"(?:[^'\n]|'')*")
#: A line like this in a text in quotes means that a quote is missing.
_KEY = re.compile(r"[ \t]*(- )*[\w.]+:([ \t]|$)", re.MULTILINE)
_CLOSERS = {"{": "}", "[": "]"}
_QUOTES = ("'", '"')
#: What begins a value that cannot be a key.
_NO_KEY = "{[|>"
_REMEMBERED = 16


class TokenRole(enum.Enum):
    """The role of a text in the file: a key, a value, or undecided while it is typed."""

    KEY = "key"
    VALUE = "value"
    OPEN = "open"


@dataclass(frozen=True)
class Token:
    """A key or a scalar. The path of a key ends with it; that of a value is where the value stands.

    `start` and `end` include the quotes, `text` does not.
    """

    role: TokenRole
    path: Steps
    start: int
    end: int
    text: str
    quote: str = ""

    @property
    def inner(self) -> int:
        """Where the text without quotes begins."""
        return self.start + len(self.quote)


@dataclass(frozen=True)
class Cursor:
    """A position in a text: role and path of its token, or of one that could be typed there.

    `start` and `end` enclose the range that a completion replaces.
    """

    role: TokenRole
    path: Steps
    start: int
    end: int
    token: Token | None = None


class Lines:
    """Offsets of a text as lines and columns from 0, and back."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(match.end() for match in re.finditer("\n", text))]

    def offset(self, line: int, column: int) -> int:
        """Return the offset of a position, at most the end of its line."""
        if line >= len(self.starts):
            return len(self.text)
        return min(self.starts[line] + column, self.end(line))

    def position(self, offset: int) -> tuple[int, int]:
        """Return line and column of an offset."""
        line = bisect.bisect_right(self.starts, offset) - 1
        return line, offset - self.starts[line]

    def end(self, line: int) -> int:
        """Return the offset behind the last character of a line."""
        last = self.starts[line + 1] - 1 if line + 1 < len(self.starts) else len(self.text)
        return last - 1 if last > self.starts[line] and self.text[last - 1] == "\r" else last


class Scan:
    """The tokens of a text, by place and by path."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.lines = Lines(text)
        scanner = _Scanner(text, self.lines)
        scanner.run()
        self.tokens = scanner.tokens
        self._starts = [token.start for token in self.tokens]
        self._gaps = scanner.gaps
        self._frames = scanner.frames
        self._comments = scanner.comments
        self._values = {token.path: token for token in self.tokens if token.role is not TokenRole.KEY}
        self._keys: dict[Steps, list[Token]] = {}
        for token in self.tokens:
            if token.role is TokenRole.KEY:
                self._keys.setdefault(token.path[:-1], []).append(token)

    def value(self, *path: str | int) -> str | None:
        """Return the text of the scalar at a path; None where there is none."""
        found = self._values.get(path)
        return None if found is None else found.text

    def value_token(self, path: Steps) -> Token | None:
        """Return the scalar at a path, with its place; None where there is none."""
        return self._values.get(path)

    def keys(self, path: Steps) -> list[Token]:
        """Return the keys of the mapping at a path."""
        return self._keys.get(path, [])

    def key_token(self, path: Steps) -> Token | None:
        """Return the key that a path ends with; None where there is none."""
        return next((token for token in self.keys(path[:-1]) if token.path == path), None)

    def token_at(self, offset: int) -> Token | None:
        """Return the key or value that an offset lies in, or right behind; None between them."""
        index = bisect.bisect_right(self._starts, offset) - 1
        if index >= 0 and self.tokens[index].start <= offset <= self.tokens[index].end:
            return self.tokens[index]
        return None

    def cursor(self, offset: int) -> Cursor | None:
        """Return the cursor at an offset; None in a comment, or where nothing can be written."""
        token = self.token_at(offset) or self._token_before(offset)
        if token is not None:
            return Cursor(token.role, token.path, token.start, token.end, token)
        line, column = self.lines.position(offset)
        if offset > self._comments.get(line, offset):
            return None
        for start, end, role, path in self._gaps:
            if start <= offset <= end:
                return Cursor(role, path, offset, offset)
        row = self.text[self.lines.starts[line] : self.lines.end(line)]
        return self._on_blank_line(line, column, offset) if not row.strip() else None

    def _token_before(self, offset: int) -> Token | None:
        """Return the plain value before the cursor with the blanks between, as typing continues it.

        None where a key, a quoted value or more than blanks come before the cursor.
        """
        index = bisect.bisect_right(self._starts, offset) - 1
        if index < 0:
            return None
        token, blanks = self.tokens[index], self.text[self.tokens[index].end : offset]
        if token.role is TokenRole.KEY or token.quote or blanks.strip(" "):
            return None
        return replace(token, end=offset, text=token.text + blanks)

    def _on_blank_line(self, line: int, column: int, offset: int) -> Cursor:
        frame = self._frames[line]
        while frame.parent is not None and frame.column >= column:
            frame = frame.parent
        return Cursor(TokenRole.OPEN, frame.path, offset, offset)


@lru_cache(_REMEMBERED)
def scan(text: str) -> Scan:
    """Scan a text; the same text is scanned once."""
    return Scan(text)


class _Frame:
    """A key or list element with its column; lines that are indented further belong to it."""

    __slots__ = ("column", "filled", "is_element", "items", "parent", "path")

    def __init__(self, column: int, path: Steps, parent: _Frame | None, is_element: bool = False) -> None:
        self.column = column
        self.path = path
        self.parent = parent
        self.is_element = is_element
        self.items = 0
        self.filled = False


class _Cut(Exception):
    """An unclosed bracket ends here: the next line does not belong to it."""


class _Scanner:
    """One pass over a text."""

    def __init__(self, text: str, lines: Lines) -> None:
        self._text = text
        self._lines = lines
        self._last = _Frame(-1, (), None)
        self._block_text: int | None = None
        self.tokens: list[Token] = []
        self.gaps: list[tuple[int, int, TokenRole, Steps]] = []
        self.frames: list[_Frame] = []
        self.comments: dict[int, int] = {}

    def run(self) -> None:
        """Scan all lines."""
        line, count = 0, len(self._lines.starts)
        while line < count:
            self.frames += [self._last] * (line + 1 - len(self.frames))
            done = self._line(self._lines.starts[line], self._lines.end(line))
            line = max(line, self._lines.position(done)[0]) + 1
        self.frames += [self._last] * (count - len(self.frames))

    # -- lines ---------------------------------------------------------------------------------------------

    def _line(self, begin: int, end: int) -> int:
        """Scan the tokens that begin in a line; return an offset in the last line that belongs to it."""
        at = self._blanks(begin, end)
        if at == end or self._is_comment(at, end):
            return end
        column = at - begin
        if self._block_text is not None and column > self._block_text:
            return end
        self._block_text = None
        if self._text.startswith("---", begin):
            return end
        frame = self._enclosing(column, self._is_dash(at, end))
        while self._is_dash(at, end):
            frame = self._element(frame, at - begin)
            dash, at = at + 1, self._blanks(at + 1, end)
            if at == end or self._is_comment(at, end):
                self.gaps.append((dash, end, TokenRole.OPEN, frame.path))
                return end
        return self._entry(frame, at, at - begin, end)

    def _enclosing(self, column: int, is_dash: bool) -> _Frame:
        """Return the frame of a line that begins in `column`."""
        frame = self._last
        while frame.parent is not None and (
            frame.column > column or (frame.column == column and (frame.is_element or not is_dash))
        ):
            frame = frame.parent
        return frame

    def _element(self, frame: _Frame, column: int) -> _Frame:
        element = _Frame(column, (*frame.path, frame.items), frame, is_element=True)
        frame.items += 1
        self._last = element
        return element

    def _entry(self, frame: _Frame, at: int, column: int, end: int) -> int:
        found = self._key(at, end)
        if found is None:
            self._last = frame
            return end if frame.filled else self._value(frame, frame.path, at, end, TokenRole.OPEN)
        text, quote, key_end, colon = found
        path = (*frame.path, text)
        self.tokens.append(Token(TokenRole.KEY, path, at, key_end, text, quote))
        self._last = inner = _Frame(column, path, frame)
        at = self._blanks(colon + 1, end)
        anchor = _ANCHOR.match(self._text, at, end)
        at = anchor.end() if anchor else at
        if at == end or self._is_comment(at, end):
            self.gaps.append((colon + 1, at, TokenRole.VALUE, path))
            return end
        return self._value(inner, path, at, end, TokenRole.VALUE)

    def _key(self, at: int, end: int) -> tuple[str, str, int, int] | None:
        """Return text, quote, end and colon of the key that begins at an offset; None where none does."""
        if self._text[at] in _NO_KEY:
            return None
        quote = self._text[at] if self._text[at] in _QUOTES else ""
        if quote:
            close = self._quoted_in_line(at, end)
            if close is None:
                return None
            text, stop = self._text[at + 1 : close - 1], close
        else:
            match = _PLAIN.match(self._text, at, end)
            if match is None:
                return None
            text = match.group().rstrip()
            stop = at + len(text)
        colon = self._blanks(stop, end)
        if not self._text.startswith(":", colon) or colon >= end:
            return None
        return (text, quote, stop, colon) if colon + 1 >= end or self._text[colon + 1] in " \t" else None

    def _value(self, frame: _Frame, path: Steps, at: int, end: int, role: TokenRole) -> int:
        """Scan the value that begins at an offset; return an offset in its last line."""
        char = self._text[at]
        if char in "|>":
            self._block_text = frame.column
            return end
        try:
            if char in _CLOSERS:
                done = self._flow(at, path, frame.column)
            else:
                frame.filled = True
                done = self._scalar(at, path, frame.column, role, _PLAIN)
        except _Cut as cut:
            done = int(cut.args[0])
        line_end = self._lines.end(self._lines.position(done)[0])
        self._is_comment(self._blanks(done, line_end), line_end)
        return done

    # -- between brackets ----------------------------------------------------------------------------------

    def _flow(self, at: int, path: Steps, base: int) -> int:
        """Scan from an opening bracket to behind the closing one."""
        is_list = self._text[at] == "["
        closer = _CLOSERS[self._text[at]]
        at, index = at + 1, 0
        while True:
            here = (*path, index) if is_list else path
            at = self._gap(at, TokenRole.VALUE if is_list else TokenRole.KEY, here, base)
            char = self._text[at]
            if char == closer:
                return at + 1
            if char in "]}":
                return at
            if char == ",":
                at, index = at + 1, index + 1
            elif is_list and not self._is_pair(at):
                at = self._flow_value(at, here, base)
            else:
                at = self._pair(at, here, base)

    def _is_pair(self, at: int) -> bool:
        """Return whether an element of a flow list is a mapping of one key without braces."""
        if self._text[at] in _CLOSERS:
            return False
        end = self._lines.end(self._lines.position(at)[0])
        quoted = self._text[at] in _QUOTES
        stop = self._quoted_in_line(at, end) if quoted else self._plain_end(at, _PLAIN_IN_FLOW)
        return stop is not None and self._text.startswith(":", self._blanks(stop, end))

    def _pair(self, at: int, path: Steps, base: int) -> int:
        """Scan a key and its value; a key alone is a mapping that is being typed."""
        quote = self._text[at] if self._text[at] in _QUOTES else ""
        stop = self._quoted(at, base) if quote else self._plain_end(at, _PLAIN_IN_FLOW)
        if stop == at and self._text[at] != ":":
            return at + 1
        text = self._text[at + len(quote) : stop - len(quote)]
        inner = (*path, text)
        if text or quote:
            self.tokens.append(Token(TokenRole.KEY, inner, at, stop, text, quote))
        at = self._gap(stop, TokenRole.KEY, path, base, remember=False)
        if self._text[at] != ":":
            return at
        at = self._gap(at + 1, TokenRole.VALUE, inner, base)
        return at if self._text[at] in ",]}" else self._flow_value(at, inner, base)

    def _flow_value(self, at: int, path: Steps, base: int) -> int:
        anchor = _ANCHOR.match(self._text, at)
        at = anchor.end() if anchor else at
        if self._text[at] in _CLOSERS:
            return self._flow(at, path, base)
        done = self._scalar(at, path, base, TokenRole.VALUE, _PLAIN_IN_FLOW)
        return done if done > at else at + 1

    def _gap(self, at: int, role: TokenRole, path: Steps, base: int, remember: bool = True) -> int:
        """Skip blanks, comments and line ends to the next sign; a gap gets `path`, for typing.

        Raises:
            _Cut: the next line does not belong to the brackets any more.
        """
        begin, text = at, self._text
        while True:
            end = self._lines.end(self._lines.position(at)[0])
            at = self._blanks(at, end)
            if at < end and not self._is_comment(at, end):
                break
            following = self._continued(end, base)
            if following is None:
                if remember:
                    self.gaps.append((begin, end, role, path))
                raise _Cut(end)
            at = following
        if remember and at >= begin:
            self.gaps.append((begin, at if text[at] in ",]}" else at - 1, role, path))
        return at

    def _continued(self, end: int, base: int) -> int | None:
        """Return the beginning of the next line with content; None where it cannot be inside the brackets.

        It can where it is indented deeper than `base`, or begins with a closing bracket.
        """
        line = self._lines.position(end)[0] + 1
        while line < len(self._lines.starts):
            begin, end = self._lines.starts[line], self._lines.end(line)
            at = self._blanks(begin, end)
            if at < end and self._text[at] != "#":
                inside = at - begin > base or self._text[at] in "]}"
                return begin if inside else None
            line += 1
        return None

    # -- scalars -------------------------------------------------------------------------------------------

    def _scalar(self, at: int, path: Steps, base: int, role: TokenRole, plain: re.Pattern[str]) -> int:
        quote = self._text[at] if self._text[at] in _QUOTES else ""
        stop = self._quoted(at, base) if quote else self._plain_end(at, plain)
        closed = quote and stop - 1 > at and self._text[stop - 1] == quote
        text = self._text[at + len(quote) : stop - len(quote) if closed else stop]
        if stop > at:
            self.tokens.append(Token(role, path, at, stop, text, quote))
        return stop

    def _plain_end(self, at: int, plain: re.Pattern[str]) -> int:
        match = plain.match(self._text, at, self._lines.end(self._lines.position(at)[0]))
        return at + len(match.group().rstrip()) if match else at

    def _quoted(self, at: int, base: int) -> int:
        """Return the offset behind the closing quote, or the end of the line when there is none."""
        end = self._lines.end(self._lines.position(at)[0])
        found = self._quoted_in_line(at, end)
        if found is not None:
            return found
        quote, line_end = self._text[at], end
        while (begin := self._continued(end, base)) is not None and not _KEY.match(self._text, begin):
            end = self._lines.end(self._lines.position(begin)[0])
            pattern = _DOUBLE if quote == '"' else _SINGLE
            match = pattern.match(self._text, begin, end)
            stop = match.end() if match else begin
            if stop < end and self._text[stop] == quote:
                return stop + 1
        return line_end

    def _quoted_in_line(self, at: int, end: int) -> int | None:
        pattern = _DOUBLE if self._text[at] == '"' else _SINGLE
        match = pattern.match(self._text, at + 1, end)
        stop = match.end() if match else at + 1
        return stop + 1 if stop < end and self._text[stop] == self._text[at] else None

    # -- small ---------------------------------------------------------------------------------------------

    def _blanks(self, at: int, end: int) -> int:
        match = _BLANKS.match(self._text, at, end)
        return match.end() if match else at

    def _is_dash(self, at: int, end: int) -> bool:
        return self._text.startswith("-", at) and (at + 1 >= end or self._text[at + 1] in " \t")

    def _is_comment(self, at: int, end: int) -> bool:
        if at >= end or self._text[at] != "#":
            return False
        self.comments[self._lines.position(at)[0]] = at
        return True
