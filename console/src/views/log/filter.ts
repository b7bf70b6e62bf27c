// Which lines of the log are shown.
import { computed, signal } from "@preact/signals";
import { entries } from "../../model/story/log";
import type { Entry, Kind, Severity } from "../../model/story/story";

/** Kinds that are not shown. */
export const hidden = signal<ReadonlySet<Kind>>(new Set());
export const least = signal<Severity>(0);
export const wantedTarget = signal("");
export const wantedText = signal("");

/** All that is written in a line. */
export function textOf({ text, moved = "", target = "", commands = [], notes = [] }: Entry): string {
  return [text, moved, target, ...commands, ...notes].join("\n");
}

export const lines = computed<readonly Entry[]>(() => {
  const [kinds, severity, target, text] = [hidden.value, least.value, wantedTarget.value, wantedText.value.trim().toLowerCase()];
  if (!kinds.size && !severity && !target && !text) return entries.value;
  return entries.value.filter(
    (entry) =>
      entry.severity >= severity &&
      !kinds.has(entry.kind) &&
      (!target || entry.target === target) &&
      (!text || textOf(entry).toLowerCase().includes(text)),
  );
});

/** All targets that there were, in the order of their names. */
export const targets = computed<readonly string[]>(() => {
  const found = new Set<string>();
  for (const { target } of entries.value) if (target) found.add(target);
  return [...found].sort((one, other) => one.localeCompare(other, undefined, { numeric: true }));
});
