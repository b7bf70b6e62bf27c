// What happened before this page was opened, from the gateway: lines of JSON, the oldest first.
import { link } from "../wire/link";
import { topics } from "./topics";

/** A message that the gateway has kept: `at` in milliseconds since 1970. */
interface KeptMessage {
  readonly topic: string;
  readonly at: number;
  readonly msg: unknown;
}

let newest = 0;

/** Load what the gateway has kept since the last time; where it keeps nothing, nothing comes. */
async function load(): Promise<void> {
  const answer = await fetch(`history?since=${newest}`);
  if (!answer.ok) return;
  for (const line of (await answer.text()).split("\n")) {
    if (!line) continue;
    const { topic, at, msg } = JSON.parse(line) as KeptMessage;
    topics.get(topic)?.take(msg, at);
    newest = Math.max(newest, at);
  }
}

export function startHistory(): void {
  link.opened.push(() => void load().catch(() => undefined));
}
