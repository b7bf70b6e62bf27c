// How much time is left: by the clock of the orchestrator's loop, which may be slower than the robot's.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { state, steps } from "../src/model/mission/mission";
import { gateway } from "../src/model/page";
import { setPace } from "../src/model/time/clock";
import { loopNow, secondsLeft } from "../src/model/time/countdown";
import { moment } from "../src/model/time/past";
import { link } from "../src/wire/link";
import { T0, tellState, tellStep } from "./told";

/** It is so many seconds after `T0`, and the orchestrator is heard. */
function now(seconds: number): void {
  setPace(T0 + seconds * 1000, 0);
  tellState(seconds, {});
}

beforeEach(() => {
  for (const { past } of [state, steps]) past.clear();
  moment.value = null;
  gateway.value = undefined;
  link.state.value = "open";
});

test("without a step nothing is known of a deadline", () => {
  now(0);
  assert.equal(loopNow.value, undefined);
  assert.equal(secondsLeft({ deadline: 10, left: null }), null);
});

test("a deadline comes nearer by the second, and is never less than over", () => {
  tellStep(10);
  now(12);
  assert.equal(secondsLeft({ deadline: 20, left: null }), 8);
  assert.equal(secondsLeft({ deadline: 11, left: null }), 0);
});

test("a clock that a hold has stopped stands, and what has no deadline has none", () => {
  tellStep(10);
  now(15);
  assert.equal(secondsLeft({ deadline: null, left: 7.5 }), 7.5);
  assert.equal(secondsLeft({ deadline: null, left: null }), null);
});

test("in simulated time that is half as fast, so is what runs down", () => {
  tellStep(10, {}, {}, { time: 100 });
  tellStep(14, {}, {}, { time: 102 });
  now(18);
  assert.equal(secondsLeft({ deadline: 110, left: null }), 6);
});

test("an orchestrator that was started anew has another clock", () => {
  tellStep(10, {}, {}, { time: 1000, boot: "one" });
  tellStep(14, {}, {}, { time: 3, boot: "two" });
  now(16);
  assert.equal(secondsLeft({ deadline: 10, left: null }), 5);
});

test("when nothing is heard any more, time stands at what was heard last", () => {
  tellStep(110);
  now(111);
  setPace(T0 + 160_000, 0);
  assert.equal(secondsLeft({ deadline: 120, left: null }), 9);
});

test("in the past it is as it was then", () => {
  tellStep(10);
  tellStep(30);
  now(40);
  moment.value = T0 + 12_000;
  assert.equal(secondsLeft({ deadline: 20, left: null }), 8);
});
