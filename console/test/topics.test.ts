// What arrives on a topic: silence, what is read twice, what is no record, and the mission as it was told.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { isFault, missions, possible, state, steps, view } from "../src/model/mission/mission";
import { gateway } from "../src/model/page";
import { setPace } from "../src/model/time/clock";
import { moment } from "../src/model/time/past";
import { timeOfDay } from "../src/model/time/scrub";
import { alike, isStale } from "../src/model/topics";
import { possibleOf, recordOf, T0, tell, tellState, tellStep } from "./told";

beforeEach(() => {
  for (const { past } of [state, steps, possible, missions]) past.clear();
  moment.value = null;
  gateway.value = undefined;
});

test("a record that is none is left out, and the next one is taken", () => {
  steps.take({ data: "{" }, T0);
  steps.take({ data: '{"step": {}}' }, T0);
  assert.equal(steps.past.until(null).length, 0);
  tellStep(1, {}, { lifecycle: "READY" });
  assert.equal(view.value?.lifecycle, "READY");
});

test("a step is kept once, however often it is told; of another start it is another one", () => {
  for (const boot of ["one", "one", "two"]) tell(steps, recordOf(3, {}, {}, { boot }));
  assert.deepEqual(steps.past.until(null).map(({ value }) => value.boot), ["one", "two"]);
});

test("a step was when the orchestrator says, not when it arrived", () => {
  tell(steps, recordOf(3), T0 + 60_000);
  assert.equal(steps.past.at(null)?.at, T0 + 3000);
});

test("what is possible after a step is told a little later, and shown with the step", () => {
  const told = (sequence: number, possible_: boolean) => ({ boot: "one", chart: "c", sequence, requests: [possibleOf({ possible: possible_ })] });
  tell(possible, told(1, false), T0);
  tell(possible, told(2, true), T0 + 1100);
  moment.value = T0 + 1000;
  assert.equal(possible.shown.value?.value.requests[0]?.possible, true);
  moment.value = T0 + 900;
  assert.equal(possible.shown.value?.value.requests[0]?.possible, false);
});

test("missions as an earlier version told them lack nothing that is read", () => {
  missions.take({ data: '{"missions": [], "problems": []}' }, T0);
  assert.deepEqual(missions.past.at(null)?.value.codes, {});
  assert.equal(isFault("FAULT"), false);
});

test("who is silent is stale: of a robot, and now", () => {
  setPace(T0 + 10_000, 0);
  assert.equal(isStale(state, 3), true);
  tellState(8, {});
  assert.equal(isStale(state, 3), false);
  setPace(T0 + 11_001, 0);
  assert.equal(isStale(state, 3), true);
  moment.value = T0 + 11_001;
  assert.equal(isStale(state, 3), false);
  moment.value = null;
  gateway.value = { mode: "simulation", clients: 1 };
  assert.equal(isStale(state, 3), false);
});

test("values are alike by what is in them", () => {
  assert.equal(alike({ a: [1, { b: null }] }, { a: [1, { b: null }] }), true);
  for (const other of [{ a: [1] }, { a: [1, { b: 0 }] }, { a: [1, { b: null }], c: 1 }, { c: [1, { b: null }] }, null])
    assert.equal(alike({ a: [1, { b: null }] }, other), false);
});

test("a time of day is the last one that a clock here showed", () => {
  const now = new Date(2026, 0, 5, 10, 30).getTime();
  assert.equal(timeOfDay("9:15", now), new Date(2026, 0, 5, 9, 15).getTime());
  assert.equal(timeOfDay(" 22:15:07 ", now), new Date(2026, 0, 4, 22, 15, 7).getTime());
  for (const text of ["24:00", "10:60", "noon", ""]) assert.equal(timeOfDay(text, now), undefined);
});
