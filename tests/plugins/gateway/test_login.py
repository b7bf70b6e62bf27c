"""Wrong tokens are slow and written down, links let in once, and the verb that makes them."""

from __future__ import annotations

import socket
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_gateway.access import AccessControl, BadTokens, IssuedToken, UserRole, Visitor, read_tokens
from lupin_gateway.entry.attempts import MOST_ADDRESSES, WrongAttempts, delay, is_written_down
from lupin_gateway.entry.invitations import GOOD_FOR_S, GatewayAddress, Invitations, state_folder
from tests.plugins.gateway.served import ServedGateway, until

FOREVER = 4_102_444_800.0
ANNA = IssuedToken(Visitor("anna", UserRole.OPERATOR, FOREVER), "a" * 40)


# -- wrong ones -------------------------------------------------------------------------------------------


def test_each_wrong_one_is_slower_by_address() -> None:
    """Those of others count by themselves; after ten minutes an address begins anew."""
    attempts = WrongAttempts()
    assert [attempts.count("eve", now) for now in (0.0, 1.0, 2.0)] == [1, 2, 3]
    assert attempts.count("anna", 2.0) == 1
    assert attempts.count("eve", 601.9) == 4
    assert attempts.count("eve", 1202.0) == 1
    assert [delay(times) for times in (1, 2, 3, 4, 5, 6, 10_000)] == [0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0]
    assert [times for times in range(1, 20) if is_written_down(times)] == [1, 2, 4, 8, 16]


def test_only_so_many_addresses_are_remembered() -> None:
    """The one that was silent for longest is forgotten first."""
    attempts = WrongAttempts()
    for number in range(MOST_ADDRESSES):
        attempts.count(str(number), 0.0)
    assert attempts.count("0", 1.0) == 2
    assert attempts.count("one more", 1.0) == 1
    assert attempts.count("0", 1.0) == 3
    assert attempts.count("1", 1.0) == 1


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[ServedGateway]:
    """A gateway that asks for tokens."""
    with ServedGateway(tmp_path, tokens=[ANNA]) as found:
        found.rules.invitations = Invitations(tmp_path)
        yield found


def post(at: ServedGateway, **fields: str) -> tuple[int, str]:
    """Send the form, and return the status with the page or the cookie."""

    class _Stay(urllib.request.HTTPRedirectHandler):
        def redirect_request(self, *_: object) -> None:
            return None

    data = urllib.parse.urlencode(fields).encode()
    try:
        urllib.request.build_opener(_Stay()).open(f"http://localhost:{at.port}/login", data, 30)
    except urllib.error.HTTPError as answer:
        with answer:
            return answer.code, answer.headers.get("set-cookie") or answer.read().decode()
    raise AssertionError("it is answered by another page")


def test_wrong_ones_are_written_down_and_right_ones_are_not_late(
    guarded: ServedGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the token, and not each; somebody who knows the token comes in from the same address."""
    waited: list[int] = []
    monkeypatch.setattr("lupin_gateway.guard.delay", lambda times: waited.append(times) or 0.0)
    for _ in range(5):
        assert post(guarded, token="x" * 40)[0] == 401
    assert post(guarded, token=ANNA.secret)[0] == 303
    assert waited == [1, 2, 3, 4, 5]
    lines = until(lambda: (lines := guarded.lines())[3:] and lines, "four lines")
    assert [(line["who"], line["accepted"], line.get("times"), line["answer"]) for line in lines] == [
        *(
            ("", False, times, "this token is nobody's; ask who runs the gateway for one")
            for times in (1, 2, 4)
        ),
        ("anna", True, None, "by token"),
    ]
    assert {line["from"] for line in lines} == {"127.0.0.1"}
    assert "xxxx" not in guarded.log.read_text()


# -- links ------------------------------------------------------------------------------------------------


def test_a_link_lets_in_once(guarded: ServedGateway, tmp_path: Path) -> None:
    """With the cookie that a token gives; later, and a second time, it is a wrong one."""
    now = guarded.rules.clocks.wall()
    code, old = (Invitations(tmp_path).invite("anna", wall) for wall in (now, now - GOOD_FOR_S))
    status, cookie = post(guarded, code=code)
    assert (status, cookie.partition(";")[0]) == (303, f"lupin_token={ANNA.secret}")
    for wrong in (code, old, "guessed"):
        status, page = post(guarded, code=wrong)
        assert status == 401
        assert "this link was used already, or is older than 10 minutes; ask for a new one" in page
    assert code not in guarded.log.read_text()


def test_a_link_of_somebody_who_is_gone(guarded: ServedGateway, tmp_path: Path) -> None:
    """The file of tokens decides when the link is used."""
    code = Invitations(tmp_path).invite("ben", guarded.rules.clocks.wall())
    assert "ben has no token any more; ask who runs the gateway for one" in post(guarded, code=code)[1]


def test_codes_are_files_of_this_user_alone(tmp_path: Path) -> None:
    """Their names tell nothing, and those that are over are removed with the next one."""
    codes = Invitations(tmp_path)
    code = codes.invite("anna", 0.0)
    (file,) = (tmp_path / "invitations").iterdir()
    assert (file.stat().st_mode & 0o777, file.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    assert code not in file.name + file.read_text()
    codes.invite("anna", file.stat().st_mtime + GOOD_FOR_S + 1)
    assert len([*file.parent.iterdir()]) == 1
    assert codes.use("../tokens", 0.0) == ""


# -- who has to go ----------------------------------------------------------------------------------------


def test_why_somebody_has_to_go(tmp_path: Path) -> None:
    """A line that is gone, or has another role or token; not a mistake in another line."""
    file = tmp_path / "tokens"

    def written(text: str) -> None:
        file.write_text(text)
        file.chmod(0o600)

    written(f"anna operator 2099-12-31 {'a' * 40}\neve viewer 2099-12-31 {'e' * 40}\n")
    access, visitors = AccessControl(lambda: read_tokens(file)), [one.visitor for one in read_tokens(file)]
    assert access.reasons_to_go(visitors, 0.0) == ["", ""]
    taken = "this token was taken out of the file of tokens"
    for text, reasons in (
        (f"anna operator 2099-12-31 {'a' * 40}\nben boss\n", ["", taken]),
        (f"anna viewer 2099-12-31 {'a' * 40}\neve viewer 2099-12-31 {'f' * 40}\n", [taken, taken]),
        ("", [taken, taken]),
    ):
        written(text)
        assert access.reasons_to_go(visitors, 0.0) == reasons
    file.unlink()
    with pytest.raises(BadTokens):
        read_tokens(file)
    assert access.reasons_to_go(visitors, 0.0) == [taken, taken]
    late = access.reasons_to_go(visitors, FOREVER)[0]
    assert late == "the token of anna has expired with 2099-12-31; ask for a new one"
    assert AccessControl().reasons_to_go(visitors, 0.0) == ["", ""]


# -- the verb ---------------------------------------------------------------------------------------------


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The state folder of a gateway that was started with two people."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    tokens = tmp_path / "tokens"
    tokens.write_text(f"anna operator 2099-12-31 {'a' * 40}\nold viewer 2020-12-31 {'o' * 40}\n")
    tokens.chmod(0o600)
    return state_folder()


def test_nobody_to_invite_to(state: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is missing is said: a gateway, a name, a token that is good, a gateway that runs."""
    assert (main(["invite", "anna"]), capsys.readouterr().err) == (
        2,
        "lupin: no gateway of this user has asked for tokens in ROS domain 0; start one with lupin up --hmi "
        "--open, see docs/gateway.md\n",
    )
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    tokens = state.parents[1] / "tokens"
    GatewayAddress("127.0.0.1", port, str(tokens), "").keep(state)
    for name, told in (
        ("ana", f"{tokens} has no line for 'ana'; did you mean 'anna'?"),
        ("old", "the token of old has expired with 2020-12-31; ask for a new one"),
        ("anna", f"no gateway answers at 127.0.0.1:{port}: [Errno 111] Connection refused"),
    ):
        assert (main(["invite", name]), capsys.readouterr().err) == (2, f"lupin: {told}\n")


def test_inviting_somebody(guarded: ServedGateway, state: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The link has the code of a file; the QR code is the same."""
    GatewayAddress("127.0.0.1", guarded.port, str(state.parents[1] / "tokens"), "").keep(state)
    guarded.rules.invitations = Invitations(state)
    assert main(["invite", "anna"]) == 0
    head, _, link, _, *code = capsys.readouterr().out.splitlines()
    assert head == "anna (operator) logs in with this link, once, within 10 minutes:"
    address, _, secret = link.strip().partition("#")
    assert address == f"http://localhost:{guarded.port}/login"
    assert len(code) * 2 >= len(code[0])
    assert post(guarded, code=secret)[0] == 303
    assert main(["invite", "anna", "--at", "robot.local"]) == 0
    assert f"http://robot.local:{guarded.port}/login#" in capsys.readouterr().out
