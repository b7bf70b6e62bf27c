"""Who comes in, and what each may do: tokens, origins, roles by name, limits. Time is an argument."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.errors import LupinError
from lupin_engine.plugin.contract import Access
from lupin_engine.plugin.pages import declared_access
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_gateway.access import (
    LONGEST_FRAME,
    MOST_SUBSCRIPTIONS,
    OPERATIONS_PER_S,
    AccessControl,
    Allowance,
    AllowList,
    NotAdmitted,
    Use,
    UserRole,
    Visitor,
    open_problems,
    read_tokens,
)
from lupin_gateway.guard import OWN_ACCESS
from lupin_ros.service.names import ACCESS

NEW_YEAR = 1_798_761_600.0  # 2027-01-01T00:00:00Z
ANNAS, BENS, OLD = "a" * 40, "b" * 40, "c" * 40
MISSING = "a token is needed: log in at /login, or send it as Authorization: Bearer TOKEN"
UNDECLARED = " is not offered to pages: no plugin or mission declares this name; "
OFFER = "offer it by the gateway's setting operator_names or engineer_names"
FOREIGN = "pages of {} may not use this gateway; its setting `origins` lets them"
ALONE = "this gateway is for this machine alone: open http://localhost, not "
VIEWER, OPERATOR, ENGINEER = (Visitor("eve", role) for role in UserRole)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Three tokens, one of which has expired."""
    return written(
        tmp_path,
        f"# NAME ROLE EXPIRES TOKEN\nanna operator 2026-12-31 {ANNAS}\n\n"
        f"ben viewer 2030-01-01 {BENS}  # the hall\ncleo engineer 2026-01-31 {OLD}\n",
    )


def written(folder: Path, text: str, mode: int = 0o600) -> Path:
    """Write a file of tokens."""
    path = folder / "tokens"
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)
    return path


# -- tokens -----------------------------------------------------------------------------------------------


def bearer(token: str, **more: str) -> dict[str, str]:
    """The headers of a program."""
    return {"host": "robot:8443", "authorization": f"Bearer {token}", **more}


def test_tokens_by_header_and_cookie(file: Path) -> None:
    """A token has a name, a role and a last day."""
    access = AccessControl(lambda: read_tokens(file))
    assert access.admit(bearer(ANNAS), NEW_YEAR - 1) == Visitor("anna", UserRole.OPERATOR, NEW_YEAR)
    cookie = {"host": "robot:8443", "cookie": f"theme=dark; lupin_token={BENS}"}
    assert access.admit(cookie, NEW_YEAR).role is UserRole.VIEWER


@pytest.mark.parametrize(
    ("headers", "text"),
    [
        ({}, MISSING),
        (bearer(""), MISSING),
        ({"authorization": f"Basic {ANNAS}"}, MISSING),
        (bearer("x" * 40), "this token is nobody's; ask who runs the gateway for one"),
        (bearer("ünïcode"), "this token is nobody's; ask who runs the gateway for one"),
        (bearer(OLD), "the token of cleo has expired with 2026-01-31; ask for a new one"),
        (bearer(ANNAS), "the token of anna has expired with 2026-12-31; ask for a new one"),
        ({"cookie": "lupin_token"}, MISSING),
    ],
    ids=["missing", "empty", "other scheme", "wrong", "not ASCII", "expired", "expired now", "broken cookie"],
)  # fmt: skip
def test_no_token_no_entry(file: Path, headers: dict[str, str], text: str) -> None:
    """Missing, wrong and expired are told apart, and no token is in what is told."""
    access = AccessControl(lambda: read_tokens(file))
    with pytest.raises(NotAdmitted) as refused:
        access.admit({"host": "robot:8443", **headers}, NEW_YEAR)
    assert (refused.value.status, str(refused.value)) == (401, text)
    assert access.asks_for_token


def test_a_token_that_expires_while_its_page_is_open(file: Path) -> None:
    """Who has come in is looked at again with each operation."""
    anna = AccessControl(lambda: read_tokens(file)).admit(bearer(ANNAS), NEW_YEAR - 1)
    assert anna.has_expired(NEW_YEAR - 1) == ""
    assert anna.has_expired(NEW_YEAR) == "the token of anna has expired with 2026-12-31; ask for a new one"


def test_everything_wrong_with_the_tokens_at_once(tmp_path: Path) -> None:
    """Each with its line, and never a token: not even where it stands in the wrong place."""
    secret = "s3cr3t" * 8
    file = written(
        tmp_path,
        f"anna boss 2026-12-31 {secret}\nanna operator soon {secret}x\nben\n"
        f"9lives {secret}y 2026-12-31 viewer\ncleo viewer {secret}z x\ndora viewer 2027-01-01 {BENS}\n"
        f"dora viewer 2027-01-01 {BENS}\n",
        mode=0o644,
    )
    with pytest.raises(LupinError) as refused:
        read_tokens(file)
    text = str(refused.value).replace(str(file), "tokens")
    assert text.splitlines() == [
        "tokens: others can read or change these tokens (mode 644); write: chmod 600 tokens",
        "tokens:1: unknown role 'boss'; allowed: 'engineer', 'operator', 'viewer'",
        "tokens:2: EXPIRES must be a day such as 2026-12-31, not 'soon'",
        "tokens:3: expected NAME ROLE EXPIRES TOKEN, got 1 words",
        "tokens:4: a name has letters, digits, dots and underscores, and begins with a letter",
        "tokens:4: unknown role; allowed: 'engineer', 'operator', 'viewer'",
        "tokens:4: the token has 6 letters, at least 32 are needed: openssl rand -hex 32",
        "tokens:5: EXPIRES must be a day such as 2026-12-31, not this",
        "tokens:5: the token has 1 letters, at least 32 are needed: openssl rand -hex 32",
        "tokens:7: dora has a token already",
        "tokens:7: the token is another line's already",
    ]
    assert secret not in text
    assert secret not in repr(read_tokens(written(tmp_path, f"a viewer 2027-01-01 {secret}")))


def test_a_file_without_tokens(tmp_path: Path) -> None:
    """None at all, none that can be read, no file."""
    with pytest.raises(LupinError, match="there is no token in it; write lines of NAME ROLE EXPIRES TOKEN"):
        read_tokens(written(tmp_path, "# later\n"))
    with pytest.raises(LupinError, match="the tokens cannot be read: No such file or directory"):
        read_tokens(tmp_path / "none")
    (tmp_path / "latin").write_bytes(b"\xe9")
    with pytest.raises(LupinError, match="the tokens cannot be read: it is not a text in UTF-8"):
        read_tokens(tmp_path / "latin")


def test_tokens_that_cannot_be_read_any_more(file: Path) -> None:
    """Nobody comes in, which is told; when the file is mended, everybody does."""
    access = AccessControl(lambda: read_tokens(file))
    file.chmod(0o644)
    with pytest.raises(NotAdmitted) as refused:
        access.admit(bearer(ANNAS), 0.0)
    text = "nobody can come in now: the gateway cannot use its file of tokens, and its log says why"
    assert (refused.value.status, str(refused.value)) == (503, text)
    file.chmod(0o600)
    assert access.admit(bearer(ANNAS), 0.0).name == "anna"


# -- origins ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("localhost:8080", ""),
        ("localhost:9090", "http://localhost:8080"),
        ("127.0.0.1:9090", "http://localhost:5173"),
        ("[::1]:8080", "http://[::1]:8080"),
        ("localhost:8080", "https://hmi.example:8443"),
    ],
)
def test_pages_of_this_machine(host: str, origin: str) -> None:
    """Without tokens: pages of this machine on any port, programs, and pages that a setting names."""
    access = AccessControl(origins=["https://hmi.example:8443/"])
    visitor = access.admit({"host": host, **({"origin": origin} if origin else {})}, 0.0)
    assert visitor.role is UserRole.ENGINEER


@pytest.mark.parametrize(
    ("host", "origin", "text"),
    [
        ("localhost:8080", "https://evil.example", FOREIGN.format("'https://evil.example'")),
        ("localhost:8080", "null", FOREIGN.format("'null'")),
        ("localhost:8080", "http://[", FOREIGN.format("'http://['")),
        ("localhost:8080", "http://localhost.evil.example", FOREIGN.format("'http://localhost.evil.example'")),
        ("evil.example:8080", "http://evil.example:8080", f"{ALONE}'evil.example'"),
        ("", "", f"{ALONE}''"),
    ],
    ids=["foreign", "null", "broken", "alike", "rebound", "no host"],
)  # fmt: skip
def test_foreign_pages(host: str, origin: str, text: str) -> None:
    """A page of another host is refused, and so is a name that its owner lets lead here."""
    with pytest.raises(NotAdmitted) as refused:
        AccessControl().admit({"host": host, "origin": origin}, 0.0)
    assert (refused.value.status, str(refused.value)) == (403, text)


def test_a_foreign_page_with_a_token(file: Path) -> None:
    """The origin is looked at first: a cookie that a browser sends along opens nothing."""
    access = AccessControl(lambda: read_tokens(file))
    access.admit(bearer(ANNAS, origin="https://robot"), 0.0)
    for origin in ("https://evil.example", "null"):
        with pytest.raises(NotAdmitted, match="may not use this gateway"):
            access.admit(bearer(ANNAS, origin=origin), 0.0)
        with pytest.raises(NotAdmitted, match="may not use this gateway"):
            access.admit(bearer(ANNAS, host="", origin=origin), 0.0)


# -- names ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def catalog() -> Catalog:
    """What is installed."""
    return load_catalog()


def test_today_s_page_may_all_that_it_does(catalog: Catalog) -> None:
    """Every name that it uses is declared; as an engineer it may all, as a viewer it sees all."""
    pytest.importorskip("rclpy")
    from tests.lupin_ros.launch.hmi.rows import CALLED, NOT_OURS, READ_BESIDE, SHOWN, TOLD

    allowed = AllowList(declared_access(catalog))
    rows = [(Use.SUBSCRIBE, name) for name in [*SHOWN, *READ_BESIDE, "/tf_static", "/scan", "/odom"]]
    rows += [(Use.PUBLISH, name) for name in [*TOLD, "/cmd_vel", "/cmd_vel_manual"]]
    rows += [(Use.CALL, name) for name in CALLED]
    rows += [
        (Use.CALL, name)
        for name in NOT_OURS
        if name.count("/") > 2 and not name.startswith(("/io", "/rosapi"))
    ]
    assert [refused for use, name in rows if (refused := allowed.refusal(ENGINEER, use, name))] == []
    seen = [(use, name) for use, name in rows if use is Use.SUBSCRIBE]
    assert [refused for use, name in seen if (refused := allowed.refusal(VIEWER, use, name))] == []
    commands = [name for use, name in rows if use is not Use.SUBSCRIBE]
    free = {name for name in commands if not allowed.refusal(VIEWER, Use.CALL, name)}
    assert free == {"/twin/get_field", "/lupin/arm/library/list"}


def test_what_is_declared_is_there(catalog: Catalog) -> None:
    """What a plugin lets pages use stands on the page of the interfaces, and all services there are."""
    topics, services = (
        set(re.findall(r"^\| `([^`]+)` \|", part, re.MULTILINE))
        for part in Path("docs/interfaces.md").read_text(encoding="utf-8").split("## Services")
    )
    plugins = [plugin.access for plugin in catalog.plugins.values()]
    named = {name for access in plugins for role in UserRole for name in getattr(access, role.word)}
    # Nav2 cancels by these, which are part of its actions.
    cancels = {f"/navigate_{how}/_action/cancel_goal" for how in ("to_pose", "through_poses")}
    assert named - topics - services == cancels
    # The servos themselves are the arm's node's alone; pages start missions by the command service.
    closed = ("/io/servo/", "/mirte_master_", "/enable_arm_control", "/mission/run")
    allowed = AllowList([*declared_access(catalog), ACCESS])
    unnamed = {name for name in services if not name.startswith(closed) and not allowed.least(Use.CALL, name)}
    assert unnamed == set()


@pytest.mark.parametrize(
    ("use", "name", "who", "text"),
    [
        (Use.CALL, "/mission/start", VIEWER, "calling {} needs the role operator; eve is viewer"),
        (Use.CALL, "mission/start", VIEWER, "calling {} needs the role operator; eve is viewer"),
        (Use.PUBLISH, "/goal_pose", VIEWER, "publishing on {} needs the role operator; eve is viewer"),
        (
            Use.ACTION,
            "/navigate_to_pose",
            VIEWER,
            "commanding the action {} needs the role operator; eve is viewer",
        ),
        (
            Use.CALL,
            "/lupin/arm/set_torque",
            OPERATOR,
            "calling {} needs the role engineer; eve is operator",
        ),
        (Use.SUBSCRIBE, "/secret", OPERATOR, "subscribing to {} needs the role engineer; eve is operator"),
        (Use.SUBSCRIBE, "/secret", ENGINEER, ""),
        (Use.PUBLISH, "/map", ENGINEER, "publishing on {}" + UNDECLARED + OFFER),
        (
            Use.CALL,
            "/mission/paus",
            ENGINEER,
            "calling {}" + UNDECLARED + f"did you mean '/mission/pause'? Or {OFFER}",
        ),
        (Use.CALL, "/mission_orchestrator/set_parameters", ENGINEER, "calling {}" + UNDECLARED + OFFER),
        (
            Use.ACTION,
            "/mission/run",
            ENGINEER,
            "commanding the action {}" + UNDECLARED + f"did you mean '/mission/resume'? Or {OFFER}",
        ),
        (Use.CALL, "/mission/run/_action/send_goal", ENGINEER, "calling {}" + UNDECLARED + OFFER),
        (Use.PUBLISH, "/lupin/hmi/estop", VIEWER, ""),
        (Use.CALL, "/mission/pause", OPERATOR, ""),
    ],
)
def test_roles(catalog: Catalog, use: Use, name: str, who: Visitor, text: str) -> None:
    """By topic, service and action; what nobody declares is closed to all."""
    assert AllowList(declared_access(catalog)).refusal(who, use, name) == text.format(f"/{name.lstrip('/')}")


def test_viewers_read_no_parameters() -> None:
    """What stands in one may be a password; all else that pages ask about the network is theirs."""
    allowed = AllowList([OWN_ACCESS])
    needed = {
        name: allowed.least(Use.CALL, f"/rosapi/{name}") for name in ("get_time", "topics", "get_param")
    }
    assert needed == {"get_time": UserRole.VIEWER, "topics": UserRole.VIEWER, "get_param": UserRole.OPERATOR}


def test_a_setting_opens_more() -> None:
    """Names of a site's own, with `*`; the lowest role that is given counts."""
    allowed = AllowList(
        [Access(viewer=("/camera/*",), operator=("/pump",)), Access(engineer=("/pump", "/lab/*"))]
    )
    assert allowed.refusal(VIEWER, Use.SUBSCRIBE, "/camera/front/image") == ""
    assert "not offered" in allowed.refusal(ENGINEER, Use.PUBLISH, "/camera/front/image")
    assert allowed.refusal(OPERATOR, Use.CALL, "/pump") == ""
    assert allowed.refusal(ENGINEER, Use.CALL, "/lab/a/b") == ""
    assert "needs the role engineer" in allowed.refusal(OPERATOR, Use.CALL, "/lab/a/b")


# -- limits and settings ----------------------------------------------------------------------------------


def test_a_hundred_operations_a_second() -> None:
    """A hundred at once are taken, then one each hundredth of a second."""
    allowance = Allowance()
    told = [allowance.operation(5.0) for _ in range(OPERATIONS_PER_S + 3)]
    assert set(told[:OPERATIONS_PER_S]) == {""}
    assert set(told[OPERATIONS_PER_S:]) == {"more than 100 operations a second; this one was not carried out"}
    assert allowance.operation(5.011) == ""
    assert allowance.operation(5.012) != ""
    assert allowance.operation(4.0) != ""  # a clock that goes back gives nothing
    assert [allowance.operation(60.0 + n / 100) for n in range(1000)] == [""] * 1000


def test_a_long_frame_counts_by_its_length() -> None:
    """One that may be read is carried out; what it was too much is made up for before the next one."""
    allowance = Allowance()
    assert [allowance.long_frame(LONGEST_FRAME, 5.0), allowance.operation(5.0)] == ["", ""]
    assert allowance.operation(5.0) != ""
    assert [allowance.long_frame(LONGEST_FRAME, 5.02), allowance.operation(5.02)] == ["", ""]
    assert allowance.long_frame(LONGEST_FRAME, 5.9) != ""
    assert allowance.operation(5.9) != ""
    assert allowance.operation(6.1) == ""


def test_frames_and_subscriptions() -> None:
    """One more than the limit is one too many, and says what to do."""
    allowance = Allowance()
    assert allowance.frame(LONGEST_FRAME) == ""
    told = allowance.frame(LONGEST_FRAME + 1)
    assert told == "the frame has 1000001 bytes, at most 1000000 are taken; nothing of it was carried out"
    assert allowance.subscription(MOST_SUBSCRIPTIONS - 1) == ""
    told = allowance.subscription(MOST_SUBSCRIPTIONS)
    assert told == "a client has at most 64 subscriptions; unsubscribe from something first"


def test_an_open_gateway_needs_files(tmp_path: Path, file: Path) -> None:
    """All that is missing, with what it is for."""
    assert list(open_problems("", "", "")) == [
        "an open gateway needs tls_certificate: the certificate of this machine (PEM)",
        "an open gateway needs tls_key: its key (PEM)",
        "an open gateway needs tokens: who may come in: lines of NAME ROLE EXPIRES TOKEN, mode 600",
    ]
    assert list(open_problems(str(file), str(tmp_path / "key"), str(file))) == [
        f"tls_key: there is no file {tmp_path / 'key'}; it is its key (PEM)"
    ]
