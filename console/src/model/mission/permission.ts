// Why nothing can be commanded from this page now. Buttons are grey with this reason; the engine's own come after it.
import { computed } from "@preact/signals";
import { link } from "../../wire/link";
import { lostSince, shownNow } from "../time/clock";
import { asking, missions, state } from "./mission";
import { gateway, mode, texts } from "../page";
import { moment } from "../time/past";
import { isStale } from "../topics";
import type { PossibleRecord } from "../../records";

/** The state comes five times a second; after so many seconds without it nobody is there to be commanded. */
const SILENT_S = 3;

/** Whether the orchestrator tells nothing any more, although there is a connection to the gateway. */
export const silent = computed(() => isStale(state, SILENT_S));

/** Of when the mission is that is shown, where it is not of now; undefined: it is. */
export const missionSince = computed(() => (moment.value === null ? (lostSince.value ?? (silent.value ? state.heardAt.value : undefined)) : undefined));
/** The moment by which the mission is shown; it stands still when nothing is heard. */
export const missionNow = computed(() => missionSince.value ?? shownNow.value);

/** Why this page may command nothing at all; "" where it may. What is under way now is not among it. */
export const hindrance = computed(() => {
  const t = texts.value.control.hindrances;
  if (mode.value === "recording") return t.recording;
  if (link.state.value !== "open") return t.unconnected;
  if (gateway.value?.role === "viewer") return t.viewer;
  if (moment.value !== null) return t.past;
  return "";
});

/** Why this page may not do what needs a role; "" where it may. */
export function hindranceFor(least: "operator" | "engineer"): string {
  const t = texts.value.control.hindrances;
  return hindrance.value || (least === "engineer" && gateway.value?.role !== "engineer" ? t.engineer : "");
}

/** Why the mission cannot be commanded now; "" where the engine is the one to ask. */
export const commandHindrance = computed(() => {
  const t = texts.value.control;
  if (hindrance.value) return hindrance.value;
  if (silent.value) return t.hindrances.silent;
  return asking.value && t.hindrances.asking(verbText(asking.value));
});

/** Why it cannot be asked for now: the page's reason, else the engine's sentence. */
export function reasonOf(possible: PossibleRecord | undefined): string {
  if (commandHindrance.value) return commandHindrance.value;
  if (!possible) return texts.value.control.hindrances.untold;
  return possible.possible || possible.fields ? "" : possible.reason;
}

/** The text beside a button: why not; of a moment that is over, the engine's reason then. */
export function toldOf(possible: PossibleRecord | undefined, reason: string): string {
  const t = texts.value.control;
  if (!reason) return effectOf(possible);
  const isOver = mode.value === "recording" || moment.value !== null;
  if (!isOver || !possible) return reason;
  return `${reason} ${possible.possible || possible.fields ? t.wasPossible : t.was(possible.reason)}`;
}

/** What it would do, for verbs that this page knows; else what to the holds. And for what it waits. */
function effectOf(possible: PossibleRecord | undefined): string {
  const t = texts.value.control;
  const offer = missions.shown.value?.value;
  const named = (holds: readonly string[]): string => holds.map((name) => offer?.codes[offer.holds[name] ?? ""]?.label ?? name).join(", ");
  const { engages = [], releases = [] } = possible ?? {};
  const waits = possible?.possible && possible.reason;
  const known = possible && t.effects[possible.verb];
  if (known) return [known, waits].filter(Boolean).join("; ");
  return [engages.length && t.engages(named(engages)), releases.length && t.releases(named(releases)), waits].filter(Boolean).join("; ");
}

/** What a verb is called on its button; one that this page does not know by its own name. */
export function verbText(verb: string): string {
  const known: Readonly<Record<string, string>> = texts.value.control.verbs;
  return known[verb] ?? verb.replaceAll("_", " ");
}
