"""Reports all invalid options and arguments of a verb at once, where click reports only the first."""

from __future__ import annotations

from collections.abc import Sequence

import click


def all_bad_values(first: click.BadParameter, arguments: Sequence[str]) -> click.UsageError:
    """Return one error with every value that the verb of `first` refuses.

    Args:
        first: the error that click has stopped at, as the verb read its arguments.
        arguments: the arguments of the verb.
    """
    context = first.ctx
    if context is None:
        return first
    verb = context.command
    again = click.Context(verb, info_name=context.info_name, parent=context.parent, **verb.context_settings)
    given, left, _ = verb.make_parser(again).parse_args(list(arguments))
    texts = []
    for parameter in verb.get_params(again):
        try:
            _, left = parameter.handle_parse_result(again, given, left)
        except click.BadParameter as problem:
            texts.append(problem.format_message())
    return click.UsageError("\nError: ".join(texts), context)
