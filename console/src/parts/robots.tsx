// The robots of this gateway: what each does, what stops it and what it asks. A press leads to its page.
import { signal } from "@preact/signals";
import { gateway, texts } from "../model/page";
import type { RobotRecord } from "../records";
import { baseOf } from "../wire/address";
import { Pill } from "./panel";
import "./robots.css";

const LOOK_EVERY_MS = 1000;
/** Undefined while the gateway does not answer. */
const robots = signal<readonly RobotRecord[] | undefined>(undefined);

export function startRobots(): void {
  if (!baseOf(location)) return; // the only one
  const look = async (): Promise<void> => {
    const answer = await fetch("robots");
    robots.value = answer.ok ? ((await answer.json()) as RobotRecord[]) : undefined;
  };
  setInterval(() => void look().catch(() => (robots.value = undefined)), LOOK_EVERY_MS);
}

function Robot({ robot, heard, lifecycle, target, paused, stops, questions }: RobotRecord) {
  const t = texts.value;
  const isOwn = baseOf(location) === `/robots/${robot}`;
  return (
    <a href={`/robots/${robot}/${location.hash}`} aria-current={isOwn ? "page" : undefined}>
      <b>{robot}</b> {heard ? lifecycle : t.shell.notHeard} {heard && target && `· ${target}`}{" "}
      {paused && <Pill tone="warn">{t.shell.paused}</Pill>}{" "}
      {!!stops.length && <Pill tone="bad">{t.alerts.stop(stops.join(", "))}</Pill>}{" "}
      {questions.map((question) => (
        <Pill tone="warn">{question}</Pill>
      ))}
    </a>
  );
}

export function Robots() {
  const names = gateway.value?.robots ?? [];
  if (names.length < 2) return null;
  return (
    <nav class="robots" aria-label={texts.value.shell.robots}>
      {robots.value ? robots.value.map((each) => <Robot key={each.robot} {...each} />) : texts.value.shell.lost}
    </nav>
  );
}
