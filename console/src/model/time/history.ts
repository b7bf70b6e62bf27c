// What happened before this page was opened, and while it was not connected, from the gateway: lines of JSON.
import { batch, computed, effect, signal } from "@preact/signals";
import { gateway } from "../page";
import { link } from "../../wire/link";
import { moment, wholePast } from "./past";
import { topics, type Arrived } from "../topics";

/** A message that the gateway has kept: `at` in milliseconds since 1970. */
interface KeptMessage extends Arrived {
  readonly topic: string;
}

/** Letters that are read at once: then the page draws. */
const PART = 1_000_000;

let newest = 0;
let loading = Promise.resolve();

/** Whether a history is being loaded: what is told of the past waits until it is there. */
export const isLoading = signal(false);

/** Load what the gateway has kept since the last time; where it keeps nothing, nothing comes. */
async function load(): Promise<void> {
  const answer = await fetch(`history?since=${newest}&topics=${[...topics.keys()].join(",")}`);
  if (!answer.ok || !answer.body) return;
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  isLoading.value = true;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    text += part.value;
    if (text.length < PART) continue;
    const end = text.lastIndexOf("\n") + 1;
    take(text.slice(0, end));
    text = text.slice(end);
    await new Promise((drawn) => setTimeout(drawn));
  }
  take(text);
}

function take(lines: string): void {
  const arrived = new Map<string, Arrived[]>();
  for (const line of lines.split("\n")) {
    if (!line) continue;
    const kept = JSON.parse(line) as KeptMessage;
    const those = arrived.get(kept.topic) ?? [];
    if (!those.length) arrived.set(kept.topic, those);
    those.push(kept);
    newest = Math.max(newest, kept.at);
  }
  batch(() => {
    for (const [name, messages] of arrived) topics.get(name)?.takeAll(messages);
  });
}

/** Load once more, after what is being loaded. */
function loadMore(): void {
  loading = loading
    .then(load)
    .catch(() => undefined)
    .then(() => {
      isLoading.value = false;
    });
}

/** Forget all, and load it again: what was known is of another run. */
export function loadAnew(): void {
  loading = loading.then(() => {
    newest = 0;
    for (const { past, silences } of topics.values()) {
      past.clear();
      silences.clear();
    }
  });
  loadMore();
}

/** Whether this page has forgotten something that the gateway may have kept. */
export function hasOlder(): boolean {
  return ["/mission/state", "/mission_orchestrator/steps"].some((name) => topics.get(name)?.past.forgot.value);
}

/** Load what this page has forgotten, and keep it until what is now is shown again. */
export async function loadOlder(): Promise<void> {
  if (!hasOlder()) return;
  wholePast.value = true;
  for (const { past } of topics.values()) past.forgot.value = false;
  newest = 0;
  loadMore();
  await loading;
}

/** Keep no more than what is now needs: of a robot, of which the gateway has the rest. */
export function forgetOlder(): void {
  if (moment.peek() !== null) return;
  wholePast.value = (gateway.peek()?.mode ?? "robot") !== "robot";
  batch(() => {
    for (const { past } of topics.values()) past.trim();
  });
}

export function startHistory(): void {
  link.opened.push(loadMore);
  // Topics that no view has shown are not heard: what they said until now comes when the past is looked at.
  const isPast = computed(() => moment.value !== null);
  effect(() => {
    if (isPast.value) {
      wholePast.value = true;
      loadMore();
    } else if (gateway.value) forgetOlder();
  });
}
