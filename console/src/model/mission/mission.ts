// What the orchestrator tells, as types and topics; docs/operating.md, "For programs", says what each field is.
import { computed, effect, signal } from "@preact/signals";
import { MSG_TYPES, type CommandResponse, type MissionState, type Observation } from "../../ros";
import { link } from "../../wire/link";
import { alike, recordTopic, topic } from "../topics";

const ORCHESTRATOR = "/mission_orchestrator";
/** Seconds without a word after which the orchestrator is silent; the history has a sign of life every 2 s. */
const SILENT_S = 5;
/** Milliseconds that what follows from a step may take until it is told, on a busy machine. */
const LAG_MS = 150;

/** An operation under way. Without a `deadline` it has none, or a hold has stopped its clock. */
export interface Attempt {
  readonly state: string;
  readonly operation: string;
  readonly tries: number;
  readonly phase: string;
  readonly detail: string;
  readonly deadline: number | null;
  /** How long it may take in all, in seconds. */
  readonly limit: number | null;
  /** The seconds that remain of a clock that a hold has stopped. */
  readonly left: number | null;
}

/** What a state does by itself later; `left` seconds remain of a clock that a hold has stopped. */
export interface Countdown {
  readonly state: string;
  /** `after.0`, `every.0`, `at.0`, `budget` or `retry`. */
  readonly event: string;
  readonly deadline: number | null;
  readonly left: number | null;
}

export interface Question {
  readonly state: string;
  readonly question: string;
  readonly choices: readonly { readonly name: string; readonly label: string }[];
  readonly default: string;
  readonly deadline: number | null;
  readonly left: number | null;
}

/** What is to be seen after a step. Counts stand beside these under the profile's names (`completed`, ...). */
export interface View {
  readonly configuration: readonly string[];
  readonly lifecycle: string;
  readonly phase: string;
  readonly mission: string;
  readonly mission_id: string;
  readonly started_at: number | null;
  readonly target: string;
  readonly total: number;
  readonly code: string;
  readonly detail: string;
  readonly asking: readonly Question[];
  readonly held: readonly string[];
  readonly holds: Readonly<Record<string, string>>;
  readonly paused: boolean;
  readonly attempts: readonly Attempt[];
  readonly cancelling: readonly string[];
  readonly countdowns?: readonly Countdown[];
  readonly [count: string]: unknown;
}

export interface Told {
  readonly code: string;
  readonly label: string;
  readonly severity: number;
  readonly detail: string;
  readonly target: string;
}

export interface Step {
  readonly sequence: number;
  readonly time: number;
  readonly event: string;
  readonly data: Readonly<Record<string, unknown>>;
  readonly configuration: readonly string[];
  readonly taken?: readonly string[];
  readonly exited?: readonly string[];
  readonly entered?: readonly string[];
  readonly commands?: readonly Readonly<Record<string, unknown>>[];
  readonly notes?: readonly string[];
  readonly why?: readonly string[];
  readonly accepted?: boolean;
  readonly refusal?: { readonly code: string; readonly text: string };
  readonly codes?: readonly Told[];
}

/** A record of /mission_orchestrator/steps. `time` is of the clock by which deadlines in `view` are told. */
export interface StepRecord {
  readonly time: number;
  readonly stamp: number;
  readonly wall_ns: number;
  readonly boot: string;
  readonly chart: string;
  readonly command?: { readonly by?: string; readonly command_id?: string };
  readonly step: Step;
  readonly view: View;
}

/** What one request would do now. */
export interface Possible {
  readonly request: string;
  readonly verb: string;
  readonly mission: string;
  readonly possible: boolean;
  readonly engages: readonly string[];
  readonly releases: readonly string[];
  readonly code: string;
  readonly reason: string;
  /** Of a start: nothing but the defaults of its request keeps it from beginning. */
  readonly fields?: boolean;
}

/** A field of a request; of a list, kind, unit, range and pattern are those of its elements. */
export interface RequestField {
  readonly name: string;
  readonly type: string;
  /** `name` is that of something which a plugin finds by it, such as a tag. */
  readonly kind: "bool" | "integer" | "number" | "text" | "name" | "list" | "record" | "any";
  readonly summary?: string;
  readonly unit?: string;
  readonly allowed?: readonly string[];
  readonly pattern?: string;
  readonly example?: string;
  readonly required: boolean;
  readonly default?: unknown;
  readonly computed?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly at_most?: number;
  readonly may_be_empty?: boolean;
}

export interface OfferedMission {
  readonly mission: string;
  readonly file: string;
  readonly summary: string;
  readonly request: readonly RequestField[];
}

/** What is said of a code; severity 0 is information, 1 a warning, 2 an error. */
export interface CodeText {
  readonly label: string;
  readonly severity: number;
  readonly advice: string;
}

/** A way in which a visit can end; views have how many did under the name `counter`. */
export interface Outcome {
  readonly name: string;
  readonly counter: string;
  readonly word: string;
  readonly rating: "good" | "bad" | "left out";
}

/** The missions with what is said of them once. `holds` are the codes of the holds, `ends` is the verb of an abort. */
export interface Offer {
  readonly missions: readonly OfferedMission[];
  readonly problems: readonly string[];
  readonly codes: Readonly<Record<string, CodeText>>;
  readonly holds: Readonly<Record<string, string>>;
  readonly outcomes: readonly Outcome[];
  readonly stages: Readonly<Record<"starting" | "ready" | "returning" | "ended" | "faulted", readonly string[]>>;
  readonly ends: string;
}

export interface Place {
  readonly file: string;
  readonly line: number;
}

export interface StateRecord extends Place {
  readonly id: string;
  readonly summary?: string;
}

export interface TransitionRecord extends Place {
  readonly state?: string;
  readonly target?: string;
  readonly label?: string;
  /** The code that it refuses a request with; it is not in the picture then. */
  readonly refuse?: string;
}

export interface ChartRecord {
  readonly hash: string;
  readonly boot: string;
  readonly missions: readonly string[];
  /** Its picture; "" while it is drawn, and where it cannot be. */
  readonly svg: string;
  /** Why there is no picture and will be none. */
  readonly problem?: string;
  readonly states: Readonly<Record<string, StateRecord>>;
  readonly transitions: Readonly<Record<string, TransitionRecord>>;
  readonly files: Readonly<Record<string, string>>;
}

export const state = topic<MissionState, Omit<MissionState, "header">>("/mission/state", MSG_TYPES.MissionState, {
  keep: 2000,
  always: true,
  read: ({ header: _, ...rest }) => rest,
  same: alike,
  steady: SILENT_S,
  lag: LAG_MS,
});

export const steps = recordTopic<StepRecord>(`${ORCHESTRATOR}/steps`, {
  keep: 5000,
  always: true,
  read: (record) => (record.step && record.view ? record : undefined),
  when: ({ wall_ns }) => (wall_ns ? wall_ns / 1e6 : undefined),
  same: (one, other) => one.boot === other.boot && one.step.sequence === other.step.sequence,
  minor: ({ step }) => step.event === "attempt.progress",
});

export const possible = recordTopic<{ sequence: number; requests: readonly Possible[] }>(`${ORCHESTRATOR}/possible`, {
  keep: 500,
  always: true,
  same: alike,
  lag: LAG_MS,
});

/** What an orchestrator of an earlier version did not tell; recordings are kept for long. */
const UNTOLD: Offer = {
  missions: [],
  problems: [],
  codes: {},
  holds: {},
  outcomes: [],
  stages: { starting: [], ready: [], returning: [], ended: [], faulted: [] },
  ends: "",
};

export const missions = recordTopic<Offer>(`${ORCHESTRATOR}/missions`, {
  keep: 200,
  always: true,
  read: (told) => ({ ...UNTOLD, ...told }),
  same: alike,
});

export const chart = recordTopic<ChartRecord>(`${ORCHESTRATOR}/chart`, {
  keep: 20,
  always: true,
  same: (one, other) => one.hash === other.hash && one.boot === other.boot && isDrawn(one) === isDrawn(other),
});

/** Whether all is told of a chart: what it is comes first, its picture when it has been drawn. */
function isDrawn({ svg, problem }: ChartRecord): boolean {
  return Boolean(svg || problem);
}

/** The picture of a chart, as soon as it is told; fails with the reason why there is none. */
export function wholePicture(hash: string): Promise<string> {
  return new Promise((done, failed) => {
    const end = effect(() => {
      const found = chart.past.until(null).findLast(({ value }) => value.hash === hash && isDrawn(value))?.value;
      if (!found) return;
      if (found.svg) done(found.svg);
      else failed(new Error(found.problem));
      queueMicrotask(() => end());
    });
  });
}

export const observations = topic<Observation>("/floranova/observations", MSG_TYPES.Observation, {
  keep: 500,
  always: true,
  read: (message) => message,
  when: ({ header }) => header.stamp.sec * 1000 + header.stamp.nanosec / 1e6 || undefined,
  same: alike,
});

/** The view after the last step at the moment that is shown. */
export const view = computed(() => steps.shown.value?.value.view);

/** Whether a published state is one in which the mission has failed. */
export function isFault(lifecycle: string): boolean {
  return !!missions.past.at(null)?.value.stages.faulted.includes(lifecycle);
}

/** The answer to what was commanded from this page. */
export interface Answered {
  readonly verb: string;
  readonly mission: string;
  readonly accepted: boolean;
  readonly text: string;
  readonly code: string;
}

/** The answer to what was commanded last from this page. */
export const answered = signal<Answered | undefined>(undefined);
/** The verb that is being asked just now, one at a time; "": none. */
export const asking = signal("");
/** Who this page's commands are from, for the record. */
export const person = signal("console");

/** Command the orchestrator; the answer is shown by whoever shows `answered`. Never fails. */
export async function command(verb: string, mission = "", request: object = {}): Promise<Answered> {
  asking.value = verb;
  const sent = {
    verb,
    mission,
    request: Object.keys(request).length ? JSON.stringify(request) : "",
    command_id: crypto.randomUUID?.() ?? `${performance.timeOrigin}-${performance.now()}`,
    by: person.value,
  };
  let answer: Answered;
  try {
    const { accepted, message, code } = await link.call<CommandResponse>(`${ORCHESTRATOR}/command`, sent);
    answer = { verb, mission, accepted, text: message, code };
  } catch (problem) {
    const text = problem instanceof Error ? problem.message : String(problem);
    answer = { verb, mission, accepted: false, text, code: "" };
  }
  asking.value = "";
  answered.value = answer;
  return answer;
}
