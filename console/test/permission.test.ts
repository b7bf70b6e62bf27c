// Why a button is grey: the page's own reasons in their order, then the engine's.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { asking, missions } from "../src/model/mission/mission";
import { commandHindrance, hindranceFor, reasonOf, toldOf } from "../src/model/mission/permission";
import { gateway } from "../src/model/page";
import { setPace } from "../src/model/time/clock";
import { moment } from "../src/model/time/past";
import { link } from "../src/wire/link";
import { possibleOf, T0, tell, tellState } from "./told";

/** The state of the mission is heard, so many seconds ago. */
function heard(ago: number): void {
  tellState(0, {});
  setPace(T0 + ago * 1000, 0);
}

beforeEach(() => {
  moment.value = null;
  gateway.value = { clients: 1, role: "operator" };
  link.state.value = "open";
  asking.value = "";
});

test("an orchestrator that was never heard cannot be commanded", () => {
  assert.equal(commandHindrance.value, "The orchestrator is not heard.");
});

test("an operator who hears the orchestrator may command", () => {
  heard(2);
  assert.equal(commandHindrance.value, "");
});

test("nor can one that is silent for more than 3 s", () => {
  heard(3.1);
  assert.equal(commandHindrance.value, "The orchestrator is not heard.");
});

test("nothing is commanded without a connection, by a viewer, or in the past", () => {
  heard(0);
  moment.value = T0 - 5000;
  assert.equal(commandHindrance.value, "You look at the past: go back to now first.");
  gateway.value = { clients: 1, role: "viewer" };
  assert.equal(commandHindrance.value, "You may look only: commanding needs the role of an operator.");
  link.state.value = "lost";
  assert.equal(commandHindrance.value, "There is no connection to the robot.");
  gateway.value = { clients: 1, mode: "recording" };
  assert.equal(commandHindrance.value, "This is a recording: nothing can be commanded.");
});

test("one thing is asked at a time", () => {
  heard(0);
  asking.value = "skip_current";
  assert.equal(commandHindrance.value, "Waiting for the answer to skip current.");
});

test("what needs an engineer is not for an operator", () => {
  assert.equal(hindranceFor("operator"), "");
  assert.equal(hindranceFor("engineer"), "This needs the role of an engineer.");
  gateway.value = { clients: 1, role: "engineer" };
  assert.equal(hindranceFor("engineer"), "");
});

test("what the engine refuses is refused with its sentence", () => {
  heard(0);
  assert.equal(reasonOf(possibleOf()), "");
  assert.equal(reasonOf(possibleOf({ possible: false, reason: "no mission is running" })), "no mission is running");
});

test("what was not told is not possible", () => {
  heard(0);
  assert.equal(reasonOf(undefined), "The orchestrator has not told whether this is possible.");
});

test("a start that only lacks fields can be asked for: the form has them", () => {
  heard(0);
  assert.equal(reasonOf(possibleOf({ verb: "start", possible: false, fields: true, reason: "tags is missing" })), "");
});

test("what it would do to holds is told in the words of their codes", () => {
  heard(0);
  const codes = { paused: { label: "paused by the operator", severity: 0, advice: "" } };
  const stages = { starting: [], ready: [], returning: [], ended: [], faulted: [] };
  tell(missions, { missions: [], problems: [], codes, holds: { pause: "paused" }, outcomes: [], stages, ends: "" });
  assert.match(toldOf(possibleOf({ verb: "wait", engages: ["pause"] }), ""), /paused by the operator/);
  assert.match(toldOf(possibleOf({ verb: "go", releases: ["other"] }), ""), /other/);
  const waits = possibleOf({ verb: "abort", reason: "what has begun is finished first" });
  assert.equal(toldOf(waits, ""), "ends the mission; what has begun is finished first");
});

test("of a moment that is over it is told what the engine said then", () => {
  moment.value = T0 - 5000;
  const past = "You look at the past: go back to now first.";
  assert.equal(toldOf(possibleOf(), past), `${past} It was possible then.`);
  assert.equal(toldOf(possibleOf({ possible: false, reason: "no mission is running" }), past), `${past} Then: no mission is running`);
});
