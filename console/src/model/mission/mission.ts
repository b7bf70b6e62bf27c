// The orchestrator's topics of records; docs/operating.md, "For programs", explains each field.
import { computed, effect, signal } from "@preact/signals";
import { MSG_TYPES, type CommandResponse, type MissionState, type Observation } from "../../ros";
import { link } from "../../wire/link";
import { alike, recordTopic, topic } from "../topics";
import type { ChartRecord, MissionsRecord, PublishedPossible, StepRecord } from "../../records";

const ORCHESTRATOR = "/mission_orchestrator";
/** Seconds without a word after which the orchestrator is silent; the history has a sign of life every 2 s. */
const SILENT_S = 5;
/** Milliseconds that what follows from a step may take until it is told, on a busy machine. */
const LAG_MS = 150;

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

export const possible = recordTopic<PublishedPossible>(`${ORCHESTRATOR}/possible`, {
  keep: 500,
  always: true,
  same: alike,
  lag: LAG_MS,
});

/** What an orchestrator of an earlier version did not tell; recordings are kept for long. */
const UNTOLD: MissionsRecord = {
  missions: [],
  problems: [],
  codes: {},
  holds: {},
  outcomes: [],
  stages: { starting: [], ready: [], returning: [], ended: [], faulted: [] },
  ends: "",
};

export const missions = recordTopic<MissionsRecord>(`${ORCHESTRATOR}/missions`, {
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
