// What belongs to the page itself: which view is open, its language, its colours, and what it is a page of.
import { computed, signal } from "@preact/signals";
import { link } from "../wire/link";
import { en, type Texts } from "../texts/en";
import { nl } from "../texts/nl";

const LANGUAGES = { en, nl } as const;
export type Language = keyof typeof LANGUAGES;
export type Theme = "auto" | "light" | "dark";

/** What is looked at: a robot, a simulation in virtual time, or a recording. */
export type Mode = "robot" | "simulation" | "recording";

/** What the gateway says of itself and of who this page is. */
export interface GatewayStatus {
  readonly mode?: Mode;
  /** Of a recording or a simulation: what is shown. */
  readonly title?: string;
  /** Of a recording: its begin and end in milliseconds since 1970, and what is wrong with it. */
  readonly from?: number;
  readonly to?: number;
  readonly problems?: readonly string[];
  readonly clients: number;
  /** Who this page is for the gateway, and what it may do. */
  readonly name?: string;
  readonly role?: "viewer" | "operator" | "engineer";
  /** Which robot this page is of, and all that this gateway has; a single robot may have no name. */
  readonly robot?: string;
  readonly robots?: readonly string[];
}

export const gateway = signal<GatewayStatus | undefined>(undefined);
export const mode = computed<Mode>(() => gateway.value?.mode ?? "robot");

function kept<T extends string>(key: string, allowed: readonly T[], otherwise: T): T {
  const found = localStorage.getItem(key);
  return allowed.find((each) => each === found) ?? otherwise;
}

export const language = signal<Language>(
  kept("lupin.language", ["en", "nl"], navigator.language.startsWith("nl") ? "nl" : "en"),
);
export const theme = signal<Theme>(kept("lupin.theme", ["auto", "light", "dark"], "auto"));

/** All texts of the page in the language that is chosen. */
export const texts = computed<Texts>(() => LANGUAGES[language.value]);

/** Whether the stop's own connection stands; what it shows itself is the truth about it. */
const stopBox = document.getElementById("stop-box")!;
export const stopLinked = signal(false);

export const route = signal(location.hash.slice(1));

/** Open a view; `#chart/MISSION.INSPECTING` is the view `chart`, about that state. */
export function open(where: string): void {
  location.hash = where;
}

export function startPage(): void {
  addEventListener("hashchange", () => (route.value = location.hash.slice(1)));
  language.subscribe((chosen) => {
    localStorage.setItem("lupin.language", chosen);
    document.documentElement.lang = chosen;
  });
  theme.subscribe((chosen) => {
    localStorage.setItem("lupin.theme", chosen);
    document.documentElement.dataset["theme"] = chosen;
  });
  mode.subscribe((now) => {
    document.documentElement.dataset["mode"] = now;
  });
  gateway.subscribe((now) => {
    if (now?.robot) document.documentElement.dataset["robot"] = now.robot;
  });
  const lookAtStop = (): void => void (stopLinked.value = stopBox.dataset["state"] !== "away");
  new MutationObserver(lookAtStop).observe(stopBox, { attributeFilter: ["data-state"] });
  lookAtStop();
  link.opened.push(() => void look().catch(() => undefined));
}

async function look(): Promise<void> {
  const answer = await fetch("status");
  if (answer.ok) gateway.value = (await answer.json()) as GatewayStatus;
}
