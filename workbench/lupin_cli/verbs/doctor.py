"""`lupin doctor`: checks this machine, and prints advice about problems."""

from __future__ import annotations

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
def doctor(as_json: bool) -> int:
    """Check this machine, with advice for each problem.

    Exit code: 0 when missions can be run, 1 when a problem must be mended first.
    """
    import json
    from dataclasses import asdict

    from lupin_ros.launch import health

    findings = health.examine()
    usable = health.usable(findings)
    if as_json:
        text = {"usable": usable, "findings": [asdict(finding) for finding in findings]}
        click.echo(json.dumps(text, indent=2, ensure_ascii=False))
    else:
        from lupin_cli.terminal.tables import print_health

        print_health(findings)
    return 0 if usable else 1
