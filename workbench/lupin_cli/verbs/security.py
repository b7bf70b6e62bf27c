"""`lupin security`: writes permissions for SROS2."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_cli.files import write_text
from lupin_engine.plugin import Access, load_catalog, name_of, robot_namespace

if TYPE_CHECKING:
    from lupin_engine.missions import LoadedMissions

_ROLES = ("viewer", "operator", "engineer")


@click.group(short_help="Write permissions of the nodes, for SROS2.")
def security() -> None:
    """Write permissions of the nodes, for SROS2."""


@security.command()
@click.argument("missions", nargs=-1)
@click.option("--sim", is_flag=True, help="Also for the simulated robot.")
@click.option(
    "--into",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write policy.xml and governance.xml there; otherwise the policy is printed.",
)
def policy(missions: tuple[str, ...], sim: bool, folder: Path | None) -> int:
    """Write each node's permissions to publish, subscribe, serve and call, for `ros2 security`.

    They are read off the nodes of MISSIONS, with the missions' bindings: each node is started in an empty ROS
    domain, and ends at once. Without MISSIONS they are for all of the nearest folder.

    Exit code: 0 written, 1 a mission has errors or a node does not start, 2 wrong usage.
    """
    from lupin_engine.missions import load_missions
    from lupin_ros.launch import close_the_doors, current_domain, prepare_ros

    loaded = load_missions(missions, load_catalog(), reaching=True)
    close_the_doors()
    prepare_ros()
    from lupin_harness import declared_by
    from lupin_ros.launch import ORCHESTRATOR, PresentEndpoints, describe_launch, sros2

    catalog = loaded.chart.catalog
    serving = [name for name, plugin in catalog.plugins.items() if plugin.hmi]
    parameters = {ORCHESTRATOR: loaded.parameters()}
    found = {
        simulate: describe_launch(
            (*loaded.plugins, *serving), catalog, PresentEndpoints(), parameters, simulate=simulate
        ).launches
        for simulate in (sim, True)  # a simulated robot tells what the real one has, too
    }
    robot = robot_namespace()
    nodes = {f"{robot}/{launch.node.name}": launch for launch in found[sim]}
    launches = {f"{robot}/{launch.node.name}": launch for launch in found[True]} | nodes
    access = _access(loaded, robot)
    pages = {f"{robot}/{node}": access for name in serving for node in catalog.plugins[name].nodes}
    asked = [name_of(robot, name) for name in _asked(loaded)]
    text = sros2.policy(declared_by(launches.values()), nodes, pages, asked, robot)
    if folder is None:
        click.echo(text, nl=False)
        return 0
    for name, content in (("policy.xml", text), ("governance.xml", sros2.governance(current_domain()))):
        write_text(folder / name, content)
        click.echo(f"wrote {folder / name}")
    return 0


def _asked(loaded: LoadedMissions) -> list[str]:
    """Return the services that people's verbs call."""
    from lupin_ros.service import COMMAND_SERVICE

    profile = loaded.chart.profile
    wire = profile.wire
    requests = [wire.start.name, *map(wire.requests.format, profile.requests)] if wire else []
    return [COMMAND_SERVICE, *requests]


def _access(loaded: LoadedMissions, robot: str) -> Access:
    """Return the permissions of pages, by the profile, the engine, plugins and bindings."""
    from lupin_engine.plugin import declared_access
    from lupin_ros.service import ACCESS

    catalog = loaded.chart.catalog
    called = (call.endpoint.name for one in loaded.bindings.values() for call in one.calls.values())
    bound = Access(viewer=tuple(loaded.heard), engineer=tuple(called))
    every = [*declared_access(catalog), ACCESS, bound]
    named = (tuple(name_of(robot, name) for one in every for name in getattr(one, role)) for role in _ROLES)
    return Access(*named)
