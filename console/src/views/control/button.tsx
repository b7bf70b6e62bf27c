// A button that commands something, grey with the reason why not; what it would do and what was answered stand by it.
import { effect, signal } from "@preact/signals";
import { useEffect, useId } from "preact/hooks";
import { answered, command, missions, possible as requestsNow } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { reasonOf, toldOf } from "../../model/mission/permission";
import type { PossibleRecord } from "../../records";

/** Within so many milliseconds the second press must come where two are needed. */
const SECOND_PRESS_MS = 5000;

interface Wanted {
  readonly label: string;
  readonly verb: string;
  readonly mission?: string;
  readonly request?: object;
  readonly possible: PossibleRecord | undefined;
  /** A press is not carried out while this says no, such as for a form with mistakes. */
  readonly check?: () => boolean;
  readonly main?: boolean;
  /** The answer stands elsewhere. */
  readonly apart?: boolean;
}

export function RequestButton({ label, verb, mission = "", request = {}, possible, check, main, apart }: Wanted) {
  const id = useId();
  const reason = reasonOf(possible);
  const twice = missions.shown.value?.value.ends === verb;
  const press = (): void => {
    if (reason || (!mission && justMoved(verb)) || (check && !check())) return;
    if (!twice || isSecond(verb)) void command(verb, mission, request);
  };
  const armed = twice && !reason && pressed.value?.verb === verb;
  return (
    <div class="control-request">
      <button
        type="button"
        class={`${armed ? "control-armed" : ""} ${main ? "main" : ""}`}
        aria-disabled={!!reason}
        aria-describedby={id}
        onClick={press}
      >
        {armed ? <Again label={label} /> : label}
      </button>
      <span id={id} class="soft">
        {toldOf(possible, reason)}
      </span>
      {!apart && <AnswerOf verb={verb} mission={mission} />}
    </div>
  );
}

/** Verbs that are known stand in this order, those first that stay possible; others behind them. */
const ORDER = ["pause", "resume", "dock", "abort", "reset", "skip", "skip_current"];

export function inOrder(one: PossibleRecord, other: PossibleRecord): number {
  return place(one) - place(other);
}

function place({ verb }: PossibleRecord): number {
  const found = ORDER.indexOf(verb);
  return found < 0 ? ORDER.length : found;
}

/** Within so many milliseconds after a button has moved, a press of it was meant for another one. */
const MOVED_MS = 600;
/** The possible requests stand first: which in which place, and since when each is there. */
let places: readonly string[] = [];
const movedAt = new Map<string, number>();

function justMoved(verb: string): boolean {
  return performance.now() - (movedAt.get(verb) ?? -Infinity) < MOVED_MS;
}

effect(() => {
  const told = requestsNow.shown.value?.value.requests ?? [];
  const now = told.filter((each) => each.request.startsWith("operator.") && !reasonOf(each)).sort(inOrder).map(({ verb }) => verb);
  now.forEach((verb, place) => {
    if (places.length && places[place] !== verb) movedAt.set(verb, performance.now());
  });
  if (now.length) places = now; // none is possible while a request is under way
});

/** The press that waits for its second one. */
const pressed = signal<{ verb: string; until: number; left: number } | undefined>(undefined);

/** Whether this press is the second one in time; else it is the first one. */
function isSecond(verb: string): boolean {
  const before = pressed.peek();
  const second = before?.verb === verb && performance.now() < before.until;
  pressed.value = second ? undefined : { verb, until: performance.now() + SECOND_PRESS_MS, left: SECOND_PRESS_MS };
  return second;
}

function Again({ label }: { label: string }) {
  useEffect(() => {
    const tick = setInterval(() => {
      const now = pressed.peek();
      const left = now ? now.until - performance.now() : 0;
      pressed.value = now && left > 0 ? { ...now, left } : undefined;
    }, 250);
    const forget = (): void => {
      if (document.hidden) pressed.value = undefined;
    };
    document.addEventListener("visibilitychange", forget);
    return () => {
      clearInterval(tick);
      document.removeEventListener("visibilitychange", forget);
    };
  }, []);
  return <>{texts.value.control.again(label, String(Math.ceil((pressed.value?.left ?? 0) / 1000)))}</>;
}

/** What was answered to the last press, while it is the last. */
export function AnswerOf({ verb, mission }: { verb: string; mission: string }) {
  const last = answered.value;
  const mine = last?.verb === verb && last.mission === mission;
  return (
    <span role="status" class={mine ? `control-answer ${last.accepted ? "good" : "bad"}` : ""}>
      {mine && `${last.accepted ? "✓" : "✖"} ${last.text}`}
    </span>
  );
}
