"""People log in: a real browser on another computer, over TLS, with a certificate that nobody has signed."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, Page, expect, sync_playwright

from lupin_gateway.guard import STOPS_TOPIC as STOPS
from lupin_harness.domains import claimed_domain
from tests.browsing import FLAGS, PATIENCE_MS, PHONE
from tests.lupin_ros.computers import ADDRESSES, Computers, NoComputers, connected
from tests.lupin_ros.world import World
from tests.plugins.gateway.served import until

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

ROBOT, PORT = ADDRESSES[0], 8443
LUPIN = str(Path(sys.executable).with_name("lupin"))
TOKENS = {"anna": "a1" * 20, "ben": "b2" * 20}


@dataclass
class Site:
    """A computer with an open gateway: its files, its output, and the environment of who works there."""

    computers: Computers
    folder: Path
    log: Path
    environment: dict[str, str]

    @property
    def url(self) -> str:
        return f"https://{ROBOT}:{PORT}"

    @property
    def audit(self) -> list[dict[str, object]]:
        return [json.loads(line) for line in (self.folder / "audit.jsonl").read_text().splitlines()]

    def people(self, *names: str) -> None:
        """Write the file of tokens, with these people in it."""
        lines = "".join(f"{name} operator 2099-12-31 {TOKENS[name]}\n" for name in names)
        (self.folder / "tokens").write_text(lines)
        (self.folder / "tokens").chmod(0o600)

    def lupin(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a verb on the robot."""
        line = self.computers.on(0, LUPIN, *arguments)
        return subprocess.run(line, capture_output=True, text=True, timeout=60, env=self.environment)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """An open gateway, as docs/gateway.md has it: the certificate is made with the line that stands there."""
    folder = tmp_path_factory.mktemp("robot")
    with ExitStack() as stack:
        try:
            computers = stack.enter_context(connected(Computers()))
        except NoComputers as problem:
            pytest.skip(str(problem))
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        patch.setenv("ROS_DOMAIN_ID", str(stack.enter_context(claimed_domain())))
        make = (
            "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 365 -subj /CN=robot "
            f"-addext subjectAltName=DNS:robot.local,IP:{ROBOT} -keyout key.pem -out cert.pem"
        )
        subprocess.run(shlex.split(make), cwd=folder, check=True, capture_output=True)
        found = Site(computers, folder, folder / "lupin_gateway.log", {**os.environ})
        found.people(*TOKENS)
        given = {
            "open": "true",
            "port": PORT,
            "audit_file": folder / "audit.jsonl",
            "tokens": folder / "tokens",
            "tls_certificate": folder / "cert.pem",
            "tls_key": folder / "key.pem",
        }
        parameters = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
        world = World(folder)
        stack.callback(world.stop)
        world.run("lupin_gateway", computers.on(0, LUPIN, "node", "lupin_gateway", "--ros-args", *parameters))
        probe = computers.on(1, "curl", "-sk", "-o", "/dev/null", found.url)
        until(lambda: not subprocess.run(probe).returncode, "the gateway")
        yield found


@pytest.fixture(scope="module")
def browser(site: Site) -> Iterator[Browser]:
    """Chromium on the other computer."""
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("no Chromium is installed here: apt install chromium")
    there = site.folder / "chromium"
    there.write_text(f'#!/bin/sh\nexec {shlex.join(site.computers.on(1, chromium))} "$@"\n')
    there.chmod(0o700)
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=str(there), args=list(FLAGS))
        yield found
        found.close()


@pytest.fixture
def phone(browser: Browser) -> Iterator[Page]:
    """A phone whose owner has accepted the certificate."""
    context = browser.new_context(viewport=PHONE, ignore_https_errors=True, locale="en-GB")
    context.set_default_timeout(PATIENCE_MS)
    yield context.new_page()
    context.close()


def log_in(page: Page, site: Site, token: str) -> None:
    """Type a token."""
    page.goto(site.url)
    page.get_by_label("Your token").fill(token)
    page.get_by_role("button", name="Log in").click()


def test_a_person_logs_in_with_a_token(phone: Page, site: Site) -> None:
    """A wrong one is told so, slowly; the right one opens the console, also when the page is loaded anew."""
    log_in(phone, site, "x" * 40)
    expect(phone.get_by_role("alert")).to_have_text(
        "this token is nobody's; ask who runs the gateway for one"
    )
    log_in(phone, site, TOKENS["anna"])
    phone.locator(".bar .pill.good").wait_for()
    phone.reload()
    phone.locator(".bar .pill.good").wait_for()


def test_a_person_logs_in_with_a_link_once(browser: Browser, phone: Page, site: Site) -> None:
    """The link of `lupin invite` has no token in it, and what it has lets nobody in again."""
    done = site.lupin("invite", "anna")
    assert done.returncode == 0, done.stderr
    link = next(line.strip() for line in done.stdout.splitlines() if "https://" in line)
    assert re.fullmatch(rf"{re.escape(site.url)}/login#[\w-]{{22}}", link)
    assert "█" in done.stdout  # the same as a QR code
    phone.goto(link)
    phone.locator(".bar .pill.good").wait_for()
    late = browser.new_context(ignore_https_errors=True).new_page()
    late.goto(link)
    expect(late.get_by_role("alert")).to_have_text(
        "this link was used already, or is older than 10 minutes; ask for a new one (lupin invite)"
    )
    late.context.close()
    written = (site.folder / "audit.jsonl").read_text() + site.log.read_text()
    assert not [secret for secret in (*TOKENS.values(), link.partition("#")[2]) if secret in written]
    came_in = [(line["who"], line["answer"]) for line in site.audit if line.get("accepted")]
    assert came_in[-1] == ("anna", "by a link")


def stops(page: Page) -> dict[str, Any]:
    """Ask which stops are engaged, as a page does."""
    script = f"""() => new Promise(done => {{
        const socket = new WebSocket("wss://{ROBOT}:{PORT}/_ros");
        socket.onopen = () => socket.send(JSON.stringify({{op: "subscribe", topic: "{STOPS}"}}));
        socket.onmessage = frame => {{ done(JSON.parse(frame.data).msg.data); socket.close(); }};
    }})"""
    found: dict[str, Any] = json.loads(page.evaluate(script))
    return found


def test_who_has_no_token_any_more_has_to_go(browser: Browser, phone: Page, site: Site) -> None:
    """Within 5 s the connection ends; what the page had stopped stays stopped until another releases it."""
    log_in(phone, site, TOKENS["anna"])
    phone.locator(".bar .pill.good").wait_for()
    other = browser.new_context(ignore_https_errors=True, locale="en-GB").new_page()
    log_in(other, site, TOKENS["ben"])
    other.locator(".bar .pill.good").wait_for()
    phone.locator("#stop").click()
    until(lambda: stops(other)["stopped"], "the stop")
    for _ in range(
        6
    ):  # from this address somebody has shown so many wrong ones that each answer waits for 8 s
        wrong = ("-H", f"Authorization: Bearer {'x' * 40}", site.url)
        subprocess.run(site.computers.on(1, "curl", "-sk", "-o", "/dev/null", "--max-time", "0.3", *wrong))
    site.people("ben")
    expect(phone.locator(".bar .pill.good")).to_have_count(0, timeout=5_000)
    ended = [line for line in site.audit if "this token was taken out" in str(line.get("answer"))]
    assert {line["who"] for line in ended} == {"anna"}
    expect(phone.get_by_label("Your token")).to_be_visible(timeout=60_000)  # by itself
    left = stops(other)
    assert left["stopped"]
    assert [stop["left"] for stop in left["stops"] if stop["name"].startswith("anna-")] == [True]
    other.locator(".bar .pill.good").wait_for()
    other.context.close()
    site.people(*TOKENS)
