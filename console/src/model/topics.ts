// The topics that the console reads, each declared once. A view asks for one with `useTopic`.
import { signal, type ReadonlySignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { link } from "../wire/link";
import { robotNow } from "./clock";
import { moment, Past, shown, type Known } from "./past";

interface How<Message, T> {
  /** Values that are kept; the oldest are forgotten beyond. */
  readonly keep: number;
  /** At least so many milliseconds lie between two messages. */
  readonly throttle?: number;
  /** It is read from the start on, whether or not a view shows it, because its past counts. */
  readonly always?: boolean;
  /** When a message was, where it says so; else when it arrived. */
  readonly when?: (message: Message) => number | undefined;
  /** The value of a message, and when it was; `undefined` is not kept. */
  readonly read: (message: Message, at: number) => T | undefined;
  /** Whether two values are one: the later one is not kept. */
  readonly same?: (one: T, other: T) => boolean;
}

export interface Topic<T> {
  readonly name: string;
  readonly past: Past<T>;
  /** What was known at the moment that is shown. */
  readonly shown: ReadonlySignal<Known<T> | undefined>;
  /** When a message arrived last, in the robot's milliseconds; also one that said nothing new. */
  readonly heardAt: ReadonlySignal<number | undefined>;
  /** Take a message as if it arrived at a time: from the wire, or from a history. */
  readonly take: (message: unknown, at: number) => void;
  /** Read the topic until the function that is returned is called. */
  readonly follow: () => () => void;
}

/** All topics by their names. */
export const topics = new Map<string, Topic<unknown>>();
const always: Topic<unknown>[] = [];

export function topic<Message, T = Message>(name: string, type: string, how: How<Message, T>): Topic<T> {
  const past = new Past<T>(how.keep);
  const heardAt = signal<number | undefined>(undefined);
  let readers = 0;
  let end = (): void => undefined;
  const take = (message: unknown, arrived: number): void => {
    heardAt.value = Math.max(heardAt.peek() ?? 0, arrived);
    const at = how.when?.(message as Message) ?? arrived;
    const value = how.read(message as Message, at);
    if (value === undefined) return;
    const before = past.at(at);
    if (before && how.same?.(before.value, value)) return;
    past.add(at, value);
  };
  const follow = (): (() => void) => {
    if (readers++ === 0) end = link.subscribe(name, type, (message) => take(message, robotNow()), how.throttle);
    return () => {
      if (--readers === 0) end();
    };
  };
  const made: Topic<T> = { name, past, shown: shown(past), heardAt, take, follow };
  topics.set(name, made as Topic<unknown>);
  if (how.always) always.push(made as Topic<unknown>);
  return made;
}

/** What a topic says at the moment that is shown; it is read as long as the component is there. */
export function useTopic<T>(wanted: Topic<T>): Known<T> | undefined {
  useEffect(() => wanted.follow(), [wanted]);
  return wanted.shown.value;
}

/** Whether a topic is silent for so many seconds, now; of the past it is never said. */
export function isStale(wanted: Topic<unknown>, seconds: number): boolean {
  const heard = wanted.heardAt.value;
  return moment.value === null && (heard === undefined || robotNow() - heard > seconds * 1000);
}

/** Values of JSON are one when they are written alike. */
export function alike(one: unknown, other: unknown): boolean {
  return JSON.stringify(one) === JSON.stringify(other);
}

/** JSON in a std_msgs/String; what is no JSON is nothing. */
export function json<T>(message: { data: string }): T | undefined {
  try {
    return JSON.parse(message.data) as T;
  } catch {
    return undefined;
  }
}

export function startTopics(): void {
  for (const each of always) each.follow();
}
