"""How much processor each node takes while nothing is asked of it, beside a bare rclpy node.

    .venv/bin/python benchmarks/idle_cpu.py [--seconds 15] [--rounds 3] [--nodes NAME ...]

Every node of the installed plugins and the orchestrator run as processes of their own on a private domain,
as `lupin up` starts them. Each in turn gets a mirror (`mirror.py`): a bare node with the same endpoints that
gets the same messages and publishes copies of the other's as often; both are measured over the same seconds.
Figures are user and system time from /proc, per cent of one core.
"""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lupin_engine.plugin.registry import load_catalog
from lupin_ros.launch.nodes import nodes_of

LUPIN = str(Path(sys.executable).with_name("lupin"))
MIRROR = str(Path(__file__).with_name("mirror.py"))
DOMAIN = "94"
#: Seconds until everything has started, found each other and left BOOT.
SETTLE_S = 12.0


def cpu_seconds(pid: int) -> float:
    """Return user and system time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def start(command: list[str], home: str) -> subprocess.Popen[str]:
    """Start a process on the private domain; what nodes keep goes into `home`."""
    private = {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return subprocess.Popen(
        command,
        env={**private, **os.environ, "XDG_STATE_HOME": home, "XDG_CONFIG_HOME": home},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )


def stop(process: subprocess.Popen[str]) -> None:
    """End a process as Ctrl-C would."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    assert process.stdout is not None
    process.stdout.close()


def measure(name: str, pid: int, seconds: float, home: str) -> tuple[float, float]:
    """Return the shares of one core that a node and its mirror take, in per cent."""
    mirror = start([sys.executable, MIRROR, f"/{name}"], home)
    try:
        assert mirror.stdout is not None
        if mirror.stdout.readline().strip() != "mirrored":
            raise SystemExit(f"there is no mirror of {name}")
        time.sleep(2.0)  # its endpoints are discovered
        pids = (pid, mirror.pid)
        before, begun = [cpu_seconds(each) for each in pids], time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - begun
        ours, bare = (100.0 * (cpu_seconds(p) - b) / passed for p, b in zip(pids, before, strict=True))
        return ours, bare
    finally:
        stop(mirror)


def main() -> None:
    """Measure every node and print a table of medians."""
    every = list(nodes_of(load_catalog()))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--nodes", nargs="*", choices=every, default=every, metavar="NAME")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        world = {name: start([LUPIN, "node", name], home) for name in every}
        try:
            time.sleep(SETTLE_S)
            print("| node | one core | bare node | ratio | load |")
            print("|---|---|---|---|---|")
            for name in arguments.nodes:
                pid = world[name].pid
                pairs = [measure(name, pid, arguments.seconds, home) for _ in range(arguments.rounds)]
                ours, bare = (statistics.median(figures) for figures in zip(*pairs, strict=True))
                ratio = f"{ours / bare:.2f}" if bare else "-"  # less than a tick of the kernel's clock
                load = os.getloadavg()[0]
                print(f"| `{name}` | {ours:.2f} % | {bare:.2f} % | {ratio} | {load:.1f} |", flush=True)
        finally:
            for process in world.values():
                stop(process)


if __name__ == "__main__":
    main()
