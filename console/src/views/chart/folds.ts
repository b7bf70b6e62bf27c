// Which states are folded, and the drawings for that: the whole one comes with the chart, others are asked for.
import { signal } from "@preact/signals";
import { wholePicture } from "../../model/mission/mission";
import type { DrawResponse } from "../../ros";
import { link } from "../../wire/link";
import { around } from "./names";
import type { ChartRecord } from "../../records";

/** Boxes in a picture that one still finds one's way in: with more, a chart is opened folded. */
const READABLE = 60;
/** Drawings that are kept. */
const KEPT = 24;

export const folded = signal<ReadonlySet<string>>(new Set());

/** Levels of a state: 1 for those at the top. */
const levelOf = (name: string): number => name.split(".").length;

export function inner(chart: ChartRecord): ReadonlySet<string> {
  return new Set(Object.keys(chart.states).map(around).filter(Boolean));
}

export function deepest(chart: ChartRecord): number {
  return Math.max(1, ...Object.keys(chart.states).map(levelOf));
}

/** The states to fold so that so many levels are to be seen. */
export function foldedAt(chart: ChartRecord, depth: number): ReadonlySet<string> {
  return new Set([...inner(chart)].filter((name) => levelOf(name) === depth));
}

/** The depth at which a chart is opened: all of it, unless that is too much to read. */
export function usualDepth(chart: ChartRecord): number {
  const levels = Object.keys(chart.states).map(levelOf);
  const last = deepest(chart);
  const fits = (depth: number): boolean => levels.filter((level) => level <= depth).length <= READABLE;
  return Array.from({ length: last }, (_, place) => last - place).find(fits) ?? 1;
}

/** The states that are folded without another folded one around them: the drawing depends on these alone. */
function outermost(names: ReadonlySet<string>): string[] {
  const isInside = (name: string): boolean => {
    for (let above = around(name); above; above = around(above)) if (names.has(above)) return true;
    return false;
  };
  return [...names].filter((name) => !isInside(name)).sort();
}

const drawings = new Map<string, Promise<string>>();

/** The SVG of a chart with states folded; fails with the reason why there is none. */
export function drawing(chart: ChartRecord, names: ReadonlySet<string>): Promise<string> {
  const list = outermost(names).filter((name) => name in chart.states);
  if (!list.length) return wholePicture(chart.hash);
  const key = JSON.stringify([chart.hash, list]);
  const known = drawings.get(key);
  if (known) return known;
  const asked = link
    .call<DrawResponse>("/mission_orchestrator/draw", { chart: chart.hash, folded: list }, 20)
    .then(({ success, message, svg }) => {
      if (!success) throw new Error(message);
      return svg;
    });
  drawings.set(key, asked);
  asked.catch(() => drawings.delete(key));
  for (const oldest of drawings.keys()) if (drawings.size > KEPT) drawings.delete(oldest);
  return asked;
}

/** Unfold all that is around a state. */
export function reveal(name: string): void {
  const hiding = new Set<string>();
  for (let above = around(name); above; above = around(above)) if (folded.peek().has(above)) hiding.add(above);
  if (hiding.size) folded.value = new Set([...folded.peek()].filter((each) => !hiding.has(each)));
}

export function toggle(name: string): void {
  const names = new Set(folded.peek());
  if (!names.delete(name)) names.add(name);
  folded.value = names;
}
