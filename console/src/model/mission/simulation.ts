// A simulation in virtual time: how it stands, what can be done to it, and what its clock shows.
import { effect, signal } from "@preact/signals";
import { MSG_TYPES, type StdMsgsString as Text } from "../../ros";
import { link } from "../../wire/link";
import { setPace } from "../time/clock";
import { loadAnew } from "../time/history";
import { mode } from "../page";
import { moment } from "../time/past";
import { json } from "../topics";

/** A failure that an operation declares. */
export interface DeclaredCode {
  readonly code: string;
  readonly label: string;
  readonly severity: number;
}

export interface OperationUnderWay {
  readonly operation: string;
  readonly codes: readonly DeclaredCode[];
  readonly result: Readonly<Record<string, string>>;
}

export interface LiveInput {
  readonly name: string;
  readonly type: string;
  readonly unit: string;
  readonly choices: readonly string[];
  readonly now: unknown;
}

export interface Simulated {
  readonly boot: string;
  /** Milliseconds since 1970 by the simulation, seconds since its begin, and what the robot's clock shows. */
  readonly at: number;
  readonly time: number;
  readonly clock: string;
  readonly running: boolean;
  /** So many times as fast as real time; null: as fast as it goes. */
  readonly speed: number | null;
  readonly until: string;
  readonly note: string;
  /** When the next thing happens by itself, in seconds since the begin. */
  readonly next: number | null;
  readonly operations: readonly OperationUnderWay[];
  readonly silent: readonly string[];
  readonly values: readonly LiveInput[];
  readonly events: readonly { readonly name: string; readonly fields: Readonly<Record<string, string>> }[];
}

export const simulated = signal<Simulated | undefined>(undefined);
/** What the simulation said to what was done last. */
export const said = signal<{ readonly success: boolean; readonly text: string } | undefined>(undefined);

/** Do something to the simulation. Never fails. */
export async function simulate(command: string, ...words: readonly string[]): Promise<void> {
  try {
    const answer = await link.call<{ success: boolean; message: string }>("/simulation/do", { command, words });
    said.value = { success: answer.success, text: answer.message };
  } catch (problem) {
    said.value = { success: false, text: problem instanceof Error ? problem.message : String(problem) };
  }
}

function take(now: Simulated): void {
  const before = simulated.peek();
  simulated.value = now;
  setPace(now.at, now.running ? (now.speed ?? 0) : 0);
  if (before && before.boot !== now.boot) {
    moment.value = null;
    loadAnew();
  }
}

export function startSimulation(): void {
  let end: (() => void) | undefined;
  effect(() => {
    if (mode.value !== "simulation" || end) return;
    end = link.subscribe<Text>("/simulation/state", MSG_TYPES.StdMsgsString, (message) => {
      const now = json<Simulated>(message);
      if (now) take(now);
    });
  });
}
