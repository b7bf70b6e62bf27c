"""How soon an operator comes in, and how fast STOP is, while strangers hold connections to the gateway.

    .venv/bin/python benchmarks/strangers.py [--silent 2000] [--slow 500] [--seconds 20] [--descriptors 1024]
    chrt -r 10 .venv/bin/python benchmarks/strangers.py             # on a machine that others use, as root

The gateway is a process of its own, open, with TLS and tokens. A crowd, one more process, holds so many
connections that say nothing and so many that send the head of a request byte by byte, and opens each anew
three seconds after it was ended; all on loopback. In turn there is nobody, a crowd of one address, one of the
operator's own address, and one of 500 addresses. Meanwhile an operator who is in says stop and go in turn;
latency is from the page to a subscriber of `/lupin/gateway/stop`. Another one comes in anew again and again,
from the first packet to the open connection. With `chrt` the crowd comes last: it is on other computers.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import resource
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import rclpy
import trustme
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Bool
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

LUPIN = str(Path(sys.executable).with_name("lupin"))
DOMAIN = "95"
#: Seconds that anything may take before the benchmark gives up.
PATIENCE = 30.0
#: Seconds between two bytes of a slow one, and until a connection that was ended is opened anew.
BYTE_S, AGAIN_S = 2.0, 3.0
OPERATOR, TOKEN = "127.0.0.1", "a" * 40
CROWDS: dict[str, list[str]] = {
    "nobody": [],
    "one address": ["127.0.0.2"],
    "the operator's address": [OPERATOR],
    "500 addresses": [f"127.1.{number // 250}.{1 + number % 250}" for number in range(500)],
}


# -- the crowd ----------------------------------------------------------------------------------------------


async def _hold(port: int, address: str, slow: ssl.SSLContext | None, tried: Callable[[], None]) -> None:
    while True:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            reader, writer = await asyncio.open_connection(
                OPERATOR, port, local_addr=(address, 0), ssl=slow, ssl_handshake_timeout=60 if slow else None
            )
            try:
                tried()
                head = iter("GET / HTTP/1.1\r\nx: " + "y" * 10_000) if slow else iter(())
                while not reader.at_eof():
                    writer.write(next(head, "").encode())
                    with contextlib.suppress(asyncio.TimeoutError):
                        await asyncio.wait_for(reader.read(100), BYTE_S)
            finally:
                writer.close()
        await asyncio.sleep(AGAIN_S)


async def _crowd(port: int, silent: int, slow: int, addresses: list[str]) -> None:
    anyone = ssl.create_default_context()
    anyone.check_hostname, anyone.verify_mode = False, ssl.CERT_NONE
    kinds = [anyone] * slow + [None] * silent
    opened: Counter[int] = Counter()

    def count(number: int) -> None:
        opened[number] += 1
        if len(opened) == len(kinds) and opened[number] == 1:
            print("all were open", flush=True)

    each = (
        _hold(port, addresses[number % len(addresses)], kind, partial(count, number))
        for number, kind in enumerate(kinds)
    )
    await asyncio.gather(*each)


@contextlib.contextmanager
def _gathered(port: int, given: argparse.Namespace, crowd: str) -> Iterator[None]:
    if not CROWDS[crowd]:
        yield
        return
    words = ["--crowd", crowd, "--port", port, "--silent", given.silent, "--slow", given.slow]
    line = [sys.executable, __file__, *map(str, words)]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert process.stdout is not None
        assert process.stdout.readline(), "the crowd has ended"
        yield
    finally:
        process.kill()
        process.wait()


# -- the gateway --------------------------------------------------------------------------------------------


@contextlib.contextmanager
def _gateway(folder: Path, port: int, descriptors: int) -> Iterator[subprocess.Popen[bytes]]:
    values = {
        "open": "true",
        "port": port,
        "tokens": folder / "tokens",
        "tls_certificate": folder / "cert.pem",
        "tls_key": folder / "key.pem",
    }
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
    line = [LUPIN, "node", "lupin_gateway", "--ros-args", *words]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(line, stdout=log, stderr=log)
    resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (descriptors, descriptors))
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


def _files(folder: Path) -> ssl.SSLContext:
    authority = trustme.CA()
    issued = authority.issue_cert(OPERATOR)
    issued.cert_chain_pems[0].write_to_path(str(folder / "cert.pem"))
    issued.private_key_pem.write_to_path(str(folder / "key.pem"))
    (folder / "tokens").write_text(f"anna operator 2099-12-31 {TOKEN}\n")
    (folder / "tokens").chmod(0o600)
    trust = ssl.create_default_context()
    authority.configure_trust(trust)
    trust.maximum_version = ssl.TLSVersion.TLSv1_2  # see tests/lupin_ros/plugins/gateway/test_open.py
    return trust


# -- the operator -------------------------------------------------------------------------------------------


class Operator:
    """A page that is in, and the robot that hears its stop."""

    def __init__(self, port: int, trust: ssl.SSLContext) -> None:
        self._port = port
        self._trust = trust
        self._heard: list[bool] = []
        self._executor = SingleThreadedExecutor()
        node = rclpy.create_node("strangers")
        self._executor.add_node(node)
        node.create_subscription(Bool, "/lupin/gateway/stop", lambda told: self._heard.append(told.data), 10)
        self._page = self._until(self.come_in, "the gateway")

    def come_in(self) -> ClientConnection | None:
        """Open a connection with the token; None where that is refused."""
        try:
            # Entered by hand: the connection lives until the page is closed.
            return connect(
                f"wss://{OPERATOR}:{self._port}/_ros",
                ssl=self._trust,
                additional_headers={"Authorization": f"Bearer {TOKEN}"},
                open_timeout=PATIENCE,
                ping_interval=None,
            ).__enter__()
        except (OSError, WebSocketException):
            return None

    def _until(self, condition: Callable[[], object], what: str) -> ClientConnection:
        end = time.monotonic() + PATIENCE
        while not (found := condition()):
            if time.monotonic() > end:
                raise SystemExit(f"not within {PATIENCE:g} s: {what}")
            self._executor.spin_once(timeout_sec=0.002)
        return found  # type: ignore[return-value]

    def stop(self, stopped: bool) -> float:
        """Say stop or go, and return the milliseconds until the robot hears it."""
        self._until(lambda: self._heard[-1:] == [not stopped], "the state before")
        begun = time.perf_counter()
        told = {"op": "publish", "topic": "/lupin/hmi/estop", "msg": {"data": stopped}}
        self._page.send(json.dumps(told))
        self._until(lambda: self._heard[-1] is stopped, f"stop {stopped}")
        return 1000 * (time.perf_counter() - begun)

    def measure(self, seconds: float) -> tuple[list[float], list[float], int]:
        """Return milliseconds of stops and of coming in, and how often that had to be tried again."""
        stops, entries, again = list[float](), list[float](), 0
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for _ in range(5):
                stops.append(self.stop(True))
                self.stop(False)
                self._executor.spin_once(timeout_sec=0.05)
            begun = time.perf_counter()
            while (page := self.come_in()) is None:
                again += 1
                time.sleep(0.05)
            entries.append(1000 * (time.perf_counter() - begun))
            page.close()
        return sorted(stops), sorted(entries), again


def _row(name: str, times: list[float]) -> str:
    middle, late = times[len(times) // 2], times[int(len(times) * 0.99)]
    return f"{name:36}{len(times):6}{middle:10.1f}{late:10.1f}{times[-1]:10.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description="Strangers at the gateway's doors.")
    parser.add_argument("--silent", type=int, default=2000)
    parser.add_argument("--slow", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=20.0, help="for each crowd")
    parser.add_argument("--descriptors", type=int, default=1024, help="that the gateway may have")
    parser.add_argument("--crowd", choices=[*CROWDS], help=argparse.SUPPRESS)
    parser.add_argument("--port", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    if given.crowd:
        if os.sched_getscheduler(0) == os.SCHED_RR:
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
        asyncio.run(_crowd(given.port, given.silent, given.slow, CROWDS[given.crowd]))
        return
    os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_STATE_HOME"] = name
        trust = _files(folder)
        with socket.create_server((OPERATOR, 0)) as found:
            port = found.getsockname()[1]
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        with _gateway(folder, port, given.descriptors) as process:
            operator = Operator(port, trust)
            print(f"{given.silent} silent, {given.slow} slow, {given.descriptors} descriptors; ms")
            print(f"{'':36}{'trials':>6}{'p50':>10}{'p99':>10}{'slowest':>10}")
            for crowd in CROWDS:
                with _gathered(port, given, crowd):
                    stops, entries, again = operator.measure(given.seconds)
                    held = len(os.listdir(f"/proc/{process.pid}/fd"))
                print(_row(f"stop, {crowd}", stops))
                print(
                    _row(f"in, {crowd}", entries), f" tried again: {again}, descriptors: {held}", flush=True
                )
        print(f"bytes of log: {(folder / 'log').stat().st_size}")
        print((folder / "log").read_text(), file=sys.stderr)


if __name__ == "__main__":
    main()
