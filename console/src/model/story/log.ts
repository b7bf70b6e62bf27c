// The log and the timeline of all that is known, as signals.
import { computed, effect, signal, type ReadonlySignal } from "@preact/signals";
import { Observation } from "../../ros";
import { link, type LinkState } from "../../wire/link";
import { robotNow } from "../time/clock";
import { isLoading } from "../time/history";
import { isFault, observations, state, steps } from "../mission/mission";
import { mode, texts } from "../page";
import { Past, type Known } from "../time/past";
import { StepStory, type Entry, type Span, type Words } from "./story";
import { alike, recordTopic } from "../topics";
import type { BaseRecord, StopsRecord } from "../../records";

/** Which software stops are engaged; the page's own button for it stands outside of the console. */
export const stops = recordTopic<StopsRecord>("/lupin/hmi/stops", {
  keep: 1000,
  always: true,
  same: (one, other) => one.stopped === other.stopped && one.stops.map(({ name }) => name).join() === other.stops.map(({ name }) => name).join(),
});

/** Who may move the robot, as the gateway has it. */
export const base = recordTopic<BaseRecord>("/lupin/hmi/base", {
  keep: 1000,
  always: true,
  read: (record) => (Array.isArray(record.stops) ? record : undefined),
  same: alike,
});

/** How the connection of this page was. */
const links = new Past<LinkState>(1000);

export function startLog(): void {
  effect(() => {
    const now = link.state.value;
    if (now !== "connecting") links.add(robotNow(), now);
  });
}

/** Values that are read at once: then the page answers what was pressed. */
const PORTION = 5000;

interface Reader<T> {
  /** How much it has told. */
  readonly told: number;
  read(known: Known<T>): void;
}

/** A reader that has read all of a past, as far as it has been loaded; it goes on where it stopped, if it can. */
function readOn<T, R extends Reader<T>>(past: Past<T>, made: (words: Words) => R): ReadonlySignal<{ readonly reader: R }> {
  let state: { reader: R; edition: number; words: Words; next: number } | undefined;
  let shown: { reader: R; told: number } | undefined;
  const goOn = signal(0);
  return computed(() => {
    const words = texts.value.log;
    if (isLoading.value && shown) return shown;
    const { list, edition } = past.standing();
    if (state?.edition !== edition || state.words !== words) state = { reader: made(words), edition, words, next: 0 };
    const end = Math.min(list.length, state.next + PORTION);
    while (state.next < end) readOne(state.reader, list[state.next++]!);
    if (end < list.length) {
      void goOn.value;
      setTimeout(() => goOn.value++);
      if (shown) return shown;
    }
    // Who shows it is not troubled by what tells nothing.
    const { reader } = state;
    if (shown?.reader !== reader || shown.told !== reader.told) shown = { reader, told: reader.told };
    return shown;
  });
}

/** What cannot be told, because it is not as it should be, keeps nothing else from being told. */
function readOne<T>(reader: Reader<T>, known: Known<T>): void {
  try {
    reader.read(known);
  } catch (problem) {
    console.warn("left out of the log:", known, problem);
  }
}

class ObservationStory implements Reader<Observation> {
  readonly entries: Entry[] = [];

  get told(): number {
    return this.entries.length;
  }

  constructor(private readonly words: Words) {}

  read({ at, value }: Known<Observation>): void {
    const { words } = this;
    // Whoever tells it may leave out what its kind does not have.
    const { kind = Observation.KIND_TAG_READING, status = Observation.STATUS_OK, tag_reading, flower, anomaly }: Partial<Observation> = value;
    const target = tag_reading?.tag_id || flower?.tag_id || "";
    const values = tag_reading?.readings?.map(({ name, value: number }) => `${name} ${number?.toPrecision(4) ?? "–"}`) ?? [];
    const seen = [flower?.species, flower?.anomaly ? words.anomaly : ""];
    const about = kind === Observation.KIND_FLOWER ? seen : kind === Observation.KIND_ANOMALY ? [anomaly?.description] : values;
    const text = [words.statuses[status] ?? String(status), value.status_detail, ...about].filter(Boolean).join(", ");
    const isOdd = status !== Observation.STATUS_OK || kind === Observation.KIND_ANOMALY || flower?.anomaly;
    this.entries.push({ at, kind: "target", severity: isOdd ? 1 : 0, text: `${words.kinds[kind] ?? kind}: ${text}`, target });
  }
}

class StopStory implements Reader<StopsRecord> {
  readonly entries: Entry[] = [];
  readonly spans: Span[] = [];

  get told(): number {
    return this.entries.length;
  }

  constructor(private readonly words: Words) {}

  read({ at, value }: Known<StopsRecord>): void {
    const names = value.stops.map(({ name }) => name).join(", ");
    const last = this.spans.at(-1);
    const isOpen = last !== undefined && last.to === undefined;
    if (isOpen && (!value.stopped || last.text !== names)) last.to = at;
    if (value.stopped && !(isOpen && last.text === names)) {
      this.spans.push({ from: at, to: undefined, text: names, severity: 2 });
      this.entries.push({ at, kind: "stop", severity: 2, text: this.words.stopped(names) });
    } else if (isOpen && !value.stopped) this.entries.push({ at, kind: "stop", severity: 0, text: this.words.stopReleased });
  }
}

export const stepStory = readOn(steps.past, (words) => new StepStory(words, isFault));
const observationStory = readOn(observations.past, (words) => new ObservationStory(words));
export const stopStory = readOn(stops.past, (words) => new StopStory(words));

/** When this page was not connected, the orchestrator was silent, or another one was started. */
export const gaps = computed<readonly Span[]>(() => {
  const words = texts.value.log;
  const lost: Span[] = [];
  for (const { at, value } of links.until(null)) {
    const last = lost.at(-1);
    if (value === "lost") lost.push({ from: at, to: undefined, text: words.linkLost, severity: 2 });
    else if (last) last.to ??= at;
  }
  // In a simulation nothing is told again while nothing happens.
  const silences = mode.value === "simulation" ? [] : state.silences.until(null);
  const silent = silences.map(({ at, value }): Span => ({ from: at, to: value, text: words.silent, severity: 2 }));
  const isCovered = (gap: Span): boolean => silent.some(({ from, to }) => from < gap.to! + 1000 && to! > gap.from);
  const anew = stepStory.value.reader.gaps.filter((gap) => !isCovered(gap));
  return [...lost, ...silent, ...anew].sort(byBegin);
});

function byBegin(one: Span, other: Span): number {
  return one.from - other.from;
}

/** All that happened, the oldest first. */
export const entries = computed<readonly Entry[]>(() => {
  const words = texts.value.log;
  const broken = gaps.value.flatMap(({ from, to, text, severity }): Entry[] => [
    ...(text === words.newBoot ? [] : [{ at: from, kind: "connection", severity, text } as const]),
    ...(text === words.linkLost && to !== undefined ? [{ at: to, kind: "connection", severity: 0, text: words.linkBack } as const] : []),
  ]);
  const all = [...stepStory.value.reader.entries, ...observationStory.value.reader.entries, ...stopStory.value.reader.entries, ...broken];
  return all.sort((one, other) => one.at - other.at);
});

/** Warnings and errors, the oldest first. */
export const problems = computed(() => entries.value.filter(({ severity }) => severity > 0));

/** When the first thing was that is known. */
export const begin = computed(() => {
  const pasts = [state.past.standing(), steps.past.standing()];
  const firsts = [entries.value[0]?.at, ...pasts.map(({ list }) => list[0]?.at)].filter((at) => at !== undefined);
  return firsts.length ? Math.min(...firsts) : undefined;
});

/** The last of a list before a time, or the first after it. */
export function neighbour<T extends { readonly at: number }>(list: readonly T[], at: number, direction: 1 | -1): T | undefined {
  return direction < 0 ? list.findLast((each) => each.at < at) : list.find((each) => each.at > at);
}

