"""What a recording of a run costs: processor time of the recorder, and size of the file, by topic.

    .venv/bin/python benchmarks/recording.py [--speed 1] [--tags 1,5,12] [--mission inspection]

`lupin record` runs beside `lupin run` on a private domain and ends with the mission. Its figures are user and
system time of the whole process, its start included, per cent of one core, and bytes of the finished file.
`--topics` also tells how many bytes each topic has before the compression.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from idle_cpu import DOMAIN, LUPIN, cpu_seconds
from mcap.reader import make_reader


def main() -> int:
    """Measure one run and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--mission", default="inspection")
    parser.add_argument("--speed", default="1")
    parser.add_argument("--tags", default="")
    parser.add_argument("--topics", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        os.environ |= {"XDG_STATE_HOME": folder, "XDG_CONFIG_HOME": folder}
        file = Path(folder, "run.mcap")
        recorder = subprocess.Popen([LUPIN, "record", "--output", str(file)], stdout=subprocess.DEVNULL)
        began = time.monotonic()
        options = ["--speed", given.speed, *(["--tags", given.tags] if given.tags else [])]
        run = subprocess.Popen([LUPIN, "run", given.mission, *options], stdout=subprocess.DEVNULL)
        used = ended = 0.0
        while recorder.poll() is None:
            try:
                used, ended = cpu_seconds(recorder.pid), time.monotonic()
            except (OSError, IndexError):
                break
            time.sleep(0.1)
        if recorder.wait() or run.wait():
            return 1
        _tell(file, used, ended - began, given.topics)
    return 0


def _tell(file: Path, used: float, seconds: float, topics: bool) -> None:
    size, raw = file.stat().st_size, Counter[str]()
    with file.open("rb") as stream:
        reader = make_reader(stream)
        for _, channel, message in reader.iter_messages():
            raw[channel.topic] += len(message.data)
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    messages, minutes = summary.statistics.message_count, seconds / 60
    print(f"{seconds:.0f} s, {messages} messages of {len(raw)} topics: {messages / seconds:.0f} a second")
    print(f"processor: {used:.2f} s, {100 * used / seconds:.2f} % of one core")
    print(f"file: {size / 1e6:.2f} MB, {size / 1e6 / minutes:.2f} MB a minute")
    print(f"before compression: {sum(raw.values()) / 1e6:.2f} MB")
    if topics:
        for topic, amount in raw.most_common():
            print(f"  {amount / 1e3:9.1f} kB  {topic}")


if __name__ == "__main__":
    sys.exit(main())
