// What is filled in to start a mission: texts by mission and field, and what they mean by the field's declaration.
import { effect, signal } from "@preact/signals";
import type { Texts } from "../../texts/en";
import { picked, picking } from "./picking";
import type { FieldRecord, OfferedMission, TypeRecord } from "../../records";

type Draft = Readonly<Record<string, string>>;

/** What was typed; a field that is empty is left to the mission. It outlives a change of the view. */
const drafts = signal<Readonly<Record<string, Draft>>>({});

export function draftOf(mission: string): Draft {
  return drafts.value[mission] ?? {};
}

export function fill(mission: string, field: string, text: string): void {
  drafts.value = { ...drafts.value, [mission]: { ...drafts.peek()[mission], [field]: text } };
  const at = picking.peek();
  if (at?.mission === mission && at.field === field) picked.value = elements(text);
}

effect(() => {
  const at = picking.value;
  const found = picked.value;
  if (!at) return;
  const { [at.field]: before = "" } = drafts.peek()[at.mission] ?? {};
  if (elements(before).join() !== found.join()) fill(at.mission, at.field, found.join(", "));
});

export const isList = (field: TypeRecord): boolean => / of /.test(field.type);

/** The elements of a list, as they are written between commas. */
export function elements(text: string): readonly string[] {
  return text.split(/[,;\s]+/).filter((each) => each !== "");
}

/** What a text means, or what is wrong with it. */
export type Meaning = { readonly value: unknown } | { readonly problem: string };

/** Return what a field's text means; `undefined` for a text that leaves it to the mission. */
export function meaningOf(field: FieldRecord, text: string, wrong: Texts["control"]["wrong"]): Meaning | undefined {
  const written = text.trim();
  if (!written) return field.required ? { problem: wrong.missing } : undefined;
  if (!isList(field)) return oneOf(field, written, wrong);
  if (field.kind === "record" || field.kind === "any" || field.kind === "list") return jsonOf(field, written, wrong);
  const found = elements(written);
  if (!found.length && field.may_be_empty === false) return { problem: wrong.empty };
  if (field.at_most !== undefined && found.length > field.at_most) return { problem: wrong.many(`${field.at_most}`) };
  const meanings = found.map((each) => oneOf(field, each, wrong));
  const problem = meanings.find((each) => "problem" in each);
  return problem ?? { value: meanings.map((each) => "value" in each && each.value) };
}

function oneOf(field: FieldRecord, text: string, wrong: Texts["control"]["wrong"]): Meaning {
  if (field.allowed && !field.allowed.includes(text)) return { problem: wrong.allowed(field.allowed.join(", ")) };
  if (field.kind === "bool") return { value: text === "true" };
  if (field.kind === "integer" || field.kind === "number") return numberOf(field, text, wrong);
  if (field.kind === "record" || field.kind === "any") return jsonOf(field, text, wrong);
  if (field.pattern && !new RegExp(`^(?:${field.pattern})$`).test(text)) return { problem: wrong.pattern(field.example ?? "") };
  return { value: text };
}

/** A number in the base unit; one with a unit of its own, such as `90 s`, is read by the engine. */
function numberOf(field: FieldRecord, text: string, wrong: Texts["control"]["wrong"]): Meaning {
  if (field.kind === "number" && /^[+-]?[\d.,]+\s*[A-Za-z°%]/.test(text)) return { value: text.replace(",", ".") };
  const value = Number(text.replace(",", "."));
  if (!Number.isFinite(value)) return { problem: field.kind === "integer" ? wrong.integer : wrong.number };
  if (field.kind === "integer" && !Number.isInteger(value)) return { problem: wrong.integer };
  if (field.minimum !== undefined && value < field.minimum) return { problem: wrong.low(`${field.minimum}`) };
  if (field.maximum !== undefined && value > field.maximum) return { problem: wrong.high(`${field.maximum}`) };
  return { value };
}

function jsonOf(field: TypeRecord, text: string, wrong: Texts["control"]["wrong"]): Meaning {
  try {
    const value: unknown = JSON.parse(text);
    const problem = misfit(field, value, wrong);
    return problem ? { problem } : { value };
  } catch {
    return { problem: wrong.json(formOf(field)) };
  }
}

/** How a value of a type is written as JSON: names, and the types or units of what they stand for. */
export function formOf(type: TypeRecord): string {
  const fields = Object.entries(type.fields ?? {}).map(([name, each]) => `"${name}": ${formOf(each)}`);
  const one = type.fields ? `{${fields.join(", ")}}` : (type.unit ?? type.type.replace(/.* of /, ""));
  return isList(type) ? `[${one}, …]` : one;
}

/** What is wrong with the fields of a record, or of those in a list; what they hold is judged by the engine. */
function misfit(type: TypeRecord, value: unknown, wrong: Texts["control"]["wrong"]): string {
  if (!type.fields) return "";
  const form = wrong.json(formOf(type));
  if (isList(type)) {
    const { at_most: _, type: name, ...rest } = type;
    const item: TypeRecord = { ...rest, type: name.replace(/.*? of /, "") };
    return Array.isArray(value) ? (value.map((each) => misfit(item, each, wrong)).find(Boolean) ?? "") : form;
  }
  if (typeof value !== "object" || value === null || Array.isArray(value)) return form;
  const given = new Map(Object.entries(value));
  const names = Object.keys(type.fields);
  const other = [...given.keys()].find((name) => !names.includes(name));
  if (other !== undefined) return wrong.field(other, names.join(", "));
  const missing = names.filter((name) => !given.has(name));
  if (missing.length) return wrong.lacks(missing.join(", "));
  return names.map((name) => misfit(type.fields?.[name] ?? type, given.get(name), wrong)).find(Boolean) ?? "";
}

/** What a mission would be asked for, and what is wrong by field. */
export function requestOf(mission: OfferedMission, wrong: Texts["control"]["wrong"]) {
  const request: Record<string, unknown> = {};
  const problems: Record<string, string> = {};
  const draft = draftOf(mission.mission);
  for (const field of mission.request) {
    const meaning = meaningOf(field, draft[field.name] ?? "", wrong);
    if (meaning && "problem" in meaning) problems[field.name] = meaning.problem;
    else if (meaning) request[field.name] = meaning.value;
  }
  return { request, problems };
}

/** A value as it is written in a form: of a thing with an `id`, that. */
export function written(value: unknown): string {
  if (typeof value === "object" && value !== null && "id" in value) return String(value.id);
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}
