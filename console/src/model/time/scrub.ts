// Going through the past: step by step, from problem to problem, to a time, and back to now.
import { computed } from "@preact/signals";
import { robotNow } from "./clock";
import { begin, neighbour, problems, stepStory } from "../story/log";
import { steps } from "../mission/mission";
import { loadOlder } from "./history";
import { moment } from "./past";
import { TARGET } from "../story/story";

/** Show a moment; one that is not over yet is now. */
export async function showMoment(at: number): Promise<void> {
  if (at < (begin.peek() ?? at)) await loadOlder();
  const first = begin.peek() ?? at;
  moment.value = at >= robotNow() ? null : Math.max(at, first);
}

export function goLive(): void {
  moment.value = null;
}

export async function goToBegin(): Promise<void> {
  await loadOlder();
  const first = begin.peek();
  if (first !== undefined) moment.value = first;
}

/** Go to the step before or the next one; behind the last one is now. */
export function goStep(direction: 1 | -1): void {
  const at = moment.peek();
  if (at === null && direction > 0) return;
  const next = direction > 0 ? steps.past.after(at!) : neighbour(steps.past.standing().list, at ?? Infinity, -1);
  moment.value = next?.at ?? (direction > 0 ? null : at);
}

/** Go to the warning or error before or after the moment. */
export function goProblem(direction: 1 | -1): void {
  const found = neighbour(problems.peek(), moment.peek() ?? Infinity, direction);
  if (found) moment.value = found.at;
}

/** Go to when the work on a target began last. */
export function goTarget(target: string): void {
  const found = stepStory.peek().reader.rows.get(TARGET)?.findLast(({ text }) => text === target);
  if (found) moment.value = found.from;
}

/** Whether there is a warning or error in a direction. */
export const hasProblem = {
  before: computed(() => neighbour(problems.value, moment.value ?? Infinity, -1) !== undefined),
  after: computed(() => moment.value !== null && neighbour(problems.value, moment.value, 1) !== undefined),
};

const TIME = /^\s*(\d{1,2})[:.h](\d{2})(?:[:.](\d{2}))?\s*$/;
const DAY_MS = 86_400_000;

/** The last time that a clock here showed a time of day, such as `03:12` or `03:12:07`, before `now`. */
export function timeOfDay(text: string, now: number): number | undefined {
  const found = TIME.exec(text);
  if (!found) return undefined;
  const [hours, minutes, seconds] = [Number(found[1]), Number(found[2]), Number(found[3] ?? 0)];
  if (hours > 23 || minutes > 59 || seconds > 59) return undefined;
  const day = new Date(now);
  const at = day.setHours(hours, minutes, seconds, 0);
  return at <= now ? at : new Date(at - DAY_MS).setHours(hours, minutes, seconds, 0);
}

/** Keys that go through the past, wherever the page is looked at; returns whether it was one. */
export function scrubByKey(event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const go = event.shiftKey ? goProblem : goStep;
  if (event.key === "ArrowLeft") go(-1);
  else if (event.key === "ArrowRight") go(1);
  else if (event.key === "Home") void goToBegin();
  else if (event.key === "End" || (event.key === "Escape" && !event.shiftKey)) goLive();
  else return false;
  event.preventDefault();
  return true;
}

/** `L` is now, wherever the focus is, unless something is being written. */
export function startScrubbing(): void {
  addEventListener("keydown", (event) => {
    const { target } = event;
    const writes = target instanceof HTMLElement && target.closest("input:not([type=range]), textarea, select, [contenteditable]");
    if (event.key.toLowerCase() === "l" && !writes && !event.ctrlKey && !event.metaKey && !event.altKey) goLive();
  });
}
