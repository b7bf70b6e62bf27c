// What was known when: the order of time, late arrivals, and what is forgotten first.
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { moment, Past, shown, wholePast } from "../src/model/time/past";

const values = (past: Past<string>): string => past.until(null).map(({ value }) => value).join("");

afterEach(() => {
  moment.value = null;
  wholePast.value = true;
});

test("at a moment the last before it is known, and it counts from its own moment on", () => {
  const past = new Past<string>(100);
  past.addAll([{ at: 10, value: "a" }, { at: 20, value: "b" }]);
  assert.deepEqual([9, 10, 19, 20, null].map((at) => past.at(at)?.value), [undefined, "a", "a", "b", "b"]);
  assert.equal(past.after(10)?.value, "b");
  assert.equal(past.after(20), undefined);
  assert.deepEqual(past.between(10, 20).map(({ at }) => at), [10, 20]);
});

test("what comes late is put in its place, and who reads on is told that the list is another one", () => {
  const past = new Past<string>(100);
  past.addAll([{ at: 10, value: "a" }, { at: 30, value: "c" }]);
  const { edition } = past.standing();
  past.add(40, "d");
  assert.equal(past.standing().edition, edition);
  past.add(20, "b");
  assert.equal(values(past), "abcd");
  assert.notEqual(past.standing().edition, edition);
});

test("a value that says nothing new is not kept, one that comes back is", () => {
  const past = new Past<string>(100, { same: (one, other) => one === other });
  for (const [at, value] of [[1, "a"], [2, "a"], [3, "b"], [4, "a"]] as const) past.add(at, value);
  assert.deepEqual(past.until(null).map(({ at }) => at), [1, 3, 4]);
  past.addAll([{ at: 4, value: "c" }, { at: 4, value: "a" }, { at: 4, value: "c" }]);
  assert.equal(values(past), "abac");
});

test("a history that was known in part adds what is new only", () => {
  const past = new Past<string>(100, { same: (one, other) => one === other });
  past.addAll([{ at: 2, value: "b" }, { at: 3, value: "c" }]);
  past.addAll([{ at: 1, value: "a" }, { at: 2, value: "b" }, { at: 3, value: "c" }, { at: 4, value: "d" }]);
  assert.equal(values(past), "abcd");
});

test("beyond its bound it forgets what is minor, then the oldest, and says so", () => {
  wholePast.value = false;
  const past = new Past<string>(10, { minor: (value) => value === "-" });
  for (let at = 0; at < 12; at++) past.add(at, at % 2 ? "-" : String.fromCharCode(97 + at));
  assert.equal(values(past), "aceg-i-k-");
  assert.equal(past.forgot.value, true);
});

test("while the whole past is looked at it keeps ten times as much", () => {
  const past = new Past<string>(10);
  for (let at = 0; at < 100; at++) past.add(at, "x");
  assert.equal(past.until(null).length, 100);
  wholePast.value = false;
  past.trim();
  assert.equal(past.until(null).length, 10);
  assert.equal(past.at(null)?.at, 99);
});

test("what is shown follows the moment, and what is told a little later counts at it already", () => {
  const past = new Past<string>(100);
  past.addAll([{ at: 10, value: "a" }, { at: 120, value: "b" }]);
  const [plain, late] = [shown(past), shown(past, 150)];
  assert.equal(plain.value?.value, "b");
  moment.value = 10;
  assert.equal(plain.value?.value, "a");
  assert.equal(late.value?.value, "b");
});
