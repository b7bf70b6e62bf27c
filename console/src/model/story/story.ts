// What happened, told from the steps: lines of the log, and spans of the timeline.
import type { Texts } from "../../texts/en";
import type { Known } from "../time/past";
import type { CodeEvent, Step, StepRecord, View } from "../../records";

export const KINDS = ["command", "state", "operation", "target", "hold", "question", "code", "stop", "connection", "other"] as const;
export type Kind = (typeof KINDS)[number];
/** 0 is information, 1 a warning, 2 an error. */
export type Severity = 0 | 1 | 2;

/** A line of the log. */
export interface Entry {
  readonly at: number;
  readonly kind: Kind;
  readonly severity: Severity;
  readonly text: string;
  readonly target?: string;
  /** Of a step: the states that it led to as they are read, and the innermost one by its full name. */
  readonly moved?: string;
  readonly state?: string;
  readonly commands?: readonly string[];
  readonly notes?: readonly string[];
  readonly sequence?: number;
}

/** Something that lasted; without `to` it lasts still. */
export interface Span {
  readonly from: number;
  to: number | undefined;
  readonly text: string;
  severity: Severity;
  readonly state?: string | undefined;
}

export type Words = Texts["log"];

/** The longest text of a value. */
const LONGEST = 48;

/** A state's name as it is published: without the slot and the mission that stands in it. */
export function shortName(state: string, mission: string): string {
  const inside = mission ? state.lastIndexOf(`.${mission}.`) : -1;
  return inside < 0 ? state : state.slice(inside + mission.length + 2);
}

/** Of states those that have none of them inside. */
function innermost(states: readonly string[]): readonly string[] {
  return states.filter((state) => state && !states.some((other) => other.startsWith(`${state}.`)));
}

/** A value in few letters. */
export function short(value: unknown): string {
  let text: string;
  if (typeof value === "number") text = String(Number(value.toPrecision(4)));
  else if (Array.isArray(value)) text = `[${value.map(short).join(", ")}]`;
  else if (typeof value === "object" && value)
    text = Object.entries(value)
      .map(([name, part]) => `${name} ${short(part)}`)
      .join(", ");
  else text = String(value);
  return text.length <= LONGEST ? text : `${text.slice(0, LONGEST - 1)}…`;
}

type Command = NonNullable<Step["commands"]>[number];

function commandText(command: Command, words: Words): string {
  switch (command.command) {
    case "start":
      return (command.updates ? words.update : words.start)(command.operation + filled(command.arguments));
    case "cancel":
      return words.cancel(command.operation);
    case "act":
      return command.action + filled(command.arguments);
    case "publish": {
      const why = command.detail || command.code;
      return `${command.target} ${command.status}${why ? ` (${why})` : ""}`;
    }
    case "report":
      return words.report(command.visits?.length ?? 0);
    default:
      return String((command satisfies never as Command).command);
  }
}

function filled(given: Readonly<Record<string, unknown>> = {}): string {
  const parts = Object.entries(given).map(([name, value]) => `${name}: ${short(value)}`);
  return parts.length ? `(${parts.join(", ")})` : "";
}

/** An attempt of an operation that is under way. */
interface Running {
  readonly operation: string;
  readonly state: string;
  readonly span: Span;
}

/** The rows of the timeline that are not of an operation. */
export const LIFECYCLE = "lifecycle";
export const PHASE = "phase";
export const HOLDS = "holds";
export const TARGET = "target";
/** How the rows of operations begin. */
export const OPERATION = "operation ";

/** Reads steps, the oldest first, and tells them. */
export class StepStory {
  readonly entries: Entry[] = [];
  /** The spans of each row, in the order of time. */
  readonly rows = new Map<string, Span[]>([LIFECYCLE, PHASE, TARGET, HOLDS].map((row) => [row, []]));
  /** From the last step of an orchestrator to the first of the next one. */
  readonly gaps: Span[] = [];
  private readonly running = new Map<string, Running>();
  private last: Known<StepRecord> | undefined;
  private ends = 0;

  /** `isFault`: whether a published state is one in which the mission has failed. */
  constructor(
    private readonly words: Words,
    private readonly isFault: (lifecycle: string) => boolean,
  ) {}

  /** How much has been told: more after each step that tells something. */
  get told(): number {
    let told = this.entries.length + this.ends;
    for (const spans of this.rows.values()) told += spans.length;
    return told;
  }

  read(known: Known<StepRecord>): void {
    const { at, value } = known;
    const before = this.last?.value;
    if (before && before.boot !== value.boot) this.startAnew(at);
    this.tellStep(at, value);
    this.tellHolds(at, before?.boot === value.boot ? before.view : undefined, value);
    const severity = this.isFault(value.view.lifecycle) ? 2 : 0;
    this.follow(LIFECYCLE, at, value.view.lifecycle, severity);
    this.follow(PHASE, at, value.view.phase, severity);
    this.follow(TARGET, at, value.view.target);
    this.followOperations(at, value, before?.view);
    this.last = known;
  }

  private startAnew(at: number): void {
    const from = this.last!.at;
    for (const spans of this.rows.values()) {
      for (let index = spans.length - 1; index >= 0 && spans[index]!.to === undefined; index--) spans[index]!.to = from;
    }
    this.running.clear();
    this.gaps.push({ from, to: at, text: this.words.newBoot, severity: 2 });
    this.entries.push({ at, kind: "connection", severity: 2, text: this.words.newBoot });
  }

  private tellStep(at: number, { step, view, command }: StepRecord): void {
    const { words } = this;
    const isNews = step.event === "value" && typeof step.data?.["value"] !== "object";
    const isTold = step.entered ?? step.exited ?? step.taken ?? step.commands ?? step.notes ?? step.why ?? step.codes ?? step.accepted;
    if (isTold === undefined && !isNews) return;
    const codes = step.codes ?? [];
    const details = new Set(codes.map(({ detail }) => detail));
    const notes = [...(step.notes ?? []).filter((note) => !details.has(note)), ...(step.refusal ? [] : (step.why ?? []))];
    const moved = innermost(step.entered ?? []);
    const commands = (step.commands ?? []).map((each) => commandText(each, words));
    const changed = moved.length || commands.length || step.taken?.length || step.exited?.length;
    if (changed || notes.length || step.accepted !== undefined || isNews) {
      const mission = view.mission;
      const here = moved.filter((state) => step.configuration.includes(state));
      const passed = moved.filter((state) => !here.includes(state)).map((state) => shortName(state, mission));
      const there = here.map((state) => shortName(state, mission)).join(" + ");
      this.entries.push({
        at,
        kind: this.kindOf(step, moved.length > 0),
        severity: step.accepted === false || step.event === "attempt.failed" ? 1 : 0,
        text: this.eventText(step, command?.by),
        target: view.target,
        moved: [...passed, ...(there ? [there] : [])].join(" → "),
        state: here[0] ?? "",
        commands,
        notes,
        sequence: step.sequence,
      });
    }
    for (const code of codes) this.entries.push(this.codeEntry(at, code, step.sequence));
  }

  private codeEntry(at: number, code: CodeEvent, sequence: number): Entry {
    const severity = Math.min(2, Math.max(0, code.severity)) as Severity;
    const text = [code.label || code.code, code.detail].filter(Boolean).join(": ");
    return { at, kind: "code", severity, text, target: code.target, notes: [code.code], sequence };
  }

  private kindOf({ event, accepted }: Step, moved: boolean): Kind {
    if (accepted !== undefined) return "command";
    if (moved) return "state";
    return event.startsWith("attempt.") ? "operation" : "other";
  }

  private eventText(step: Step, by: string | undefined): string {
    const { words } = this;
    const { event, data = {} } = step;
    if (step.accepted !== undefined) {
      const mission = event === "mission.start" ? ` ${String(data["mission_type"] ?? "")}` : "";
      const name = event.replace(/^(operator|mission)\./, "") + mission;
      const who = by ? ` (${by})` : "";
      return step.accepted ? words.accepted(name) + who : words.refused(name, step.refusal?.text ?? "") + who;
    }
    if (event === "value") return `${String(data["name"])} = ${short(data["value"])}`;
    if (event.startsWith("attempt.")) {
      const operation = this.running.get(String(data["attempt"]))?.operation ?? words.operation;
      const how = event.slice("attempt.".length);
      const why = [data["code"], data["detail"]].filter(Boolean).join(" ");
      return `${operation} ${words.attempt[how as keyof Words["attempt"]] ?? how}${why ? `: ${why}` : ""}`;
    }
    if (event.startsWith("timer.")) {
      const how = event.slice("timer.".length);
      const owner = String(data["owner"]);
      const told = words.timer[how as keyof Words["timer"]] ?? how;
      return `${told}: ${this.running.get(owner)?.operation ?? owner.split(".").slice(-2).join(".")}`;
    }
    return event;
  }

  private tellHolds(at: number, before: View | undefined, { view, command }: StepRecord): void {
    const { held, holds, asking } = view;
    if (held === before?.held && asking === before.asking) return;
    const who = command?.by ? ` (${command.by})` : "";
    const { words } = this;
    const earlier = before?.held ?? [];
    for (const name of held)
      if (!earlier.includes(name)) {
        const text = words.held(holds[name] ?? name);
        this.entries.push({ at, kind: "hold", severity: 1, text: text + who });
        this.open(HOLDS, { from: at, to: undefined, text: holds[name] ?? name, severity: 1 });
      }
    for (const name of earlier)
      if (!held.includes(name)) {
        const text = before?.holds[name] ?? name;
        this.entries.push({ at, kind: "hold", severity: 0, text: words.released(text) + who });
        const open = this.rows.get(HOLDS)!.findLast((span) => span.to === undefined && span.text === text);
        if (open) this.close(open, at);
      }
    for (const { state, question } of asking)
      if (!before?.asking.some((other) => other.state === state))
        this.entries.push({ at, kind: "question", severity: 1, text: question, state });
  }

  private open(row: string, span: Span): Span {
    const spans = this.rows.get(row) ?? [];
    if (!spans.length) this.rows.set(row, spans);
    spans.push(span);
    return span;
  }

  private close(span: Span, at: number): void {
    span.to = at;
    this.ends++;
  }

  /** Let a row show a word, from a moment on. */
  private follow(row: string, at: number, text: string, severity: Severity = 0): void {
    const last = this.rows.get(row)!.at(-1);
    const isOpen = last && last.to === undefined;
    if (isOpen && last.text === text) return;
    if (isOpen) this.close(last, at);
    if (text) this.open(row, { from: at, to: undefined, text, severity });
  }

  private followOperations(at: number, { step, view }: StepRecord, before: View | undefined): void {
    // What values have in common is one object.
    if (!step.commands && view.attempts === before?.attempts && view.cancelling === before.cancelling) return;
    const ended = String(step.data?.["attempt"] ?? "");
    if (["attempt.done", "attempt.failed", "attempt.cancelled"].includes(step.event)) this.end(ended, at, step.event === "attempt.failed" ? 2 : 0);
    for (const command of step.commands ?? [])
      if (command.command === "start") {
        const { operation, state } = command;
        const updated = command.updates && this.running.get(command.updates);
        if (updated) {
          this.running.delete(command.updates);
          this.running.set(command.attempt, updated);
          continue;
        }
        const given = Object.values(command.arguments ?? {}).filter((value) => typeof value !== "object");
        for (const [name, run] of this.running) if (run.operation === operation && run.state === state) this.end(name, at, 1);
        const text = [operation, ...given.map(short)].join(" ");
        const span = this.open(OPERATION + operation, { from: at, to: undefined, text, severity: 0, state });
        this.running.set(command.attempt, { operation, state, span });
      }
    for (const [name, { operation, state }] of this.running)
      if (!view.attempts.some((each) => each.operation === operation && each.state === state) && !view.cancelling.includes(operation))
        this.end(name, at, 1);
  }

  private end(attempt: string, at: number, severity: Severity): void {
    const running = this.running.get(attempt);
    if (!running) return;
    this.close(running.span, at);
    running.span.severity = severity;
    this.running.delete(attempt);
  }
}
