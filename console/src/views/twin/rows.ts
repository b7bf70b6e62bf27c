// What the table of tags shows: of each tag what the twin knows, the past of its sensors, and its last visit.
import { computed } from "@preact/signals";
import { shownNow } from "../../model/time/clock";
import { observations } from "../../model/mission/mission";
import { moment, type Known } from "../../model/time/past";
import { SENSORS, unitOf } from "../../model/robot/sensors";
import { placeOf, twin, valueOf, type Tag } from "../../model/robot/twin";
import { Observation } from "../../ros";
import { isoTime } from "../../parts/csv";

/** Seconds after which what is known of a tag counts as old. */
export const FRESH_S = 600;

export type Outcome = "ok" | "unreachable" | "scanFailed" | "skipped";
const OUTCOMES: Readonly<Record<number, Outcome>> = {
  [Observation.STATUS_OK]: "ok",
  [Observation.STATUS_UNREACHABLE]: "unreachable",
  [Observation.STATUS_SCAN_FAILED]: "scanFailed",
  [Observation.STATUS_SKIPPED]: "skipped",
};

export interface Visit {
  readonly at: number;
  readonly outcome: Outcome;
  readonly detail: string;
}

export interface Row {
  readonly tag: Tag;
  /** Seconds since it was observed; undefined: never. */
  readonly age: number | undefined;
  readonly visit: Visit | undefined;
  readonly past: Readonly<Record<string, readonly Known<number>[]>>;
}

interface Seen {
  readonly pasts: Map<string, Record<string, Known<number>[]>>;
  readonly visits: Map<string, Visit>;
}

/** Of each tag the values of its sensors and its last visit, from all observations up to the moment. */
const seen = computed<Seen>(() => {
  const pasts: Seen["pasts"] = new Map();
  const visits: Seen["visits"] = new Map();
  for (const { at, value } of observations.past.until(moment.value)) {
    const id = value.tag_reading.tag_id;
    if (!id || value.kind !== Observation.KIND_TAG_READING) continue;
    visits.set(id, { at, outcome: OUTCOMES[value.status] ?? "scanFailed", detail: value.status_detail });
    const past = pasts.get(id) ?? {};
    pasts.set(id, past);
    for (const { name, value: measured } of value.tag_reading.readings)
      if (measured !== null) (past[name] ??= []).push({ at, value: measured });
  }
  return { pasts, visits };
});

const NO_PAST = {};

/** All tags; also those that were only tried, of which the twin knows nothing. */
export const rows = computed<readonly Row[]>(() => {
  const now = shownNow.value;
  const { pasts, visits } = seen.value;
  return (twin.shown.value?.value ?? []).map((tag) => ({
    tag,
    age: tag.observedAt === undefined ? undefined : (now - tag.observedAt) / 1000,
    visit: visits.get(tag.tag_id),
    past: pasts.get(tag.tag_id) ?? NO_PAST,
  }));
});

/** Sensors that any tag has: those of the interface in its order, then others. */
export const sensors = computed<readonly string[]>(() => {
  const found = new Set((twin.shown.value?.value ?? []).flatMap(({ readings }) => readings.map(({ name }) => name)));
  return [...SENSORS.filter((name) => found.has(name)), ...[...found].filter((name) => !SENSORS.includes(name)).sort()];
});

export type Column = "id" | "species" | "age" | "visit" | { readonly sensor: string };

export function columnKey(column: Column): string {
  return typeof column === "string" ? column : `sensor ${column.sensor}`;
}

function sortValue({ tag, age, visit }: Row, column: Column): number | string | undefined {
  if (typeof column === "object") return valueOf(tag, column.sensor);
  if (column === "species") return `${tag.anomaly ? "0" : "1"} ${tag.species || "~"}`;
  if (column === "age") return age;
  if (column === "visit") return visit?.outcome;
  return tag.tag_id;
}

/** Rows in the order of a column; what has no value comes last, ids go by their numbers. */
export function sorted(all: readonly Row[], column: Column, down: boolean): readonly Row[] {
  const sign = down ? -1 : 1;
  return all.toSorted((one, other) => {
    const [a, b] = [sortValue(one, column), sortValue(other, column)];
    if (a === undefined || b === undefined) return Number(a === undefined) - Number(b === undefined);
    const order = typeof a === "number" ? a - (b as number) : a.localeCompare(String(b), undefined, { numeric: true });
    return sign * order || one.tag.tag_id.localeCompare(other.tag.tag_id, undefined, { numeric: true });
  });
}

/** The table for a spreadsheet: a row for each tag, times in UTC. */
export function exported(all: readonly Row[]): (string | number | boolean | undefined)[][] {
  const named = sensors.value.map((name) => (unitOf(name) ? `${name} (${unitOf(name)})` : name));
  const head = ["tag", "x (m)", "y (m)", "species", "confidence", "anomaly", "flowers", "observed", "last visit", "last outcome", "detail"];
  return [
    [...head, ...named],
    ...all.map(({ tag, visit }) => {
      const place = placeOf(tag);
      const { tag_id, species, species_confidence: confidence, anomaly, flowers, observedAt } = tag;
      const looked = [species, species ? (confidence ?? undefined) : undefined, anomaly, flowers.length];
      const times = [observedAt === undefined ? "never read" : isoTime(observedAt), visit && isoTime(visit.at), visit?.outcome, visit?.detail];
      return [tag_id, place?.x, place?.y, ...looked, ...times, ...sensors.value.map((name) => valueOf(tag, name))];
    }),
  ];
}

/** What a person looks for in a row. */
export function matches({ tag, visit }: Row, wanted: string): boolean {
  const text = [tag.tag_id, tag.species, visit?.detail ?? "", tag.anomaly ? "anomaly" : ""].join(" ").toLowerCase();
  return wanted
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.includes(word));
}

