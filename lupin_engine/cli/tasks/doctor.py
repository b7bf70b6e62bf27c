"""What `lupin doctor` does."""

from __future__ import annotations

import json
from dataclasses import asdict

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from lupin_engine.ros.launch.health import Finding, examine, usable

_STYLES = {"ok": "green", "note": "yellow", "problem": "bold red"}


def work(as_json: bool) -> int:
    """Do what the options of `lupin doctor` say, and return the exit code."""
    findings = examine()
    if as_json:
        text = {"usable": usable(findings), "findings": [asdict(finding) for finding in findings]}
        click.echo(json.dumps(text, indent=2, ensure_ascii=False))
    else:
        console = Console(highlight=False)
        console.print(table(findings))
        console.print(verdict(findings))
    return 0 if usable(findings) else 1


def table(findings: list[Finding]) -> RenderableType:
    """Return the findings as a table; advice stands under what it is about."""
    grid = Table(box=SIMPLE_HEAD, pad_edge=False)
    grid.add_column("")
    grid.add_column("looked at", overflow="fold")
    grid.add_column("found", overflow="fold")
    for finding in findings:
        found = Text(finding.found)
        if finding.advice:
            found.append(f"\n{finding.advice}", _STYLES[finding.state])
        grid.add_row(Text(finding.state, _STYLES[finding.state]), finding.topic, found)
    return grid


def verdict(findings: list[Finding]) -> Text:
    """Return the last line."""
    problems = sum(1 for finding in findings if finding.state == "problem")
    if not problems:
        return Text("missions can be run here", "bold green")
    return Text(f"{problems} problem{'s' * (problems > 1)} to mend before missions can be run", "bold red")
