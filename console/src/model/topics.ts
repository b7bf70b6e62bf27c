// The topics that the console reads, each declared once. A view asks for one with `useTopic`.
import { batch, computed, signal, type ReadonlySignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { MSG_TYPES, type StdMsgsString as Text } from "../ros";
import { link } from "../wire/link";
import { atRobotTime, shownNow } from "./time/clock";
import { mode } from "./page";
import { moment, Past, shown, type Known } from "./time/past";

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
  /** What is forgotten first. */
  readonly minor?: (value: T) => boolean;
  /** Milliseconds after which it is there what it says of a step: at the moment of the step it is shown already. */
  readonly lag?: number;
  /** Seconds within which it speaks again, as long as its node lives. */
  readonly steady?: number;
}

/** A message, and when it arrived. */
export interface Arrived {
  readonly at: number;
  readonly msg: unknown;
}

export interface Topic<T> {
  readonly name: string;
  readonly past: Past<T>;
  /** What was known at the moment that is shown. */
  readonly shown: ReadonlySignal<Known<T> | undefined>;
  /** When a message arrived last, in the robot's milliseconds; also one that said nothing new. */
  readonly heardAt: ReadonlySignal<number | undefined>;
  /** When it was silent although it is a steady one: the time of the silence's begin, and of its end. */
  readonly silences: Past<number>;
  /** Take a message as if it arrived at a time: from the wire, or from a history. */
  readonly take: (message: unknown, at: number) => void;
  /** Take messages of a history, the oldest first. */
  readonly takeAll: (messages: readonly Arrived[]) => void;
  /** Read the topic until the function that is returned is called. */
  readonly follow: () => () => void;
}

/** All topics by their names. */
export const topics = new Map<string, Topic<unknown>>();
const always: Topic<unknown>[] = [];

export function topic<Message, T = Message>(name: string, type: string, how: How<Message, T>): Topic<T> {
  const past = new Past<T>(how.keep, how);
  const heardAt = signal<number | undefined>(undefined);
  const silences = new Past<number>(1000, { same: (one, other) => one === other });
  let readers = 0;
  let end = (): void => undefined;
  /** When it was heard last in the history, and by this page on the connection that it has. */
  const heard: { history?: number | undefined; wire?: number | undefined } = {};
  link.opened.push(() => {
    heard.history = heard.wire ?? heard.history;
    heard.wire = undefined;
  });
  const hear = (at: number, from: keyof typeof heard): void => {
    const last = heard[from];
    // In virtual time nobody is silent: it may go by faster than anybody speaks.
    const steady = mode.peek() === "simulation" ? undefined : how.steady;
    if (steady && last !== undefined && at - last > steady * 1000) silences.add(last, at);
    heard[from] = at;
  };
  const read = (message: unknown, arrived: number): Known<T> | undefined => {
    const at = how.when?.(message as Message) ?? arrived;
    const value = how.read(message as Message, at);
    return value === undefined ? undefined : { at, value };
  };
  const take = (message: unknown, arrived: number): void => {
    const found = read(message, arrived);
    hear(arrived, "wire");
    batch(() => {
      heardAt.value = Math.max(heardAt.peek() ?? 0, arrived);
      if (found) past.add(found.at, shared(past.at(null)?.value, found.value));
    });
  };
  const takeAll = (messages: readonly Arrived[]): void => {
    const found: Known<T>[] = [];
    for (const { msg, at } of messages) {
      const known = read(msg, at);
      hear(at, "history");
      if (known) found.push({ at: known.at, value: shared(found.at(-1)?.value, known.value) });
    }
    batch(() => {
      heardAt.value = Math.max(heardAt.peek() ?? 0, messages.at(-1)?.at ?? 0);
      past.addAll(found);
    });
  };
  const follow = (): (() => void) => {
    const heard = (message: unknown, at?: number): void => {
      if (at === undefined) atRobotTime((now) => take(message, now));
      else take(message, at);
    };
    if (readers++ === 0) end = link.subscribe(name, type, heard, how.throttle);
    return () => {
      if (--readers === 0) end();
    };
  };
  const made: Topic<T> = { name, past, shown: shown(past, how.lag), heardAt, silences, take, takeAll, follow };
  topics.set(name, made as Topic<unknown>);
  if (how.always) always.push(made as Topic<unknown>);
  return made;
}

/** A topic whose messages are records: JSON in a std_msgs/String. All is kept of a record, unless `read` says what. */
export function recordTopic<T>(name: string, how: Omit<How<T, T>, "read"> & Partial<Pick<How<T, T>, "read">>): Topic<T> {
  const { read = (record: T) => record, when, ...rest } = how;
  return topic<Text, T>(name, MSG_TYPES.StdMsgsString, {
    ...rest,
    read: (message, at) => {
      const record = json<T>(message);
      return record && read(record, at);
    },
    ...(when && {
      when: (message: Text) => {
        const record = json<T>(message);
        return record && when(record);
      },
    }),
  });
}

/** What a topic says at the moment that is shown; it is read as long as the component is there. */
export function useTopic<T>(wanted: Topic<T>): Known<T> | undefined {
  useEffect(() => wanted.follow(), [wanted]);
  return wanted.shown.value;
}

/** By topic and seconds: who asks draws anew when the answer changes, not at each message. */
const stale = new Map<string, ReadonlySignal<boolean>>();

/** Whether a topic is silent for so many seconds, now; of the past it is never said, nor of virtual time. */
export function isStale(wanted: Topic<unknown>, seconds: number): boolean {
  const key = `${wanted.name} ${seconds}`;
  const known = stale.get(key) ?? computed(() => isSilent(wanted, seconds));
  stale.set(key, known);
  return known.value;
}

function isSilent(wanted: Topic<unknown>, seconds: number): boolean {
  if (mode.value !== "robot" || moment.value !== null) return false;
  const heard = wanted.heardAt.value;
  return heard === undefined || shownNow.value - heard > seconds * 1000;
}

/** Whether two values of JSON are one. */
export function alike(one: unknown, other: unknown): boolean {
  if (one === other) return true;
  if (Array.isArray(one) && Array.isArray(other))
    return one.length === other.length && one.every((part, index) => alike(part, other[index]));
  if (!isPlain(one) || !isPlain(other)) return false;
  const names = Object.keys(one);
  return names.length === Object.keys(other).length && names.every((name) => name in other && alike(one[name], other[name]));
}

/**
 * A new value of JSON, with the parts that it has in common with an earlier one replaced by those, so that they are in
 * memory once; the earlier one itself where both are alike.
 */
function shared<T>(before: unknown, value: T): T;
function shared(before: unknown, value: unknown): unknown {
  if (before === value) return before;
  let same: boolean;
  if (Array.isArray(before) && Array.isArray(value)) {
    same = before.length === value.length;
    for (let index = 0; index < value.length; index++) {
      value[index] = shared(before[index], value[index]);
      same &&= value[index] === before[index];
    }
  } else if (isPlain(before) && isPlain(value)) {
    const names = Object.keys(value);
    same = names.length === Object.keys(before).length;
    for (const name of names) {
      value[name] = shared(before[name], value[name]);
      same &&= name in before && value[name] === before[name];
    }
  } else return value;
  return same ? before : value;
}

function isPlain(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && Object.getPrototypeOf(value) === Object.prototype;
}

/** JSON in a std_msgs/String; what is no JSON is nothing. */
export function json<T>({ data }: { data: string }): T | undefined {
  if (data !== parsed.data) parsed = { data, value: parse(data) };
  return parsed.value as T | undefined;
}

/** What was read last: who asks for its time and then for its value reads it once. */
let parsed: { readonly data: string; readonly value: unknown } = { data: "", value: undefined };

function parse(data: string): unknown {
  try {
    return JSON.parse(data);
  } catch {
    return undefined;
  }
}

export function startTopics(): void {
  for (const each of always) each.follow();
}
