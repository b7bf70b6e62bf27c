"""The command `lupin`: finds the verb, and is the one place that turns failures into text and exit codes.

Nothing heavy is imported here: `lupin --help` answers at once, and each verb loads only what it needs. The
table of verbs repeats their one-line help for that reason; a test compares the two. Installed packages may
bring verbs of their own (`plugin_verbs.py`); one that has the name of a verb of the engine is ignored.

Exit codes: 0 done; 1 the mission or file has problems; 2 wrong usage, or the run could not be done; 70 a
defect of the engine (see the crash log that is named); 130 interrupted; 141 the output pipe was closed.
"""

from __future__ import annotations

import gc
import importlib
import io
import keyword
import os
import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from lupin_cli.exit_codes import INTERRUPTED
from lupin_engine import __version__
from lupin_engine.errors import ChartError, LupinError, nearest

if TYPE_CHECKING:
    from lupin_engine.plugin import EntryPoint

#: verb -> what it does. Each lives in the module `lupin_cli.verbs.VERB` under its own name.
VERBS: Mapping[str, str] = MappingProxyType(
    {
        "run": "Run a mission over ROS 2 and watch it.",
        "up": "Start the nodes of missions; an operator starts the missions.",
        "new": "Begin a mission: its file, the lifecycle around it, a scenario.",
        "import": "Make a mission of a chart by others (SCXML, behavior trees).",
        "check": "Check missions and report all mistakes in them.",
        "simulate": "Run a mission in virtual time, without ROS.",
        "test": "Run scenarios against missions, without ROS.",
        "prove": "Explore every way that missions can go, without ROS.",
        "campaign": "Run a mission in thousands of random worlds.",
        "learn": "Learn times and failures from the journal, for simulations.",
        "expect": "Predict how long a mission will take, and what it misses.",
        "diagram": "Draw a mission.",
        "graph": "Show the ROS graph: topics, services and actions with their nodes.",
        "record": "Record every topic into a file for Foxglove, Lichtblick, rosbag2.",
        "replay": "Run a mission of the journal again; show a recording in the console.",
        "bundle": "Put a mission with all its files into one, signed.",
        "security": "Write permissions of the nodes, for SROS2.",
        "types": "Write all messages and services as TypeScript or JSON Schema.",
        "interfaces": "Add packages of messages, services and actions to this environment.",
        "plugin": "List, show and check plugins, and begin new ones.",
        "node": "Run one node, with ROS arguments; without a name, list the nodes.",
        "upgrade": "Show what missions, scenarios and bindings would have to change for this engine.",
        "schema": "Print the JSON Schema of the files, for editors.",
        "lsp": "Serve editors: completion, hover, definition, rename, findings as you type.",
        "doctor": "Check this machine, with advice for each problem.",
    }
)
#: The same for an operator, in `lupin_cli.operator.VERB`; requests of the installed profiles are more.
OPERATOR_VERBS: Mapping[str, str] = MappingProxyType(
    {
        "start": "Start a mission of the orchestrator that runs.",
        "state": "Show the state of the orchestrator, and its available requests.",
        "answer": "Show the open question of a mission, or answer it.",
        "missions": "List the missions that were run, and how they ended.",
        "why": "Say why a target, a state or a moment came about, from the journal.",
    }
)

#: Else pydantic looks through every installed package for plugins of its own.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

DEFECT = 70
READER_GONE = 141


class Verbs(click.Group):
    """A group that imports a verb only when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs in the order of the tables, and those of installed packages."""
        return [*VERBS, *OPERATOR_VERBS, *_request_verbs(), *_points_of_plugins()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a verb; None where none has that name, PluginError where a plugin's cannot be used."""
        if cmd_name in VERBS:
            return _load("verbs", f"{cmd_name}_" if keyword.iskeyword(cmd_name) else cmd_name)
        if cmd_name in OPERATOR_VERBS:
            return _load("operator", cmd_name)
        asked = _request_verbs()
        if cmd_name in asked:
            from lupin_cli.operator.ask import request_command

            return request_command(cmd_name, asked[cmd_name])
        from lupin_cli.plugin_verbs import load_verb

        points = _points_of_plugins().get(cmd_name)
        return load_verb(points) if points else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(VERBS.items()))
        with formatter.section("Operator"):
            formatter.write_dl([*OPERATOR_VERBS.items(), *_request_verbs().items()])
        others = _points_of_plugins()
        if others:
            from lupin_cli.plugin_verbs import summary

            with formatter.section("Commands of plugins"):
                formatter.write_dl([(verb, summary(points)) for verb, points in others.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb.

        Raises:
            click.UsageError: it is unknown; the text has the nearest spelling.
        """
        if args and args[0] not in {*VERBS, *OPERATOR_VERBS} and not args[0].startswith("-"):
            known = self.list_commands(ctx)
            if args[0] not in known:
                raise click.UsageError(f"unknown command {args[0]!r}; {nearest(args[0], known)}", ctx)
        name, command, left = super().resolve_command(ctx, args)
        ctx.meta[__name__] = list(left)
        return name, command, left

    def invoke(self, ctx: click.Context) -> Any:
        """Run the verb.

        Raises:
            click.UsageError: values of its options are refused; the text has all of them.
        """
        try:
            return super().invoke(ctx)
        except click.BadParameter as first:
            if first.ctx is None or first.ctx.parent is not ctx:  # below a verb with verbs of its own
                raise
            from lupin_cli.bad_values import all_bad_values

            raise all_bad_values(first, ctx.meta[__name__]) from first


def _load(folder: str, name: str) -> click.Command:
    command = getattr(importlib.import_module(f"lupin_cli.{folder}.{name}"), name)
    assert isinstance(command, click.Command)
    return command


def _request_verbs() -> Mapping[str, str]:
    """Return the verbs of the installed profiles' requests, each with its line."""
    from lupin_cli.plugin_verbs import request_verbs

    own = {*VERBS, *OPERATOR_VERBS}
    return {verb: doc for verb, doc in request_verbs().items() if verb not in own}


def _points_of_plugins() -> Mapping[str, Sequence[EntryPoint]]:
    """Return the verbs of installed packages."""
    from lupin_cli.plugin_verbs import plugin_verbs

    own = {*VERBS, *OPERATOR_VERBS, *_request_verbs()}
    return {verb: points for verb, points in plugin_verbs().items() if verb not in own}


def _author(arguments: Sequence[str] | None) -> str:
    """Return who brings the verb that failed."""
    given = sys.argv[1:] if arguments is None else arguments
    given = given[2:] if given[:1] == ["--robot"] else given
    verb, name, *_ = [*(word for word in given if not word.startswith("-")), "", ""]
    points = _points_of_plugins().get(verb)
    if points:
        return f"the verb {verb!r} of {points[0].distribution}"
    return _author_of_node(name) if verb == "node" else "the engine"


def _author_of_node(name: str) -> str:
    from lupin_engine.plugin import find_entry_point, load_catalog
    from lupin_ros.launch import find_node

    try:
        distribution = find_entry_point(find_node(name, load_catalog()).plugin).distribution
    except LupinError:  # a node of no plugin
        return "the engine"
    is_ours = distribution is not None and distribution.name == "lupin-engine"
    return "the engine" if is_ours else f"the node {name!r} of {distribution}"


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="lupin")
@click.option("--robot", metavar="NAMESPACE", help="The same option of each verb that talks to a robot.")
def lupin(robot: str | None) -> None:
    """Robot missions as YAML statecharts: check, simulate, draw, run over ROS 2."""
    if robot is not None:
        from lupin_engine.plugin import ROBOT, read_robot

        os.environ[ROBOT] = read_robot(robot)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code (the console entry point)."""
    if arguments is None and sys.argv[1:2] == ["check"] and not {"-w", "--watch"}.intersection(sys.argv):
        gc.disable()  # a process that ends at once: to look for garbage is a twentieth of its time
    _open_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a character must not end a run
    try:
        code = _run(arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        from lupin_cli.terminal.tty import hang_up

        hang_up()
        return READER_GONE
    return code


def run_node() -> int:
    """Run the node that this command is called after: what `ros2 run` and launch files start."""
    return main(["node", os.path.basename(sys.argv[0]), *sys.argv[1:]])


def _open_streams() -> None:
    """Open missing standard streams to /dev/null: the caller may have closed some (`<&-`)."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 - as long as the process


def _run(arguments: Sequence[str] | None) -> int:
    stdout = sys.stdout
    try:
        result: Any = lupin.main(args=arguments and list(arguments), prog_name="lupin", standalone_mode=False)
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.ClickException as problem:
        problem.show(sys.stderr)
        return problem.exit_code
    except (click.Abort, KeyboardInterrupt):
        return INTERRUPTED
    except LupinError as problem:
        # Findings begin with the place in the file, which editors and terminals turn into a link.
        print(problem if isinstance(problem, ChartError) else f"lupin: {problem}", file=sys.stderr)
        return problem.exit_code
    except SystemExit:
        if sys.stdout is stdout:
            raise
        return READER_GONE  # click has replaced the stream by one that ignores errors
    except BrokenPipeError:
        raise
    except Exception as defect:
        _report_defect(defect, arguments)
        return DEFECT
    return result if isinstance(result, int) else 0


def _report_defect(defect: Exception, arguments: Sequence[str] | None) -> None:
    """Print who caused the defect, in one line, and the file with the details."""
    from lupin_cli.crash import write_crash_log

    kind = type(defect).__name__
    print(f"lupin: a defect of {_author(arguments)}: {kind}: {defect}", file=sys.stderr)
    try:
        print(f"lupin: please report {write_crash_log(defect)}", file=sys.stderr)
    except OSError as problem:
        print(f"lupin: nothing more could be written down: {problem}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
