"""Unpacks what a recording has of a journal: the attached files, and the charts that were published."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from lupin_engine.errors import LupinError, UsageError, shortened
from lupin_engine.runtime import CHARTS
from lupin_ros.recording.file import JOURNAL_TYPE
from lupin_ros.recording.reader import Recording
from lupin_ros.service import names


def unpack_journal(recording: Recording, folder: Path) -> bool:
    """Write the attached files of a journal into a folder; of two with one name the longer one stays.

    Returns False where none is attached: the file is cut off, or the orchestrator ran on another computer.
    """
    files = dict(recording.attached(JOURNAL_TYPE))
    for name, data in files.items():
        file = folder / Path(name).name
        if not file.is_file() or file.stat().st_size < len(data):
            file.write_bytes(data)
    return bool(files)


def unpack_learnable(recording: Recording, folder: Path) -> None:
    """Write the journal of a recording and its charts into a folder, as the orchestrator keeps them.

    Raises:
        UsageError: the recording has no journal.
    """
    if not unpack_journal(recording, folder):
        why = "it is cut off" if recording.is_cut_off else "it was not made beside an orchestrator"
        hint = "messages alone leave out the poses and charges that changed no state"
        raise UsageError(f"{recording.path} has no journal, because {why}; {hint}")
    for message in recording.messages([names.CHART_TOPIC]):
        record = json.loads(message.fields["data"])
        files = {f"{record['hash']}/{name}": text for name, text in record["files"].items()}
        write_files(files, folder / CHARTS)


def write_files(files: Mapping[str, str], folder: Path) -> None:
    """Write recorded files into a folder.

    Raises:
        LupinError: a name leads out of the folder.
    """
    for name, text in files.items():
        file = folder / name
        if folder.resolve() not in file.resolve().parents:
            raise LupinError(f"a file that was recorded is outside of its folder: {shortened(name)!r}")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8", newline="")
