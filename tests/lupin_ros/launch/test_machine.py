"""What is read off this machine, with made-up tables of the kernel: shared memory, ports, processes."""

from __future__ import annotations

import errno
import os
import signal
from pathlib import Path

import pytest

from lupin_cli import run_folders
from lupin_engine.errors import UsageError
from lupin_ros.adapter.dds.ports import participants
from lupin_ros.launch import shared_memory
from lupin_ros.launch.environment import close_the_doors, current_domain, is_local_only
from lupin_ros.launch.health import running_nodes
from lupin_ros.launch.interrupts import Interrupts

#: A process that there cannot be.
NOBODY = 2**31 - 1


@pytest.fixture
def machine(tmp_path: Path) -> tuple[Path, Path]:
    """Shared memory with two segments and their companions, and a process that maps the first."""
    memory, processes = tmp_path / "shm", tmp_path / "proc"
    memory.mkdir()
    for name in ("fastrtps_aa", "fastrtps_aa_el", "fastdds_bb", "sem.fastdds_bb_mutex", "other"):
        (memory / name).touch()
    (processes / "7").mkdir(parents=True)
    (processes / "7" / "maps").write_text(
        "7f00-7f01 rw-s 0 00:19 5   /dev/shm/fastrtps_aa\n7f02 r-xp /lib/x.so\n"
    )
    (processes / "self").mkdir()
    return memory, processes


def test_a_segment_that_nobody_maps_is_stale(machine: tuple[Path, Path]) -> None:
    """With what belongs to it; other programs' memory is not looked at."""
    memory, processes = machine
    stale = [file.name for file in shared_memory.stale_segments(memory, processes)]
    assert stale == ["fastdds_bb", "sem.fastdds_bb_mutex"]
    assert shared_memory.segments_of(7, processes) == {"fastrtps_aa"}
    assert shared_memory.segments_of(8, processes) == set()


def test_only_what_is_stale_is_removed(machine: tuple[Path, Path]) -> None:
    """A port that a dead process shared with a living one stays."""
    memory, processes = machine
    gone = shared_memory.remove({"fastrtps_aa", "fastdds_bb"}, memory, processes)
    assert gone == ["fastdds_bb", "sem.fastdds_bb_mutex"]
    assert (memory / "fastrtps_aa_el").exists()


def table(path: Path, *ports: int) -> Path:
    head = "  sl  local_address rem_address   st tx_queue\n"
    rows = [f"   {n}: 00000000:{port:04X} 00000000:0000 07\n" for n, port in enumerate(ports)]
    path.write_text(head + "".join(rows))
    return path


def test_participants_are_counted_by_their_ports(tmp_path: Path) -> None:
    """Two ports each; those of other domains and the shared multicast port do not count."""
    domain = 3
    base = 7400 + 250 * domain
    found = table(tmp_path / "udp", base, base + 1, base + 10, base + 11, base + 12, base + 13, 7410, 5353)
    assert participants(domain, [found, tmp_path / "absent"]) == 2
    assert participants(0, [found]) == 1
    assert participants(9, [found]) is None


def test_running_nodes_are_known_by_their_command(tmp_path: Path) -> None:
    """However they were started; `lupin` with another verb is none, nor one of another domain."""
    commands = {
        "12": "/v/bin/python\0-m\0lupin_cli.main\0node\0lupin_sim\0--ros-args\0",
        "13": "/v/bin/python\0/v/bin/lupin\0node\0greenhouse_bridge\0",
        "14": "/v/bin/python\0/v/bin/lupin\0run\0inspection\0",
        "15": "node\0server.js\0now\0",
        "17": "/v/bin/python\0/v/bin/lupin\0node\0elsewhere\0",
        "18": "/v/bin/python\0/v/bin/lupin\0node\0nowhere\0",
        "19": "/v/bin/python\0-m\0lupin_cli.main\0node\0lupin_arm\0lupin_twin\0--ros-args\0-p\0a:=b\0",
    }
    domains = {"12": "LANG=C\0ROS_DOMAIN_ID=5\0", "13": "ROS_DOMAIN_ID=5\0", "17": "ROS_DOMAIN_ID=6\0"}
    domains["18"], domains["19"] = "ROS_DOMAIN_ID=lab\0", "ROS_DOMAIN_ID=8\0"
    for pid, line in commands.items():
        (tmp_path / pid).mkdir()
        (tmp_path / pid / "cmdline").write_text(line)
        (tmp_path / pid / "environ").write_text(domains.get(pid, ""))
    (tmp_path / "16").mkdir()
    assert list(running_nodes(5, tmp_path)) == [(12, "lupin_sim"), (13, "greenhouse_bridge")]
    assert list(running_nodes(6, tmp_path)) == [(17, "elsewhere")]
    assert list(running_nodes(8, tmp_path)) == [(19, "lupin_arm"), (19, "lupin_twin")]
    assert list(running_nodes(0, tmp_path)) == []


def test_the_network_is_closed_unless_it_was_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """LOCALHOST where nobody said otherwise; the domain only where it was asked for."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "5")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    close_the_doors()
    assert (current_domain(), is_local_only()) == (5, True)
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    close_the_doors()
    assert is_local_only()
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    close_the_doors(7)
    assert (current_domain(), is_local_only()) == (7, False)


@pytest.mark.parametrize(
    ("variable", "value", "told"),
    [
        ("ROS_DOMAIN_ID", "lab", "ROS_DOMAIN_ID is 'lab': use a number from 0 to 101 or from 215 to 232"),
        ("ROS_DOMAIN_ID", "-1", "ROS_DOMAIN_ID is '-1': use a number from 0 to 101 or from 215 to 232"),
        ("ROS_DOMAIN_ID", "102", "ROS_DOMAIN_ID is '102': use a number from 0 to 101 or from 215 to 232"),
        (
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "HOME",
            "ROS_AUTOMATIC_DISCOVERY_RANGE is 'HOME': "
            "use one of SUBNET, LOCALHOST, SYSTEM_DEFAULT, or unset it",
        ),
        (
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "OFF",
            "ROS_AUTOMATIC_DISCOVERY_RANGE is 'OFF': nodes do not find each other: unset it",
        ),
        (
            "ROS_STATIC_PEERS",
            "robot.local",
            "ROS_STATIC_PEERS is 'robot.local': nodes stay on this machine: "
            "set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET to reach them, or unset it",
        ),
    ],
)
def test_a_network_in_which_nodes_would_not_meet_is_refused(
    monkeypatch: pytest.MonkeyPatch, variable: str, value: str, told: str
) -> None:
    """Before anything waits for somebody in vain; what `--domain` says goes before the shell's."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv(variable, value)
    with pytest.raises(UsageError) as caught:
        close_the_doors()
    assert str(caught.value) == told


def test_a_hangup_that_is_ignored_stays_ignored() -> None:
    """`nohup lupin up` goes on when its terminal is closed; else that is a signal as any other."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupts() as interrupts:
            signal.raise_signal(signal.SIGHUP)
            assert interrupts.count == 0
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        with Interrupts() as interrupts:
            signal.raise_signal(signal.SIGHUP)
            assert (interrupts.count, interrupts.at_leisure) == (1, False)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_full_disk_is_told_with_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Before any node is started."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def full(folder: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))

    run_folders.state_folder("runs")
    monkeypatch.setattr(run_folders, "name_of_now", lambda: "now")
    monkeypatch.setattr(Path, "mkdir", lambda folder, **_: full(folder) if folder.name == "now" else None)
    with pytest.raises(UsageError) as caught:
        run_folders.new_run_folder()
    runs = tmp_path / "lupin" / "runs"
    assert str(caught.value) == (
        f"there is no room for the logs of a run in {str(runs / 'now')!r}: No space left on device; "
        "make some, or name a folder with --log-dir"
    )


def test_logs_go_to_the_users_state_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One folder a run, of which the newest are kept; a given folder is taken as it is."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    runs = tmp_path / "lupin" / "runs"
    runs.mkdir(parents=True)
    for number in range(run_folders.KEPT_RUNS + 3):
        (runs / f"2000-01-01_00-00-{number:02d}_{NOBODY}").mkdir()
    newest = run_folders.new_run_folder()
    assert newest.parent == runs
    left = sorted(folder.name for folder in runs.iterdir())
    assert len(left) == run_folders.KEPT_RUNS
    assert left[0] == f"2000-01-01_00-00-04_{NOBODY}"
    assert run_folders.new_run_folder(tmp_path / "mine") == tmp_path / "mine"


def test_logs_of_nodes_that_still_run_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """However many runs there were since: a node that is started again would not find its folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    runs = run_folders.state_folder("runs")
    mine = runs / f"2000-01-01_00-00-00_{os.getpid()}"
    inits = runs / "2000-01-01_00-00-00_1"
    for folder in (mine, inits, *(runs / f"2001-01-01_00-00-{n:02d}_{NOBODY}" for n in range(50))):
        folder.mkdir()
    run_folders.new_run_folder()
    assert mine.is_dir()
    assert inits.is_dir()
    assert len(list(runs.iterdir())) == run_folders.KEPT_RUNS + 2


def test_a_folder_for_logs_that_cannot_be_is_refused(tmp_path: Path) -> None:
    """Before anything is started, in one line."""
    (tmp_path / "file").touch()
    wanted = tmp_path / "file" / "logs"
    with pytest.raises(UsageError) as caught:
        run_folders.new_run_folder(wanted)
    assert str(caught.value) == f"no logs can be written to {str(wanted)!r}: Not a directory"


def test_without_a_writable_home_there_is_a_temporary_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A robot's read-only system must not keep a run from starting."""
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(blocked))
    monkeypatch.setenv("HOME", str(blocked))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert run_folders.state_folder("runs").parent == tmp_path


def test_a_folder_that_is_set_and_cannot_be_written_to_leaves_the_one_below_the_home(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(blocked))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run_folders.state_folder("runs") == tmp_path / ".local" / "state" / "lupin" / "runs"
