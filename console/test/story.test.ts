// The log and the timeline: what is told of a step, and how long attempts, holds and silences lasted.
import assert from "node:assert/strict";
import { test } from "node:test";
import { HOLDS, LIFECYCLE, OPERATION, StepStory } from "../src/model/story/story";
import { en } from "../src/texts/en";
import type { StepRecord } from "../src/records";
import { attemptOf, recordOf, T0 } from "./told";

const GO = `${OPERATION}nav.go_to`;
const start = { command: "start", attempt: "a-1", operation: "nav.go_to", arguments: { tag: "T3" }, state: "MISSION.GO", tries: 1, updates: "" } as const;

function read(...records: StepRecord[]): StepStory {
  const story = new StepStory(en.log, (lifecycle) => lifecycle === "FAULT");
  for (const value of records) story.read({ at: value.wall_ns / 1e6, value });
  return story;
}

/** The spans of a row, in seconds after `T0`. */
function spans(story: StepStory, row: string) {
  const seconds = (at: number): number => (at - T0) / 1000;
  return story.rows.get(row)?.map(({ from, to, text, severity }) => [seconds(from), to === undefined ? undefined : seconds(to), text, severity]);
}

test("an attempt lasts from its start to its end, and one that failed is red", () => {
  const attempts = [attemptOf()];
  const begun = recordOf(1, { event: "mission.go", commands: [start] }, { attempts });
  const failed = { event: "attempt.failed", taken: ["MISSION.GO.on.error"], data: { attempt: "a-1", code: "nav_timeout", detail: "no way" } };
  const story = read(begun, recordOf(2, {}, { attempts }), recordOf(5, failed));
  assert.deepEqual(spans(story, GO), [[1, 5, "nav.go_to T3", 2]]);
  assert.equal(story.entries.at(-1)?.text, "nav.go_to failed: nav_timeout no way");
  assert.equal(story.entries.at(-1)?.severity, 1);
});

test("an operation that is updated lasts from its first goal to the end of the last one", () => {
  const attempts = [attemptOf()];
  const begun = recordOf(1, { commands: [start] }, { attempts });
  const updated = recordOf(2, { event: "timer.update", data: { owner: "a-1" }, commands: [{ ...start, attempt: "a-2", updates: "a-1" }] }, { attempts });
  const replaced = recordOf(2.1, { event: "attempt.failed", data: { attempt: "a-1", code: "nav_status_6" } }, { attempts });
  const story = read(begun, updated, replaced, recordOf(4, { event: "attempt.done", data: { attempt: "a-2" } }));
  assert.deepEqual(spans(story, GO), [[1, 4, "nav.go_to T3", 0]]);
  assert.equal(story.entries.find(({ text }) => text.startsWith("time for an update"))?.text, "time for an update: nav.go_to");
});

test("an attempt that is done is well; one that is nowhere any more has ended unseen", () => {
  const attempts = [attemptOf()];
  const begun = recordOf(1, { commands: [start] }, { attempts });
  const done = recordOf(4, { event: "attempt.done", data: { attempt: "a-1" } });
  assert.deepEqual(spans(read(begun, done), GO), [[1, 4, "nav.go_to T3", 0]]);
  assert.deepEqual(spans(read(begun, recordOf(3)), GO), [[1, 3, "nav.go_to T3", 1]]);
});

test("what is being cancelled still runs", () => {
  const begun = recordOf(1, { commands: [start] }, { attempts: [attemptOf()] });
  const left = recordOf(2, { commands: [{ command: "cancel", attempt: "a-1", operation: "nav.go_to" }] }, { cancelling: ["nav.go_to"] });
  assert.deepEqual(spans(read(begun, left), GO), [[1, undefined, "nav.go_to T3", 0]]);
  const ended = recordOf(6, { event: "attempt.cancelled", data: { attempt: "a-1" } });
  assert.deepEqual(spans(read(begun, left, ended), GO), [[1, 6, "nav.go_to T3", 0]]);
});

test("a refused command is told as that, with who asked and why not", () => {
  const refusal = { code: "not_running", text: "no mission is running" };
  const story = read(recordOf(1, { event: "operator.pause", accepted: false, refusal, why: ["x"] }, {}, { command: { by: "anna" } }));
  const [entry] = story.entries;
  assert.equal(entry?.text, "pause REFUSED: no mission is running (anna)");
  assert.deepEqual([entry?.kind, entry?.severity, entry?.notes], ["command", 1, []]);
  assert.equal(read(recordOf(1, { event: "operator.pause", accepted: true })).entries[0]?.text, "pause accepted");
});

test("a hold lasts until it is released, in the words of its code", () => {
  const holds = { estop: "e-stop engaged" };
  const story = read(recordOf(1), recordOf(2, {}, { held: ["estop"], holds }), recordOf(3, {}, { held: ["estop"], holds }), recordOf(7));
  assert.deepEqual(spans(story, HOLDS), [[2, 7, "e-stop engaged", 1]]);
  const told = story.entries.filter(({ kind }) => kind === "hold").map(({ text }) => text);
  assert.deepEqual(told, ["held: e-stop engaged", "no longer held: e-stop engaged"]);
});

test("an orchestrator that was started anew leaves a gap, and nothing goes on across it", () => {
  const attempts = [attemptOf()];
  const before = recordOf(1, { commands: [start] }, { attempts, held: ["pause"], holds: { pause: "paused" } });
  const story = read(before, recordOf(9, {}, { lifecycle: "READY" }, { boot: "two" }));
  assert.deepEqual(story.gaps, [{ from: T0 + 1000, to: T0 + 9000, text: en.log.newBoot, severity: 2 }]);
  assert.deepEqual(spans(story, GO), [[1, 1, "nav.go_to T3", 0]]);
  assert.deepEqual(spans(story, HOLDS), [[1, 1, "paused", 1]]);
  assert.deepEqual(story.entries.filter(({ kind }) => kind === "hold").map(({ text }) => text), ["held: paused"]);
  assert.deepEqual(spans(story, LIFECYCLE), [[1, 1, "MISSION", 0], [9, undefined, "READY", 0]]);
});

test("a fault is red on the timeline, and its codes are told once", () => {
  const code = { code: "nav_timeout", label: "navigation timed out", severity: 2, detail: "no way to T3", target: "T3" };
  const story = read(recordOf(1, { entered: ["FAULT"], configuration: ["FAULT"], codes: [code], notes: ["no way to T3"] }, { lifecycle: "FAULT" }));
  assert.deepEqual(spans(story, LIFECYCLE), [[1, undefined, "FAULT", 2]]);
  assert.deepEqual(story.entries.map(({ severity, text, notes }) => [severity, text, notes]), [
    [0, "something", []],
    [2, "navigation timed out: no way to T3", ["nav_timeout"]],
  ]);
});

test("a question is told once, as long as it stands", () => {
  const asking = [{ state: "ASKS", question: "Again?", choices: [], default: "no", deadline: 9, left: null }];
  const story = read(recordOf(1, {}, { asking }), recordOf(2, {}, { asking: [...asking] }));
  assert.deepEqual(story.entries.filter(({ kind }) => kind === "question").map(({ text }) => text), ["Again?"]);
});
