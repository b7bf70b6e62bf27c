// A recording: the moment that is shown goes through it, at a speed, as if it happened again.
import { effect, signal } from "@preact/signals";
import { setPace } from "./clock";
import { gateway, mode } from "../page";
import { moment } from "./past";

export const SPEEDS = [0.25, 1, 4, 16, 64] as const;
/** Milliseconds between two moments that are shown. */
const TICK_MS = 100;

export const playing = signal(false);
export const playSpeed = signal(1);

/** The begin and the end of the recording, in milliseconds since 1970. */
export function extent(): { readonly from: number; readonly to: number } {
  const { from = 0, to = 0 } = gateway.value ?? {};
  return { from, to };
}

/** Play from the moment that is shown on; at the end, from the begin. */
export function play(): void {
  const { from, to } = extent();
  const at = moment.peek();
  if (at === null || at >= to) moment.value = from;
  playing.value = true;
}

export function startPlayback(): void {
  let last = 0;
  setInterval(() => {
    const now = performance.now();
    const passed = now - last;
    last = now;
    if (!playing.peek()) return;
    const at = moment.peek();
    const next = (at ?? Infinity) + passed * playSpeed.peek();
    const over = next >= extent().to;
    if (over) playing.value = false;
    moment.value = over ? null : next;
  }, TICK_MS);
  let begun = false;
  effect(() => {
    if (mode.value !== "recording" || begun) return;
    begun = true;
    setPace(extent().to, 0);
  });
}
