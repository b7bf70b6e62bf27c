// What happened in a span of time, counted from the past that this page has.
import { MissionState, Observation } from "../../ros";
import { stops } from "./log";
import { observations, state, steps } from "../mission/mission";
import { notifications, pressed, type Pressed } from "../people";
import type { Known } from "../time/past";
import type { Notification, StepRecord } from "../../records";

export interface MissionRun {
  readonly id: string;
  readonly type: string;
  readonly began: number;
  /** Undefined: it is under way. */
  readonly ended: number | undefined;
  /** The lifecycle state in which it was seen last. */
  readonly lifecycle: string;
  readonly total: number;
  readonly completed: number;
  readonly failed: number;
  readonly unreachable: number;
  readonly skipped: number;
}

/** Something odd at a tag, seen so many times. */
export interface Anomaly {
  readonly first: number;
  readonly last: number;
  readonly times: number;
  readonly tag: string;
  readonly text: string;
}

export interface Code {
  readonly at: number;
  readonly severity: number;
  readonly code: string;
  readonly text: string;
  readonly target: string;
}

export interface StopSpan {
  readonly began: number;
  /** Undefined: it is still engaged. */
  readonly ended: number | undefined;
  readonly by: string;
}

export interface Shift {
  readonly from: number;
  readonly to: number;
  /** From when on this page knows what happened; later than `from` where its past is shorter. */
  readonly knownFrom: number | undefined;
  readonly missions: readonly MissionRun[];
  readonly anomalies: readonly Anomaly[];
  readonly interventions: readonly { readonly at: number; readonly by: string; readonly what: string; readonly accepted: boolean; readonly answer: string }[];
  readonly stops: readonly StopSpan[];
  readonly faults: readonly Code[];
  readonly notifications: readonly Notification[];
}

function runs(from: number, to: number): MissionRun[] {
  const found = new Map<string, MissionRun>();
  for (const { at, value } of state.past.between(from, to)) {
    if (!value.mission_id) continue;
    const before = found.get(value.mission_id);
    const over = ["READY", "DONE", "FAULT"].includes(value.lifecycle_state);
    found.set(value.mission_id, {
      id: value.mission_id,
      type: value.mission_type || before?.type || "",
      began: before?.began ?? (value.started_at.sec ? Math.max(from, value.started_at.sec * 1000) : at),
      // After its end the state of the last mission stands until the next begins.
      ended: over ? (before?.ended ?? at) : undefined,
      lifecycle: value.lifecycle_state,
      total: value.targets_total,
      completed: value.targets_completed,
      failed: value.targets_failed,
      unreachable: value.targets_unreachable,
      skipped: value.targets_skipped,
    });
  }
  return [...found.values()];
}

function anomalies(from: number, to: number): Anomaly[] {
  const found = new Map<string, Anomaly>();
  for (const { at, value } of observations.past.between(from, to)) {
    const { kind, flower, anomaly } = value;
    if (kind !== Observation.KIND_ANOMALY && !(kind === Observation.KIND_FLOWER && flower.anomaly)) continue;
    const [tag, text] = kind === Observation.KIND_ANOMALY ? [value.tag_reading.tag_id, anomaly.description] : [flower.tag_id, flower.species];
    const before = found.get(`${tag} ${text}`);
    found.set(`${tag} ${text}`, { first: before?.first ?? at, last: at, times: (before?.times ?? 0) + 1, tag, text });
  }
  return [...found.values()];
}

function faults(from: number, to: number): Code[] {
  return steps.past.between(from, to).flatMap(({ at, value }) =>
    (value.step.codes ?? [])
      .filter(({ severity }) => severity >= MissionState.SEVERITY_WARN)
      .map(({ severity, code, label, detail, target }) => ({
        at,
        severity,
        code,
        text: [label, detail].filter(Boolean).join(": "),
        target,
      })),
  );
}

/** What people asked of the mission, from its steps; and all else that they commanded, where this page may know. */
function interventions(from: number, to: number): Shift["interventions"] {
  const asked = steps.past.between(from, to).flatMap(({ at, value }) => (value.command ? [ofStep(at, value)] : []));
  const ids = steps.past.between(from, to).flatMap(({ value }) => value.command?.command_id || []);
  const other = pressed.value.filter((line) => isIntervention(line) && !ids.some((id) => line.sent.includes(id))).map((line) => ({
    at: Date.parse(line.wall),
    by: line.page || line.who,
    what: `${line.name} ${line.sent === "{}" ? "" : line.sent}`.trim(),
    accepted: line.accepted !== false,
    answer: line.answer ?? "",
  }));
  return [...asked, ...other.filter(({ at }) => at >= from && at <= to)].sort((one, another) => one.at - another.at);
}

function ofStep(at: number, { step, command }: StepRecord) {
  const accepted = step.accepted !== false;
  const page = command?.command_id && pressed.value.find(({ sent }) => sent.includes(command.command_id!))?.page;
  return { at, by: page || (command?.by ?? ""), what: step.event, accepted, answer: step.refusal?.text ?? "" };
}

/** Driving by hand is not listed: that is a message many times a second; stops have a table of their own. */
function isIntervention({ name, what }: Pressed): boolean {
  return what !== "publish" && !name.startsWith("/lupin/hmi/");
}

function stopSpans(from: number, to: number): StopSpan[] {
  const spans: StopSpan[] = [];
  let engaged: Known<string> | undefined;
  const close = (ended: number | undefined): void => {
    if (engaged && (ended ?? to) >= from) spans.push({ began: engaged.at, ended, by: engaged.value });
    engaged = undefined;
  };
  for (const { at, value } of stops.past.until(to)) {
    const by = value.stops.map(({ name }) => name).join(", ");
    if (value.stopped && !engaged) engaged = { at, value: by };
    else if (!value.stopped && engaged) close(at);
  }
  close(undefined);
  return spans;
}

/** Count what happened between two times, in the robot's milliseconds. */
export function shift(from: number, to: number): Shift {
  const firsts = [state.past.until(to)[0]?.at, steps.past.until(to)[0]?.at].filter((at) => at !== undefined);
  return {
    from,
    to,
    knownFrom: firsts.length ? Math.min(...firsts) : undefined,
    missions: runs(from, to),
    anomalies: anomalies(from, to),
    interventions: interventions(from, to),
    stops: stopSpans(from, to),
    faults: faults(from, to),
    notifications: notifications.value.filter(({ first, last }) => last * 1000 >= from && first * 1000 <= to),
  };
}
