// Who is said to stop the robot, and what else everybody is to see at once.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { alerts, stoppers } from "../src/model/alerts";
import { missions, state, steps } from "../src/model/mission/mission";
import { gateway } from "../src/model/page";
import { base, stops } from "../src/model/story/log";
import { moment } from "../src/model/time/past";
import { baseOf, stopsOf, T0, tell, tellState, tellStep } from "./told";

const texts = (): readonly string[] => alerts.value.map(({ text }) => text);

beforeEach(() => {
  for (const { past } of [state, steps, stops, base, missions]) past.clear();
  moment.value = null;
  gateway.value = undefined;
});

test("nothing is wrong while nothing is", () => {
  tellState(0, { estop_engaged: false });
  tell(stops, stopsOf());
  assert.deepEqual(texts(), []);
});

test("a stop of pages names them, and stands beside their button already", () => {
  tell(stops, stopsOf("anna-1", "ben-2"));
  assert.deepEqual(alerts.value, [{ kind: "stop", text: "STOPPED by anna-1, ben-2", isSaid: true }]);
});

test("an e-stop that no page pressed is told, also where nobody says whose it is", () => {
  tellState(0, { estop_engaged: true });
  assert.deepEqual(alerts.value, [{ kind: "stop", text: "STOPPED: e-stop engaged", isSaid: false }]);
  tell(base, baseOf("robot", "hmi", "unheard of"));
  assert.deepEqual(texts(), ["STOPPED by the robot's own e-stop, another operator panel"]);
});

test("a robot that repeats the stop of pages is no second source", () => {
  tell(stops, stopsOf("anna-1"));
  tell(base, baseOf("pages", "robot"));
  assert.deepEqual(stoppers(null), { pages: ["anna-1"], others: [] });
});

test("a stop of pages and another one are both told: the button tells of one only", () => {
  tell(stops, stopsOf("anna-1"));
  tell(base, baseOf("robot"));
  assert.deepEqual(alerts.value, [{ kind: "stop", text: "STOPPED by anna-1, the robot's own e-stop", isSaid: false }]);
});

test("a stop that is over is not told any more, and one that comes again is", () => {
  tell(stops, stopsOf("anna-1"), T0);
  tell(stops, stopsOf(), T0 + 1000);
  assert.deepEqual(texts(), []);
  tell(stops, stopsOf("anna-1"), T0 + 2000);
  assert.deepEqual(texts(), ["STOPPED by anna-1"]);
});

test("of a robot it is of now, whatever moment is shown; of a recording of that moment", () => {
  tell(stops, stopsOf(), T0);
  tell(stops, stopsOf("anna-1"), T0 + 2000);
  moment.value = T0 + 1000;
  assert.deepEqual(texts(), ["STOPPED by anna-1"]);
  gateway.value = { mode: "recording", clients: 0 };
  assert.deepEqual(texts(), []);
});

test("a fault has the label of its code, and a question its text", () => {
  const stages = { starting: [], ready: [], returning: [], ended: [], faulted: ["FAULT"] };
  const codes = { nav_timeout: { label: "navigation timed out", severity: 1, advice: "" } };
  tell(missions, { missions: [], problems: [], codes, holds: {}, outcomes: [], stages, ends: "abort" });
  const asked = { state: "A", question: "Again?", choices: [], default: "no", deadline: 9, left: null };
  tellStep(0, {}, { lifecycle: "FAULT", code: "nav_timeout", detail: "no way to T3", asking: [asked] });
  assert.deepEqual(texts(), ["FAULT: navigation timed out: no way to T3", "The mission asks: Again?"]);
});
