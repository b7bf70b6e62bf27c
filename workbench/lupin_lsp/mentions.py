"""Finds the names in a text with their ranges: of states, parameters, operations and so on.

A mention has the kind and the name of a thing; `model` resolves it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from lupin_engine.chart import (
    BUILTIN_CALLS,
    ROOTS,
    WORDS,
    ActionNode,
    InvokeNode,
    Meaning,
    Node,
    StateNode,
    insets,
)
from lupin_lsp.grammar import Spot, spot_at
from lupin_lsp.scan import Scan, Steps, Token, TokenRole

#: A text in quotes, a chain of words with dots, or any other sign.
_PIECES = re.compile(r"'[^']*'?|\"[^\"]*\"?|[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*|[^\s\w]")
_WORD = re.compile(r"\w+")
#: What a function's one argument names, written out.
_NAMED_BY = {"held": Meaning.HOLD, "in_state": Meaning.ANYWHERE, "was_in_state": Meaning.ANYWHERE}
#: What the word behind a root is.
_BEHIND = {
    "param": Meaning.PARAMETER,
    "input": Meaning.INPUT,
    "request": Meaning.FIELD,
}
#: These are names of states, of which a text may hold several with dots between.
STATES = (Meaning.STATE, Meaning.CHILD, Meaning.ANYWHERE)


@dataclass(frozen=True)
class Mention:
    """A name in a text. `whole` is the dotted text, of which it is word number `index`.

    `path` is that of the key or value around it, `of` the owner of an argument or a binding. `declares`: it
    is the declaration.
    """

    meaning: Meaning
    name: str
    start: int
    end: int
    path: Steps
    whole: str = ""
    index: int = 0
    of: str = ""
    declares: bool = False

    @property
    def so_far(self) -> str:
        """The dotted text up to and with this word."""
        return ".".join(self.whole.split(".")[: self.index + 1])


@dataclass(frozen=True)
class ExpressionPiece:
    """A piece of an expression; `call` is the function whose first argument it is."""

    text: str
    start: int
    call: str = ""

    @property
    def end(self) -> int:
        """Where it ends."""
        return self.start + len(self.text)


def expressions_in(token: Token, meaning: Meaning) -> list[tuple[str, int]]:
    """Return the expressions that a token holds, each with the offset where it begins."""
    if meaning is Meaning.CONDITION:
        return [(token.text, token.inner)]
    text, found = token.text, insets(token.text) if meaning is Meaning.VALUE else ()
    ends = [(i.begin + 2, i.colon if i.colon >= 0 else i.end - 1 if i.end >= 0 else len(text)) for i in found]
    return [(text[begin:end], token.inner + begin) for begin, end in ends]


def pieces(expression: str, offset: int = 0) -> list[ExpressionPiece]:
    """Return the names, quoted texts and signs of an expression, which begins at an offset, in order."""
    found: list[ExpressionPiece] = []
    for match in _PIECES.finditer(expression):
        call = found[-2].text if len(found) > 1 and found[-1].text == "(" else ""
        found.append(ExpressionPiece(match.group(), offset + match.start(), call))
    return found


def mentions_in(scan: Scan, root: type[Node]) -> Iterator[Mention]:
    """Yield all mentions of a file."""
    for token in scan.tokens:
        yield from mentions_of(scan, root, token)


def mention_at(scan: Scan, root: type[Node], offset: int) -> Mention | None:
    """Return the innermost name at an offset, or ending there; None where there is none."""
    token = scan.token_at(offset)
    found = list(mentions_of(scan, root, token)) if token else []
    inside = [mention for mention in found if mention.start <= offset <= mention.end]
    return min(inside, key=lambda mention: (mention.end - mention.start, -mention.start), default=None)


def mentions_of(scan: Scan, root: type[Node], token: Token) -> Iterator[Mention]:
    """Yield the mentions of a key or value."""
    if token.role is TokenRole.KEY:
        spot = spot_at(root, token.path[:-1])
        if spot is not None:
            yield from _of_key(scan, spot, token)
    else:
        spot = spot_at(root, token.path)
        if spot is not None:
            yield from _of_text(token, value_meaning(scan, spot), owner_of(scan, spot))


def value_meaning(scan: Scan, spot: Spot) -> Meaning:
    """Return the meaning of a scalar at a spot; for an argument it depends on the action."""
    if spot.holder is ActionNode and spot.name:
        action = spot.mapping[-1]
        if action in ("itinerary.close", "itinerary.close_rest") and spot.name == "code":
            written = scan.value(*spot.mapping, spot.name) or ""
            return Meaning.VALUE if "${" in written else Meaning.CODE
    return spot.value_meaning


def _of_key(scan: Scan, spot: Spot, token: Token) -> Iterator[Mention]:
    meaning = spot.name_meaning
    if meaning is None:
        yield Mention(Meaning.KEY, token.text, token.inner, token.inner + len(token.text), token.path)
        return
    declares = spot.declares and meaning is not Meaning.ACTION
    yield from _of_text(token, meaning, owner_of(scan, spot), declares)


def _of_text(token: Token, meaning: Meaning, of: str = "", declares: bool = False) -> Iterator[Mention]:
    expressions = expressions_in(token, meaning)
    if expressions:
        for expression in expressions:
            yield from _in_expression(token, *expression)
    elif meaning in STATES:
        yield from _words(token, meaning, token.text, token.inner, declares)
    elif meaning in (Meaning.EVENT, Meaning.ENGAGE, Meaning.REQUEST):
        yield from _event(token)
    elif meaning is Meaning.TYPE:
        word = token.text.rpartition(" ")[2]
        start = token.inner + len(token.text) - len(word)
        yield Mention(meaning, word, start, start + len(word), token.path)
    elif meaning not in (Meaning.VALUE, Meaning.CONDITION, Meaning.TEXT):
        end = token.inner + len(token.text)
        yield Mention(meaning, token.text, token.inner, end, token.path, token.text, 0, of, declares)


def owner_of(scan: Scan, spot: Spot) -> str:
    """Return the operation, action or part whose arguments are at a spot."""
    if spot.key == "levels":
        return str(spot.mapping[-1])
    if spot.key not in ("with", "out", "arguments"):
        return ""
    if spot.holder is ActionNode:
        return str(spot.mapping[-1])
    key = {InvokeNode: "do", StateNode: "use"}.get(spot.holder or Node)
    return (scan.value(*spot.mapping, key) or "") if key else ""


def _words(
    token: Token, meaning: Meaning, text: str, offset: int, declares: bool = False
) -> Iterator[Mention]:
    for index, match in enumerate(_WORD.finditer(text)):
        start, end = offset + match.start(), offset + match.end()
        yield Mention(meaning, match.group(), start, end, token.path, text, index, "", declares)


def _event(token: Token) -> Iterator[Mention]:
    if token.text.startswith("input."):
        yield from _chain(token, token.text, token.inner)
        return
    yield Mention(Meaning.EVENT, token.text, token.inner, token.inner + len(token.text), token.path)


def _in_expression(token: Token, expression: str, offset: int) -> Iterator[Mention]:
    found = pieces(expression, offset)
    for index, piece in enumerate(found):
        follows = found[index + 1].text if index + 1 < len(found) else ""
        quoted = piece.text[0] in "'\""
        if piece.call in _NAMED_BY and (quoted or piece.text[0].isalpha()):
            text = piece.text.strip("'\"")
            meaning = _NAMED_BY[piece.call]
            if meaning is Meaning.ANYWHERE:
                yield from _words(token, meaning, text, piece.start + quoted)
            else:
                start = piece.start + quoted
                yield Mention(meaning, text, start, start + len(text), token.path, text)
        elif quoted or piece.text in WORDS or not (piece.text[0].isalpha() or piece.text[0] == "_"):
            continue
        elif follows == "(":
            yield Mention(Meaning.FUNCTION, piece.text, piece.start, piece.end, token.path, piece.text)
        else:
            yield from _chain(token, piece.text, piece.start)


def _chain(token: Token, text: str, offset: int) -> Iterator[Mention]:
    """Yield the mentions of `input.charge.low` and the like, one for each word."""
    words = text.split(".")
    at = offset
    for index, word in enumerate(words):
        meaning, of = _in_chain(words, index)
        yield Mention(meaning, word, at, at + len(word), token.path, text, index, of)
        at += len(word) + 1


def _in_chain(words: list[str], index: int) -> tuple[Meaning, str]:
    if index == 0:
        return (Meaning.ROOT if words[0] in ROOTS or words[0] in BUILTIN_CALLS else Meaning.VARIABLE), ""
    if index == 1 and words[0] in _BEHIND:
        return _BEHIND[words[0]], ""
    if index == 2 and words[0] == "input" and words[2] != "value":
        return Meaning.LEVEL, words[1]
    return Meaning.ATTRIBUTE, ""
