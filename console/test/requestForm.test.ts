// What is typed into a form to start a mission: what is sent for it, or what is wrong.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fill, meaningOf, requestOf, written } from "../src/model/mission/requestForm";
import { endPicking, picked, startPicking, toggle } from "../src/model/mission/picking";
import type { FieldRecord, TypeRecord } from "../src/records";
import { en } from "../src/texts/en";

const { wrong } = en.control;

function field(given: Partial<FieldRecord>): FieldRecord {
  return { name: "f", type: "text", kind: "text", required: false, ...given };
}

function value(given: Partial<FieldRecord>, text: string): unknown {
  const meaning = meaningOf(field(given), text, wrong);
  assert.ok(meaning && "value" in meaning, JSON.stringify(meaning));
  return meaning.value;
}

function problem(given: Partial<FieldRecord>, text: string): string {
  const meaning = meaningOf(field(given), text, wrong);
  assert.ok(meaning && "problem" in meaning, JSON.stringify(meaning));
  return meaning.problem;
}

test("an empty field is left to the mission, unless it is required", () => {
  assert.equal(meaningOf(field({}), "  ", wrong), undefined);
  assert.equal(problem({ required: true }, ""), wrong.missing);
});

test("numbers are read as people write them, within their bounds", () => {
  const real = { type: "number", kind: "number", minimum: 0, maximum: 2 } as const;
  assert.equal(value(real, " 1,5 "), 1.5);
  assert.equal(problem(real, "-0.1"), wrong.low("0"));
  assert.equal(problem(real, "2.1"), wrong.high("2"));
  assert.equal(problem(real, "much"), wrong.number);
  assert.equal(problem(real, "Infinity"), wrong.number);
});

test("a number with a unit is left to the engine", () => {
  assert.equal(value({ type: "number", kind: "number", unit: "s", maximum: 10 }, "1,5 min"), "1.5 min");
});

test("a count is whole", () => {
  const count = { type: "count", kind: "integer", minimum: 1 } as const;
  assert.equal(value(count, "3"), 3);
  assert.equal(problem(count, "1.5"), wrong.integer);
  assert.equal(problem(count, "3 m"), wrong.integer);
});

test("words are those that are allowed, and have the form that is asked for", () => {
  assert.equal(problem({ allowed: ["slow", "fast"] }, "Slow"), wrong.allowed("slow, fast"));
  const time = { pattern: "[0-2]\\d:[0-5]\\d", example: "06:30" };
  assert.equal(value(time, "06:30"), "06:30");
  assert.equal(problem(time, "at 06:30"), wrong.pattern("06:30"));
});

test("a list has its elements' rules, and its own for how many", () => {
  const tags = { type: "list of tag", kind: "name", may_be_empty: false, at_most: 2 } as const;
  assert.deepEqual(value(tags, "1, 5"), ["1", "5"]);
  assert.equal(problem(tags, ","), wrong.empty);
  assert.equal(problem(tags, "1 2 3"), wrong.many("2"));
  assert.equal(problem({ type: "list of count", kind: "integer" }, "1, two"), wrong.integer);
});

test("records are JSON", () => {
  assert.deepEqual(value({ type: "pose", kind: "record" }, '{"x": 1}'), { x: 1 });
  assert.equal(problem({ type: "pose", kind: "record" }, "{x: 1}"), wrong.json("pose"));
  assert.equal(value({ type: "bool", kind: "bool" }, "false"), false);
});

test("a record has all of its fields, and no others", () => {
  const at: TypeRecord = { type: "pose", kind: "record", fields: { x: { type: "length", kind: "number", unit: "m" } } };
  const fields = { id: { type: "text", kind: "text" }, at } as const;
  const wards = { type: "list of ward", kind: "record", fields } as const;
  assert.deepEqual(value(wards, '[{"id": "icu", "at": {"x": "1 m"}}]'), [{ id: "icu", at: { x: "1 m" } }]);
  assert.equal(problem(wards, '{"id": "icu"}'), wrong.json('[{"id": text, "at": {"x": m}}, …]'));
  assert.equal(problem(wards, '[{"id": "icu", "att": 1}]'), wrong.field("att", "id, at"));
  assert.equal(problem(wards, '[{"id": "icu"}]'), wrong.lacks("at"));
  assert.equal(problem({ ...wards, type: "ward" }, '{"id": "icu", "at": 1}'), wrong.json('{"x": m}'));
  assert.equal(problem({ ...wards, type: "ward" }, '{"id": "icu", "at": {"z": 1}}'), wrong.field("z", "x"));
});

test("a request has what was filled in only; problems are told by field", () => {
  const request = [field({ name: "rounds", type: "count", kind: "integer" }), field({ name: "note" }), field({ name: "who", required: true })];
  const mission = { mission: "Round", file: "round", summary: "", request };
  fill("Round", "rounds", "2");
  assert.deepEqual(requestOf(mission, wrong), { request: { rounds: 2 }, problems: { who: wrong.missing } });
});

test("what is picked on the map is filled in, and what is typed is picked", () => {
  const mission = { mission: "Walk", file: "walk", summary: "", request: [field({ name: "tags", type: "list of tag", kind: "name" })] };
  startPicking({ mission: "Walk", field: "tags" }, ["1"]);
  toggle("5");
  toggle("1");
  toggle("7");
  assert.deepEqual(requestOf(mission, wrong).request, { tags: ["5", "7"] });
  fill("Walk", "tags", "7 8");
  assert.deepEqual(picked.value, ["7", "8"]);
  endPicking();
  toggle("9");
  assert.deepEqual(requestOf(mission, wrong).request, { tags: ["7", "8"] });
});

test("a thing with an id is written as that", () => {
  assert.deepEqual([{ id: 3, x: 1 }, { x: 1 }, 0.5].map(written), ["3", '{"x":1}', "0.5"]);
});
