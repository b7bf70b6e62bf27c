"""`lupin replay`: a recording in the console, at any moment."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import click

from lupin_engine.cli import options
from lupin_engine.cli.exit_codes import not_done
from lupin_engine.errors import Problems, UsageError
from lupin_engine.plugin.registry import load_catalog, load_profiles


@click.command(short_help="Show a recording in the console.")
@click.argument("file", type=click.Path(path_type=Path))
@options.hmi
@options.pages_port
@not_done()
def replay(file: Path, hmi: bool, port: int) -> int:
    """Show FILE, a recording of `lupin record` or `lupin run --record`, in the console, until Ctrl-C.

    No ROS is needed. A recording that was cut off is shown as far as it goes, and one by others as far
    as it has topics that the console knows.

    Exit code: 0 ended by Ctrl-C; 2 the file is no recording, or it cannot be shown.
    """
    from lupin_engine.cli.pages import find_server, serve

    problems = Problems(UsageError)
    if not hmi:
        problems.add(f"a recording is shown in the console: `lupin replay {file} --hmi`")
    if any(importlib.util.find_spec(name) is None for name in ("mcap", "mcap_ros2")):
        problems.add("to read a recording, packages are needed: `pip install 'lupin-engine[record]'`")
    problems.tell()
    from lupin_engine.ros.recording.reader import Recording
    from lupin_engine.ros.virtual.recorded import RecordedPages

    server = find_server(load_catalog())
    return serve(RecordedPages(Recording(file), load_profiles()), server, port)
