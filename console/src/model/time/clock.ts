// The robot's clock. A browser's may be an hour off, so it is never compared with times that the robot tells.
import { computed, signal } from "@preact/signals";
import { link } from "../../wire/link";
import type { Time } from "../../ros";
import { moment } from "./past";

/** Milliseconds by which the robot's clock is ahead of this page's steady one; undefined until it is known. */
const ahead = signal<number | undefined>(undefined);
const ticks = signal(0);

/** A clock that is not a robot's: what it showed, when by this page's steady clock, and how fast it goes. */
const pace = signal<{ readonly at: number; readonly seen: number; readonly rate: number } | undefined>(undefined);

/** From now on the clock is one of a simulation or a recording: it shows `at`, and goes so many times as fast. */
export function setPace(at: number, rate: number): void {
  pace.value = { at, seen: performance.now(), rate };
}

/** What waits until the robot's clock is known. */
const waiting: (() => void)[] = [];

/** Call something with the robot's time now; a little later where that is not known yet. */
export function atRobotTime(call: (at: number) => void): void {
  const at = performance.now();
  if (pace.peek()) call(robotNow());
  else if (ahead.peek() !== undefined) call(at + ahead.peek()!);
  else waiting.push(() => call(at + (ahead.peek() ?? performance.timeOrigin)));
}

/** The robot's time now, in milliseconds since 1970. */
export function robotNow(): number {
  return robotTime(performance.now());
}

/** The robot's time at a moment of this page's steady clock. */
function robotTime(at: number): number {
  const virtual = pace.value;
  if (virtual) return virtual.at + (at - virtual.seen) * virtual.rate;
  return at + (ahead.value ?? performance.timeOrigin);
}

/** When the link was lost, in the robot's milliseconds: nothing newer is known. Undefined while it stands. */
export const lostSince = computed(() => {
  const at = link.silentSince.value;
  return at === undefined ? undefined : robotTime(at);
});

/** The moment that is shown, as a time; it goes on by the second while it is now, and stands still with a lost link. */
export const shownNow = computed(() => {
  void ticks.value;
  return moment.value ?? lostSince.value ?? robotNow();
});

/** Ask what the robot's clock shows: the answer with the shortest way is the best. */
async function compare(): Promise<void> {
  let shortest = Infinity;
  for (let round = 0; round < 4; round++) {
    const asked = performance.now();
    const { time } = await link.call<{ time: Time }>("/rosapi/get_time");
    const way = performance.now() - asked;
    if (way >= shortest) continue;
    shortest = way;
    ahead.value = time.sec * 1000 + time.nanosec / 1e6 - (asked + way / 2);
    for (const call of waiting.splice(0)) call();
  }
}

/** So far may the page's two clocks drift apart in a second, in milliseconds; a computer that slept stops one of them. */
const DRIFT_MS = 500;

export function startClock(): void {
  const look = (): void => void compare().catch(() => waiting.splice(0).forEach((call) => call()));
  link.opened.push(look);
  setInterval(look, 60_000);
  document.addEventListener("visibilitychange", () => document.hidden || look());
  let apart = Date.now() - performance.now();
  setInterval(() => {
    ticks.value++;
    const now = Date.now() - performance.now();
    if (Math.abs(now - apart) > DRIFT_MS) look();
    apart = now;
  }, 1000);
}
