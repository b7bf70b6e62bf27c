// What is counted of a span of time: missions, stops, faults, and who asked for what.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { state, steps } from "../src/model/mission/mission";
import { pressed } from "../src/model/people";
import { stops } from "../src/model/story/log";
import { shift } from "../src/model/story/shift";
import { stopsOf, T0, tell, tellState, tellStep } from "./told";

const at = (seconds: number): number => T0 + seconds * 1000;

beforeEach(() => {
  for (const { past } of [state, steps, stops]) past.clear();
  pressed.value = [];
});

test("a mission lasts until it is over, with its last counts; its state may stand afterwards", () => {
  tellState(1, { targets_total: 2, targets_completed: 0, started_at: { sec: at(0) / 1000, nanosec: 0 } });
  tellState(5, { targets_total: 2, targets_completed: 1, targets_unreachable: 1 });
  tellState(9, { lifecycle_state: "DONE", targets_total: 2, targets_completed: 1, targets_unreachable: 1 });
  tellState(20, { lifecycle_state: "READY", targets_total: 2, targets_completed: 1, targets_unreachable: 1 });
  const [run, ...others] = shift(at(-10), at(30)).missions;
  assert.deepEqual(others, []);
  assert.deepEqual([run?.began, run?.ended, run?.completed, run?.unreachable], [at(0), at(9), 1, 1]);
});

test("a mission that is under way has no end", () => {
  tellState(1, { mission_id: "m-2" });
  assert.equal(shift(at(0), at(10)).missions[0]?.ended, undefined);
});

test("a stop that began before and is still engaged is in it", () => {
  tell(stops, stopsOf("anna-1"), at(-5));
  tell(stops, stopsOf("anna-1", "ben-2"), at(1));
  assert.deepEqual(shift(at(0), at(10)).stops, [{ began: at(-5), ended: undefined, by: "anna-1" }]);
  tell(stops, stopsOf(), at(4));
  tell(stops, stopsOf("ben-2"), at(6));
  tell(stops, stopsOf(), at(7));
  assert.deepEqual(shift(at(0), at(10)).stops.map(({ began, ended }) => [began, ended]), [[at(-5), at(4)], [at(6), at(7)]]);
  assert.deepEqual(shift(at(5), at(10)).stops.length, 1);
});

test("warnings and errors are faults, information is none", () => {
  const code = { code: "c", label: "late", detail: "5 s", target: "T1" };
  tellStep(2, { codes: [{ ...code, severity: 0 }, { ...code, severity: 1 }, { ...code, severity: 2 }] });
  assert.deepEqual(shift(at(0), at(10)).faults.map(({ severity, text }) => [severity, text]), [[1, "late: 5 s"], [2, "late: 5 s"]]);
});

test("a command is told once, though the gateway has a line of it; driving by hand is not told", () => {
  tellStep(3, { event: "operator.pause", accepted: false, refusal: { code: "x", text: "not now" } }, {}, { command: { by: "anna", command_id: "id-7" } });
  const line = { wall: new Date(at(3)).toISOString(), who: "anna", page: "anna-1", name: "/mission_orchestrator/command", sent: '{"command_id": "id-7"}' };
  pressed.value = [
    { ...line, number: 1, what: "call" },
    { ...line, number: 2, what: "publish", name: "/cmd_vel", sent: "{}" },
    { ...line, number: 3, what: "call", name: "/twin/reset", sent: "{}", answer: "done" },
  ];
  const told = shift(at(0), at(10)).interventions;
  assert.deepEqual(told.map(({ by, what, accepted, answer }) => [by, what, accepted, answer]), [
    ["anna-1", "operator.pause", false, "not now"],
    ["anna-1", "/twin/reset", true, "done"],
  ]);
});

test("it says from when on this page knows what happened", () => {
  assert.equal(shift(at(0), at(10)).knownFrom, undefined);
  tellStep(4);
  assert.equal(shift(at(0), at(10)).knownFrom, at(4));
});
