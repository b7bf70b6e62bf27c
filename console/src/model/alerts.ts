// What everybody is to see at once, whatever they look at: a stop, a failed mission, a question. Also in the title.
import { computed, effect } from "@preact/signals";
import { isFault, missions, state, steps } from "./mission/mission";
import { gateway, mode, texts } from "./page";
import { base, stops } from "./story/log";
import { moment } from "./time/past";

export interface Alert {
  readonly kind: "stop" | "fault" | "question";
  readonly text: string;
  /** It stands beside the button of the stop already. */
  readonly isSaid?: boolean;
}

/** So the device shakes when something is new, in milliseconds: on, off, on. */
const SHAKE_MS = [300, 150, 300];

/** Of now, also while the past is looked at; of a recording, of the moment that is shown. */
export const alerts = computed<readonly Alert[]>(() => {
  const t = texts.value.alerts;
  const at = mode.value === "recording" ? moment.value : null;
  const view = steps.past.at(at)?.value.view;
  const { pages, others } = stoppers(at);
  const found: Alert[] = [];
  if (pages.length || state.past.at(at)?.value.estop_engaged) found.push({ kind: "stop", text: t.stop([...pages, ...others].join(", ")), isSaid: pages.length > 0 && others.length === 0 });
  if (view && isFault(view.lifecycle)) {
    const label = missions.past.at(at)?.value.codes[view.code]?.label ?? view.code;
    found.push({ kind: "fault", text: t.fault(view.lifecycle, [label, view.detail].filter(Boolean).join(": ")) });
  }
  for (const { question } of view?.asking ?? []) found.push({ kind: "question", text: t.question(question) });
  return found;
});

/** Who stops the robot: pages by their names, and other sources in words. */
export function stoppers(at: number | null): { readonly pages: readonly string[]; readonly others: readonly string[] } {
  const { sources } = texts.value.alerts;
  const pages = stops.past.at(at)?.value.stops.map(({ name }) => name) ?? [];
  // A robot repeats the stop of pages as its own, and our gateway publishes it to other HMIs: these count without it only.
  const engaged = base.past.at(at)?.value.stops ?? [];
  const others = engaged.includes("pages") ? [] : engaged.flatMap((each) => (each === "robot" || each === "hmi" ? [sources[each]] : []));
  return { pages, others };
}

export function startAlerts(): void {
  let before: ReadonlySet<string> = new Set();
  effect(() => {
    const now = alerts.value;
    const robot = gateway.value?.robot ? [gateway.value.robot] : [];
    document.title = [...robot, ...now.map(({ text }) => text), texts.value.shell.title].join(" · ");
    // The words of a stop and of a fault may change while it lasts: the label of a code comes with the missions.
    const kinds = new Set(now.map(({ kind, text }) => (kind === "question" ? text : kind)));
    const isNew = [...kinds].some((each) => !before.has(each));
    before = kinds;
    // A page that nobody has touched yet may not shake the device, and would be told so as an error.
    if (isNew && mode.peek() !== "recording" && navigator.userActivation?.hasBeenActive) navigator.vibrate?.(SHAKE_MS);
  });
}
