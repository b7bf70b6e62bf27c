"""`lupin interfaces`: packages of messages, services and actions in this environment."""

from __future__ import annotations

import click


@click.group(short_help="Add packages of messages, services and actions to this environment.")
def interfaces() -> None:
    """Add packages of messages, services and actions to this environment."""


@interfaces.command()
@click.argument("package", metavar="FOLDER | PACKAGE")
def add(package: str) -> int:
    """Compile a package of interfaces, and add it to this environment.

    FOLDER has a package.xml and msg/*.msg, srv/*.srv or action/*.action; other build files are not used.
    PACKAGE is one whose whole definitions come with Lupin, such as nav2_msgs. Bindings and nodes use it at
    once. It takes a minute or two, and a C compiler. One that was added before is replaced.

    Exit code: 0 added; 2 it cannot be added, and nothing has changed.
    """
    from lupin_ros.interfaces import add_interfaces

    names = add_interfaces(package, click.echo)
    click.echo(f"added {', '.join(names)}; bindings and nodes can use it")
    return 0
