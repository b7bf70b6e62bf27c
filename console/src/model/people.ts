// Who is here, what they pressed, and what people are to know of.
import { computed, signal } from "@preact/signals";
import { link } from "../wire/link";
import { alike, recordTopic } from "./topics";
import { person } from "./mission/mission";
import { route } from "./page";
import type { NotificationsRecord, PeopleRecord } from "../records";

const HMI = "/lupin/hmi";

/** A line of the gateway's audit log. */
export interface Pressed {
  readonly number: number;
  readonly wall: string;
  readonly who: string;
  readonly page: string;
  readonly what: string;
  readonly name: string;
  readonly sent: string;
  readonly accepted?: boolean | null;
  readonly answer?: string;
}

export const people = recordTopic<PeopleRecord>(`${HMI}/people`, {
  keep: 1000,
  always: true,
  same: alike,
});

const told = recordTopic<NotificationsRecord>(`${HMI}/notifications`, {
  keep: 1,
  always: true,
});

/** All notifications, the newest first; they are of now, whatever moment is shown. */
export const notifications = computed(() => (told.past.at(null)?.value.notifications ?? []).toReversed());
/** Those that nobody has acknowledged. */
export const openNotifications = computed(() => notifications.value.filter(({ acknowledged }) => acknowledged === null));

/** The name of this page's connection, such as `anna-3`. */
export const ownPage = signal("");
/** What was commanded, the newest last; undefined: this page may not know. */
export const pressed = signal<readonly Pressed[]>([]);
/** Lines that are kept. */
const MOST_PRESSED = 500;

export async function loadPressed(): Promise<void> {
  const count = people.past.at(null)?.value.commands ?? 0;
  const last = pressed.value.at(-1)?.number ?? 0;
  if (count < last) pressed.value = []; // another gateway counts from the start
  const since = count < last ? 0 : last;
  const { commands } = await link.call<{ commands: readonly Pressed[] }>(`${HMI}/commands`, { since });
  const known = pressed.value.at(-1)?.number ?? 0;
  pressed.value = [...pressed.value, ...commands.filter(({ number }) => number > known)].slice(-MOST_PRESSED);
}

/** Acknowledge notifications; returns why not, empty where it is done. */
export async function acknowledge(ids: readonly number[]): Promise<string> {
  try {
    const { success, message } = await link.call<{ success: boolean; message: string }>(`${HMI}/acknowledge`, { ids });
    return success ? "" : message;
  } catch (problem) {
    return problem instanceof Error ? problem.message : String(problem);
  }
}

/** Tell the others which view is open here, now and whenever that changes. */
export function startPeople(): void {
  const tell = (): void => {
    const view = route.value.split("/")[0] || "control";
    link.call<{ page: string }>(`${HMI}/here`, { view }).then(
      ({ page }) => (ownPage.value = person.value = page),
      () => undefined,
    );
  };
  link.opened.push(tell);
  let before = "";
  route.subscribe((now) => {
    const view = now.split("/")[0] ?? "";
    if (view !== before && link.state.peek() === "open") tell();
    before = view;
  });
}
