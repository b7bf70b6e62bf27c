// A simulation in virtual time: how it stands, what can be done to it, and what its clock shows.
import { effect, signal } from "@preact/signals";
import { MSG_TYPES, type StdMsgsString as Text } from "../../ros";
import { link } from "../../wire/link";
import { setPace } from "../time/clock";
import { loadAnew } from "../time/history";
import { mode } from "../page";
import { moment } from "../time/past";
import { json } from "../topics";
import type { SimulationRecord } from "../../records";

export const simulated = signal<SimulationRecord | undefined>(undefined);
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

function take(now: SimulationRecord): void {
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
      const now = json<SimulationRecord>(message);
      if (now) take(now);
    });
  });
}
