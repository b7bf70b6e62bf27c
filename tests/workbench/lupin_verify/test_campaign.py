"""Campaigns: the same for a seed on every machine, what is violated as a small scenario, no seed lost."""

from __future__ import annotations

import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, ClassVar

import pytest

from lupin_cli.main import main
from lupin_engine.errors import ChartError, LupinError
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.contract import Operation
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.plugin.types import BOOL, NUMBER, within
from lupin_engine.properties.built_in import BUILT_IN, STANDSTILL, WatchPlans
from lupin_engine.runtime import engine
from lupin_engine.sim.scenario import Missions, load_scenario, load_scenario_text
from lupin_engine.sim.scripted import AnyOf, MockOutcome
from lupin_engine.sim.simulation import SetValue
from lupin_verify import minimise
from lupin_verify.campaign import Campaign, CampaignSum
from lupin_verify.dealing import (
    BATCH,
    CampaignTask,
    Dealer,
    WorkerProcesses,
    make_task,
    run_batch,
    run_seeds,
)
from lupin_verify.minimise import Minimiser
from lupin_verify.rates import default_rates, default_rules, read_rates
from tests import shipped
from tests.lupin_engine.machine.charts import OPERATIONS, chart

#: Properties that are broken, each because of another field of a step.
BROKEN = """\
  p_accepted: {never: this_step.accepted == 'mission.start' and in_state('MISSION')}
  p_refused: {never: this_step.refused == 'mission.start'}
  p_begun: {never: in_state('MISSION') and len(this_step.begun) > 0 and 'nav.go_to' in this_step.begun}
  p_succeeded: {never: "'nav.dock' in this_step.succeeded"}
  p_failed: {never: "'nav.go_to' in this_step.failed or len(this_step.failed) > 0"}
  p_released: {never: len(this_step.released) > 0 and not held(pause)}
  p_codes: {never: len(this_step.codes) > 0 and in_state('MISSION')}
  p_nothing: {never: this_step.accepted == '' and len(this_step.codes) == 0 and not in_state('MISSION')}
"""
RATES = """\
campaign: a short and rough day
limit: 10 min
targets: {between: [1, 3]}
mocks:
  - do: nav.go_to
    then: {any_of: [{weight: 80 %, after: {between: [1 s, 9 s]}}, {weight: 20 %, fail: nav_status_6}]}
chance:
  - every: 5 min
    do: [{value: {estop: true}}, {after: {between: [1 s, 20 s]}, value: {estop: false}}]
  - {every: 2 min, do: [{request: operator.resume}]}
  - {every: 4 min, do: [{request: operator.abort}]}
"""
#: A mission with a binding, of the guide for bindings.
SPRAYER = Path(__file__).parents[3] / "docs" / "sprayer"
#: Frontiers are found and reached at once.
STILL = """\
campaign: servers that take no time
limit: 10 min
mocks:
  - {do: nav.choose_frontier, then: {after: 0 s}}
  - {do: nav.go_to, then: {after: 0 s}}
"""


@pytest.mark.slow
def test_what_a_step_cannot_break_is_not_asked(tmp_path: Path) -> None:
    """Runs are judged the same as if every property was asked after each step."""
    folder = shutil.copytree(default_missions_folder(), tmp_path / "missions")
    lifecycle = folder / "lifecycle.yaml"
    text = re.sub(r"^(properties:.*\n)", rf"\g<1>{BROKEN}", lifecycle.read_text("utf-8"), flags=re.MULTILINE)
    lifecycle.write_text(text, "utf-8")
    loaded = load_missions([str(folder / "inspection.yaml")], load_catalog())
    campaign, found, asked = Campaign(loaded, default_rates(loaded.chart), {}), CampaignSum(), CampaignSum()
    for seed in range(3):
        campaign.run(seed, found)
    assert all(len(plan.asked) < len(campaign.properties) for plan in campaign.plans.values())
    campaign.plans = WatchPlans(tuple(replace(one, is_asked=lambda _: True) for one in campaign.properties))
    for seed in range(3):
        campaign.run(seed, asked)
    assert vars(found) == vars(asked)
    assert {*found.violated} >= {*re.findall(r"p_\w+", BROKEN)}


def made(folder: Path, text: str = RATES) -> Campaign:
    """Return a campaign of the inspection mission with rates."""
    file = folder / "rates.yaml"
    file.write_text(text, encoding="utf-8")
    loaded = load_missions(["inspection"], shipped.catalog())
    return Campaign(loaded, read_rates(file, loaded.chart), {})


def facts(found: CampaignSum) -> dict[str, Any]:
    """Return what must be the same however it was run."""
    return {**vars(found), "processor": 0.0, "seconds": round(found.seconds, 6)}


def test_a_seed_is_the_same_wherever_it_is_run(tmp_path: Path) -> None:
    """Here, as a worker runs it from the bytes of the files, and in another order."""
    campaign = made(tmp_path)
    here = run_seeds(campaign, range(6))
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    there = CampaignSum()
    for batch in (range(4, 6), range(4)):
        there.add(run_batch(task, batch))
    assert facts(here) == facts(there)
    assert here.missions > 6
    assert here.violated == {}
    assert {len(rule) > 0 for rule in here.transitions} == {True}


def test_a_setting_may_be_a_list(tmp_path: Path) -> None:
    """For workers as for this process."""
    loaded, given = made(tmp_path).loaded, {"tag_sequence": ["1", "2"]}
    campaign = Campaign(loaded, default_rates(loaded.chart), given)
    assert facts(run_batch(make_task(loaded, None, given), range(1))) == facts(run_seeds(campaign, range(1)))


def test_a_worker_with_other_files_is_told(tmp_path: Path) -> None:
    """The hash is that of the mission's files."""
    task = make_task(made(tmp_path).loaded, tmp_path / "rates.yaml", {})
    other = CampaignTask(
        "0" * 64, task.folder, task.lifecycle, task.mission, task.files, task.rates, task.rates_file
    )
    with pytest.raises(Exception, match="a worker reads another mission than 000000000000: "):
        run_batch(other, range(1))


class KilledOnce:
    """Executors of processes, of which the first loses a worker after its first batch."""

    def __init__(self) -> None:
        self.made: list[ProcessPoolExecutor] = []

    def __call__(self) -> Executor:
        """Return another one."""
        self.made.append(ProcessPoolExecutor(2, get_context("spawn")))
        if len(self.made) == 1:
            self.made[0].submit(os.getpid).result()
        return self.made[-1]

    def kill(self, _: CampaignSum) -> None:
        """Kill a process of the first executor, once."""
        processes = list(self.made[0]._processes.values()) if len(self.made) == 1 else []
        if processes and processes[0].is_alive():
            os.kill(processes[0].pid or 0, signal.SIGKILL)


@pytest.mark.long
def test_a_worker_that_is_killed_loses_no_seed(tmp_path: Path) -> None:
    """What was under way is dealt out again, and the sum is what one process finds."""
    campaign = made(tmp_path, RATES.replace("10 min", "1 min"))
    killer = KilledOnce()
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    dealer = Dealer(campaign, 5 * BATCH, killer.kill, killer, 2, task)
    found = dealer.run()
    assert (len(killer.made) > 1, dealer.lost > 0, found.seeds) == (True, True, 5 * BATCH)
    assert facts(found) == facts(run_seeds(campaign, range(5 * BATCH)))


@pytest.mark.slow
def test_an_interruption_ends_the_workers_at_once(tmp_path: Path) -> None:
    """What came back is kept; nobody waits for what is under way."""
    campaign = made(tmp_path, RATES.replace("10 min", "30 min"))
    made_here: list[WorkerProcesses] = []

    def processes() -> Executor:
        made_here.append(WorkerProcesses(2))
        return made_here[0]

    def interrupt(_: CampaignSum) -> None:
        working.extend((made_here[0]._processes or {}).values())
        raise KeyboardInterrupt

    working: list[Any] = []
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    dealer = Dealer(campaign, 50 * BATCH, interrupt, processes, 2, task)
    with pytest.raises(KeyboardInterrupt):
        dealer.run()
    for process in working:
        process.join(20.0)
    # The executor's own thread waits for them, too: one of the two is told that there is no such child.
    alive = [process.pid for process in working if Path(f"/proc/{process.pid}").exists()]
    assert (len(working), alive) == (2, [])
    assert dealer.found.seeds == BATCH


class Breaks(Executor):
    """An executor whose workers all die."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        """Return what has failed already."""
        future: Future[Any] = Future()
        future.set_exception(BrokenProcessPool("gone"))
        return future


#: Makes a worker, tells which process that is, and waits.
WAITS = """\
import os, sys
from lupin_verify.dealing import WorkerProcesses
if __name__ == "__main__":
    pool = WorkerProcesses(1)
    print(pool.submit(os.getpid).result(), flush=True)
    sys.stdin.read()
"""


def test_workers_end_with_the_process_that_began_them(tmp_path: Path) -> None:
    """However that ends: nobody else would end them."""
    (tmp_path / "waits.py").write_text(WAITS, encoding="utf-8")
    command = [sys.executable, str(tmp_path / "waits.py")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        worker = os.pidfd_open(int(process.stdout.readline()))
        process.kill()
    assert select.select([worker], [], [], 20.0)[0] == [worker], "it has ended"
    os.close(worker)


class RefusesOnce(ThreadPoolExecutor):
    """An executor that is broken when something more is submitted; the next one is not."""

    refused: ClassVar[list[int]] = []

    def submit(self, *asked: Any, **more: Any) -> Future[Any]:
        """Submit something, or refuse it."""
        self.refused.append(len(self.refused))
        if len(self.refused) == 2:
            raise BrokenExecutor
        return super().submit(*asked, **more)


@pytest.mark.slow
def test_an_executor_that_breaks_between_two_batches_loses_no_seed(tmp_path: Path) -> None:
    """What was under way, and what it did not take, is dealt out again."""
    campaign = made(tmp_path)
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    dealer = Dealer(campaign, 3 * BATCH, executors=lambda: RefusesOnce(1), workers=1, task=task)
    assert dealer.run().seeds == 3 * BATCH
    assert dealer.lost == 2


def test_seeds_that_end_every_worker_are_told(tmp_path: Path) -> None:
    """Not for ever."""
    campaign = made(tmp_path)
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    dealer = Dealer(campaign, 10, executors=Breaks, workers=1, task=task)
    with pytest.raises(Exception, match="the seeds 0 to 9 end every worker"):
        dealer.run()


@pytest.mark.slow
def test_what_is_violated_becomes_a_small_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which fails by the same property, and holds without the defect; what never happened is not in it."""
    more = "defaults: false\nwhen:\n  - {on: DONE, nth: 50, request: operator.pause}\n"
    campaign = made(tmp_path, RATES + more)
    with monkeypatch.context() as defect:
        defect.setattr(Itineraries, "close_rest", lambda *_: None)
        found = run_seeds(campaign, range(10))
        violation = found.first["all_closed"]
        file, missions = tmp_path / "all_closed.scenario.yaml", Missions(shipped.catalog())
        minimiser = Minimiser("all_closed", "All.", file, campaign.loaded.files[0], missions)
        read: list[str] = []
        defect.setattr(
            minimise, "load_scenario_text", lambda *of: read.append(of[0]) or load_scenario_text(*of)
        )
        text = minimiser.text(campaign.recorded(violation), campaign.script(violation.seed))
        assert len(read) == 2, "what was recorded, and what is written"
        assert minimiser.tries > 20
        file.write_text(text, encoding="utf-8")
        scenario = load_scenario(file, shipped.catalog())
        failed = [one.what for one in scenario.failures(scenario.run())]
    assert failed == ["violated: all_closed"]
    assert len(text.splitlines()) < 12
    assert "{do: nav.localize, then: [done, {accepted: never}]}" in text
    again = load_scenario(file, shipped.catalog())
    assert again.failures(again.run()) == []


def test_a_circle_without_time_becomes_a_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what the servers of the circle say each time; `lupin test` tells of it, and ends."""
    monkeypatch.setattr(engine, "MOST_AT_ONCE", 500)
    rates, catalog = tmp_path / "rates.yaml", shipped.catalog()
    rates.write_text(STILL, encoding="utf-8")
    loaded = load_missions(["exploration"], catalog)
    campaign = Campaign(loaded, read_rates(rates, loaded.chart), {})
    violation = run_seeds(campaign, range(1)).first[STANDSTILL]
    file = tmp_path / "still.scenario.yaml"
    minimiser = Minimiser(STANDSTILL, "Time goes on.", file, loaded.files[0], Missions(catalog))
    text = minimiser.text(campaign.recorded(violation), campaign.script(violation.seed))
    file.write_text(text, encoding="utf-8")
    assert text == (
        "scenario: Time goes on.\n"
        "mission: exploration\n"
        "mocks:\n"
        "  - {do: nav.choose_frontier, then: {after: 0 s}}\n"
        "  - {do: nav.go_to, then: {after: 0 s}}\n"
        "expect: {}\n"
    )
    scenario = load_scenario(file, catalog)
    (failed,) = scenario.failures(scenario.run())
    assert failed.what == "violated: time_goes_on"
    assert failed.actual == (
        "time stands still: more than 500 things happen at one moment;"
        " nav.choose_frontier, nav.go_to begin and end over and over, so let one of them take time"
    )


def test_rates_are_checked_like_everything(tmp_path: Path) -> None:
    """All at once, each with its place."""
    wrong = (
        RATES.replace("[1, 3]", "[3, 1]")
        .replace("nav_status_6", "nav_staus_6")
        .replace("every: 5 min", "every: 5")
        .replace("estop: true", "estp: true")
        .replace(
            "{every: 4 min, do: [{request: operator.abort}]}", "{every: 4 min, do: [{at: 3 s, request: x}]}"
        )
        + "  - {every: 4 min, do: [{after: 3 s}]}\n  - {every: 4 min, do: [{value: {estp: true}}]}\n"
    )
    with pytest.raises(ChartError) as caught:
        made(tmp_path, wrong)
    assert str(caught.value).replace(f"{tmp_path}/rates.yaml:", "").splitlines() == [
        "3:10: error: targets: expected how many targets, from 1 on; write 'targets: 5' or "
        "'targets: {between: [1, 29]}' [wrong-shape]",
        "6:88: error: nav.go_to: unknown code 'nav_staus_6'; did you mean 'nav_status_6'? [undeclared-code]",
        "8:12: error: every: a duration needs a unit, got 5; write '5 s' [no-unit]",
        "9:19: error: when.value: unknown value 'estp'; did you mean 'estop'? [unknown-value]",
        "11:25: error: chance.do: what happens by chance has 'after' and nothing else to say when; write it "
        "under 'when', or leave it out [wrong-shape]",
        "11:44: error: when: unknown request 'x'; allowed: 'mission.start', 'operator.abort', "
        "'operator.dock', 'operator.pause', 'operator.reset', 'operator.resume', 'operator.skip_current' "
        "[unknown-event]",
        "12:5: error: chance.do: nothing happens; say request, value, event, restart or server_gone "
        "[wrong-shape]",
        "13:34: error: when.value: unknown value 'estp'; did you mean 'estop'? [unknown-value]",
    ]


def test_the_page_says_what_is_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every property is on it, its rates can be drawn from, its scenario fails with the defect planted."""
    page = (Path(__file__).parents[3] / "docs" / "proof.md").read_text(encoding="utf-8")
    assert [one.name for one in BUILT_IN if f"`{one.name}`" not in page] == []
    blocks = re.findall(r"```yaml[^\n]*\n(.*?)```", page, re.DOTALL)
    (rates,) = [block for block in blocks if block.startswith("campaign:")]
    assert made(tmp_path, rates).rates.targets == (1, 29)
    (scenario,) = [block for block in blocks if block.startswith("scenario:")]
    file = tmp_path / "one.scenario.yaml"
    file.write_text(scenario, encoding="utf-8")
    loaded = load_scenario(file, shipped.catalog())
    assert loaded.failures(loaded.run()) == []
    monkeypatch.setattr(Itineraries, "close_rest", lambda *_: None)
    assert [one.what for one in loaded.failures(loaded.run())] == ["violated: all_closed"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["inspection", "exploration"])
def test_the_shipped_missions_keep_all_properties(name: str) -> None:
    """In worlds of their own, with restarts; all but two are looked at: they have no invariants, and the
    itinerary of the exploration leaves targets open on purpose.
    """
    loaded = load_missions([name], shipped.catalog())
    file = Path(__file__).parents[2] / "campaigns" / f"{name}.yaml"
    campaign = Campaign(loaded, read_rates(file, loaded.chart), {})
    found = run_seeds(campaign, range(2))
    assert found.first == {}
    assert {one.name for one in BUILT_IN} - found.relevant.keys() <= {"invariants", "all_closed"}


def test_the_verb_tells_what_was_looked_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And what was never taken, and when it stopped finding."""
    (tmp_path / "rates.yaml").write_text(RATES, encoding="utf-8")
    rates = str(tmp_path / "rates.yaml")
    assert main(["campaign", "inspection", "--seeds", "3", "--jobs", "1", "--rates", rates]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["property", "looked", "at", "violated", "by"]
    assert "    never: FAULT.AGAIN.after.0 (" in "\n".join(lines)
    assert lines[-2].startswith("pairs of transitions: ")
    assert lines[-1].startswith("3 seeds, ")


def test_an_interruption_while_scenarios_are_written_tells_what_was_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All seeds have been run by then."""

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Itineraries, "close_rest", lambda *_: None)
    monkeypatch.setattr(Minimiser, "text", interrupted)
    (tmp_path / "rates.yaml").write_text(RATES, encoding="utf-8")
    rates = str(tmp_path / "rates.yaml")
    command = ["campaign", "inspection", "--seeds", "10", "--jobs", "1", "--rates", rates]
    assert main([*command, "--out", str(tmp_path)]) == 130
    told = capsys.readouterr().out
    assert "all_closed is violated at " in told
    assert told.endswith("interrupted while scenarios were made smaller; not all of them were written\n")
    assert main([*command, "--json"]) == 130
    record = json.loads(capsys.readouterr().out)
    assert (record["seeds"], record["interrupted"]) == (10, True)
    assert [(one["scenario"], one["why_none"]) for one in record["violated"]] == [(None, "interrupted")]
    watched = {one["name"]: one["looked_at"] for one in record["properties"]}
    assert watched[STANDSTILL] == record["steps"]


def test_what_came_back_is_told_before_an_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cluster may go in the middle of a campaign."""

    def gone(dealer: Dealer) -> None:
        dealer.found.seeds = 20
        raise LupinError("the Dask scheduler at tcp://host:1 does not answer any more")

    monkeypatch.setattr(Dealer, "_run", gone)
    assert main(["campaign", "inspection", "--quiet"]) == 2
    told = capsys.readouterr()
    assert told.out.startswith("20 seeds, 0 missions, ")
    assert told.err == "lupin: the Dask scheduler at tcp://host:1 does not answer any more\n"


def test_a_campaign_without_a_mission_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mission that is refused, or not asked for, shows nothing."""
    (tmp_path / "rates.yaml").write_text("campaign: none\nlimit: 0 s\n", encoding="utf-8")
    command = ["campaign", "inspection", "--seeds", "2", "--jobs", "1"]
    assert main([*command, "--rates", str(tmp_path / "rates.yaml")]) == 2
    assert capsys.readouterr().err == (
        "lupin: in 2 seeds no mission began: nothing asked for one within the limit;"
        " give it a longer 'limit', or look at 'when'\n"
    )
    assert main([*command, "--set", "tag_sequence=9999"]) == 2
    assert (
        "in 2 seeds no mission began: mission.start was refused: unknown tag '9999'"
        in capsys.readouterr().err
    )


@pytest.mark.slow
def test_wrong_use_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that is not there, a setting that does not exist, a cluster that does not answer."""
    given = ["campaign", "inspection", "--rates", str(tmp_path / "no.yaml"), "--set", "nav_timeout=3 s"]
    assert main(given) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"lupin: no file '{tmp_path}/no.yaml'; without --rates everything goes wrong now and then",
        "--set: unknown parameter 'nav_timeout'; did you mean 'nav_timeout_s'?",
    ]
    assert main(["campaign", "inspection", "--out", "/proc/none"]) == 2
    told = "lupin: --out: cannot make the folder '/proc/none': No such file or directory\n"
    assert capsys.readouterr().err == told
    assert main(["campaign", "inspection", "--cluster", "host:8786"]) == 2
    told = "lupin: --cluster: 'host:8786' is no address of a Dask scheduler; write tcp://HOST:PORT\n"
    assert capsys.readouterr().err == told
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    monkeypatch.setattr("lupin_cli.verbs.campaign.SCHEDULER_S", 0.5)
    assert main(["campaign", "inspection", "--cluster", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9': " in capsys.readouterr().err
    assert default_rates(shipped.mission("inspection")).targets is None


def test_a_mission_with_errors_is_not_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, as for wrong use: 1 would mean that something is violated."""
    shutil.copy(Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml", tmp_path)
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("mission: Wrong\ninitial: A\nstates: {}\n", encoding="utf-8")
    assert main(["campaign", str(wrong), "--seeds", "1", "--jobs", "1"]) == 2
    assert f"{wrong}:2:10: error: MISSION.Wrong.initial: " in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.timeout(400)
def test_a_cluster_that_loses_a_worker_loses_no_seed(tmp_path: Path) -> None:
    """Four worker processes of a real Dask cluster, one of them killed in the middle."""
    distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    campaign = made(tmp_path, RATES.replace("10 min", "1 min"))
    task = make_task(campaign.loaded, tmp_path / "rates.yaml", {})
    with (
        distributed.LocalCluster(
            n_workers=4, threads_per_worker=1, dashboard_address=None, processes=True
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(4)
        pids = list(client.run(os.getpid).values())
        killed: list[int] = []

        def kill(_: CampaignSum) -> None:
            if not killed:
                killed.append(pids[0])
                os.kill(pids[0], signal.SIGKILL)

        dealer = Dealer(campaign, 12 * BATCH, kill, client.get_executor, len(pids), task)
        found = dealer.run()
    assert (len(set(pids)), killed, found.seeds) == (4, pids[:1], 12 * BATCH)
    assert facts(found) == facts(run_seeds(campaign, range(12 * BATCH)))


def test_results_vary_without_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an operation that says yes or no, or a number within a range, each is drawn now and then."""
    declared = {"seen": BOOL, "level": within(NUMBER, 0.0, 2.0)}
    monkeypatch.setitem(OPERATIONS, "arm.look", Operation("look", result=declared))
    (rule,) = default_rules(chart({"A": {"invoke": "arm.look", "on_done": "B", "on_error": "B"}, "B": {}}))
    drawn = rule.outcomes[0]
    assert isinstance(drawn, AnyOf)
    assert drawn.weights[-1] / sum(drawn.weights) > 0.2
    varied = drawn.outcomes[-1]
    assert isinstance(varied, AnyOf)
    assert [dict(one.result) for one in varied.outcomes if isinstance(one, MockOutcome)] == [
        {"seen": False},
        {"seen": True},
        {"level": 0.0},
        {"level": 2.0},
    ]


def test_live_values_are_drawn_from_their_classes() -> None:
    """Without a file: lists of every length, and what is known for a while so often that it is known."""
    exploration = load_missions(["exploration"], shipped.catalog())
    campaign = Campaign(exploration, default_rates(exploration.chart), {})
    every = [(one.every, effect) for one in campaign.rates.chances for _, effect in one.effects]
    told = [(t, len(e.is_now)) for t, e in every if isinstance(e, SetValue) and e.value == "tags.discovered"]
    assert told == [(2100.0, count) for count in range(7)]
    taken = run_seeds(campaign, range(2)).transitions
    assert "MISSION.ExplorationMission.MONITORING.SCANNING.READING.on_done.0" in taken


@pytest.mark.slow
def test_events_of_plugins_come_without_a_file(tmp_path: Path) -> None:
    """The half of a mission that only an event leads to is tried, and a file of rates adds to that."""
    loaded = load_missions([str(SPRAYER / "spray.yaml")], shipped.catalog())
    file = tmp_path / "rates.yaml"
    pauses = "chance: [{every: 1 min, do: [{request: operator.pause}]}]"
    file.write_text(f"campaign: as ever, and more pauses\n{pauses}\n")
    for rates in (default_rates(loaded.chart), read_rates(file, loaded.chart)):
        campaign = Campaign(loaded, rates, {})
        found = run_seeds(campaign, range(5))
        assert "MISSION.SprayMission.SPRAYING.on.sprayer.leak.0" in found.transitions
        assert "MISSION.SprayMission.SPRAYING" in found.states
    file.write_text("campaign: nothing but the clock\ndefaults: false\n")
    campaign = Campaign(loaded, read_rates(file, loaded.chart), {})
    assert not any("leak" in rule for rule in run_seeds(campaign, range(5)).transitions)


@pytest.mark.slow
def test_a_violation_of_a_mission_with_a_binding_becomes_a_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The binding stands beside the mission, and is read again for the scenario: once, not beside itself."""
    folder = tmp_path / "missions"
    shutil.copytree(SPRAYER, folder)
    shutil.copy(SPRAYER / "lupin.yaml", tmp_path)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", folder)
    mission = folder / "spray.yaml"
    never = "properties:\n  dry: {never: in_state('RINSING'), summary: no rinsing}\n"
    mission.write_text(mission.read_text() + never)
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", str(mission), "--seeds", "3", "--jobs", "1"]) == 1
    assert "dry is violated" in capsys.readouterr().out
    (written,) = tmp_path.glob("dry_*.scenario.yaml")
    assert main(["test", str(written)]) == 1
    assert "violated: dry" in capsys.readouterr().out
