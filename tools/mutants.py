"""The mutants of a module: every small change of its syntax tree that a test should notice."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
    ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr,
}  # fmt: skip
NAMES = {"any": "all", "all": "any", "min": "max", "max": "min"}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass
class Mutant:
    """One change. `span` are the lines of its statement; `inside` a function it takes effect when called."""

    line: int
    was: str
    now: str
    span: range
    inside: bool
    change: Callable[[], None] = field(repr=False)
    number: int = 0

    @property
    def key(self) -> str:
        """What the JSON knows it by: stable while the module is unchanged."""
        return f"{self.line}: {self.was} -> {self.now} #{self.number}"


def alternatives(node: ast.AST, place: str, inside: bool) -> Iterator[ast.AST]:
    """Yield what may stand in place of `node`, which is the field `place` of its parent."""
    if place in ("test", "ifs", "guard") and not isinstance(node, (ast.Compare, ast.UnaryOp)):
        yield ast.UnaryOp(ast.Not(), node)  # type: ignore[arg-type]
    yield from _other_expressions(node, inside)
    yield from _other_statements(node)
    if isinstance(node, (ast.Expr, ast.Raise, ast.Delete, ast.AugAssign)) or (inside and _writes(node)):
        yield ast.Pass()


def _other_expressions(node: ast.AST, inside: bool) -> Iterator[ast.expr]:
    if isinstance(node, ast.Compare):
        for index, operator in enumerate(node.ops):
            for other in COMPARISONS[type(operator)]:
                ops = [*node.ops[:index], other(), *node.ops[index + 1 :]]
                yield ast.Compare(node.left, ops, node.comparators)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.And() if isinstance(node.op, ast.Or) else ast.Or(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        yield node.operand
    elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC and (inside or not _is_type(node)):
        yield ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right)
    elif isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float, str)):
        yield ast.Constant(_other_value(node.value))
    elif isinstance(node, ast.Name) and node.id in NAMES and isinstance(node.ctx, ast.Load):
        yield ast.Name(NAMES[node.id], ast.Load())


def _other_value(value: bool | float | str) -> bool | float | str:
    if isinstance(value, bool):
        return not value
    return f"XX{value}" if isinstance(value, str) else value + 1


def _other_statements(node: ast.AST) -> Iterator[ast.stmt]:
    if isinstance(node, ast.Return):
        if node.value is None:
            yield ast.Pass()
        elif not (isinstance(node.value, ast.Constant) and not node.value.value):
            yield ast.Return(ast.Constant(None))
    elif isinstance(node, (ast.Continue, ast.Break)):
        yield ast.Break() if isinstance(node, ast.Continue) else ast.Continue()
    elif isinstance(node, ast.AugAssign) and type(node.op) in ARITHMETIC:
        yield ast.AugAssign(node.target, ARITHMETIC[type(node.op)](), node.value)


def _is_type(node: ast.BinOp) -> bool:
    return isinstance(node.op, ast.BitOr)


def _writes(node: ast.AST) -> bool:
    """Tell whether it assigns to something that is there without it: no plain name."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return (
        isinstance(node, (ast.Assign, ast.AnnAssign))
        and node.value is not None
        and not any(isinstance(t, ast.Name) for t in targets)
    )


def _is_skipped(node: ast.AST, place: str) -> bool:
    """Docstrings, descriptions, annotations, assertions, slots, what only type checker or dataclass read."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("__slots__", "__all__"):
        return True
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("dataclass", "record", "TypeVar"):
        return True
    if isinstance(node, ast.keyword) and node.arg == "description":
        return True
    typing_only = isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
    return typing_only or isinstance(node, ast.Assert) or place in ("annotation", "returns", "format_spec")


def mutants_of(tree: ast.Module) -> list[Mutant]:
    """Return every mutant of a module, in the order of the source."""
    found = list(_below(tree, range(0), False))
    seen: Counter[str] = Counter()
    for mutant in found:
        seen[mutant.key] += 1
        mutant.number = seen[mutant.key] - 1
    return found


def _below(parent: ast.AST, span: range, inside: bool) -> Iterator[Mutant]:
    for place, value in ast.iter_fields(parent):
        within = inside or (place == "body" and isinstance(parent, FUNCTIONS))
        for index, node in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(node, ast.AST) or _is_skipped(node, place):
                continue
            lines = _lines(node, span)
            for other in alternatives(node, place, within):
                ast.copy_location(other, node)
                change = _change(parent, place, index if isinstance(value, list) else None, other)
                line = getattr(node, "lineno", lines.start)
                yield Mutant(line, _text(node), _text(other), lines, within, change)
            yield from _below(node, lines, within)


def _lines(node: ast.AST, span: range) -> range:
    """Return the lines of a statement without its body; an expression belongs to its statement's."""
    if not isinstance(node, (ast.stmt, ast.match_case)):
        return span
    first = node.pattern.lineno if isinstance(node, ast.match_case) else node.lineno
    body = getattr(node, "body", None) or getattr(node, "cases", None)
    if body is None:
        return range(first, (getattr(node, "end_lineno", None) or first) + 1)
    return range(first, max(first, getattr(body[0], "lineno", first + 1) - 1) + 1)


def _change(parent: ast.AST, place: str, index: int | None, node: ast.AST) -> Callable[[], None]:
    def change() -> None:
        if index is None:
            setattr(parent, place, node)
        else:
            getattr(parent, place)[index] = node

    return change


def _text(node: ast.AST) -> str:
    text = ast.unparse(node) if not isinstance(node, ast.JoinedStr) else "f-string"
    return " ".join(text.split())[:100]
