"""`lupin check`: tell everything that is wrong with missions, before a robot does.

Exit codes: 0 nothing is wrong; 1 there are errors, or with `--strict` warnings; 2 wrong usage.
"""

from __future__ import annotations

from typing import Any

import click


@click.command()
@click.argument("paths", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as a JSON list.")
@click.option("--sarif", "as_sarif", is_flag=True, help="Print the findings as SARIF 2.1.0, for CI.")
@click.option("--github", "as_github", is_flag=True, help="Print the findings as annotations of a workflow.")
@click.option("--strict", is_flag=True, help="Warnings count like errors for the exit code.")
@click.option("--watch", "-w", is_flag=True, help="Check again whenever a file changes; Ctrl-C ends.")
@click.option(
    "--explain", metavar="RULE", help="Tell what a rule protects, with an example, and check nothing."
)
def check(**given: Any) -> int:
    """Check missions and tell everything that is wrong with them.

    PATHS are mission files, lifecycles, parts, folders, or names of missions; without any, the missions of
    the folder missions are checked, or where there is none the shipped ones.

    Exit code: 0 nothing is wrong, 1 there are errors (with --strict also warnings), 2 wrong usage. Warnings
    alone leave it at 0.
    """
    forms = [name for name in ("json", "sarif", "github") if given.pop(f"as_{name}")]
    from lupin_engine.cli.tasks.check import work

    return work(forms=forms, **given)
