// Where the mission stands: state, progress, holds, battery, e-stop, and what to do next.
import { loopNow } from "../../model/time/countdown";
import { missions, possible, state, steps, view, type Outcome, type View } from "../../model/mission/mission";
import { shownNow } from "../../model/time/clock";
import { texts } from "../../model/page";
import { commandHindrance } from "../../model/mission/permission";
import { number, span } from "../../parts/format";
import { Panel, Pill, type Tone } from "../../parts/panel";

export function Where() {
  const t = texts.value.control;
  const now = view.value;
  if (!now) return <Panel title={t.title}>{<p class="soft">{t.nothing}</p>}</Panel>;
  return (
    <Panel title={t.title} tools={<Stage view={now} />}>
      <p class="control-where">
        <b>{now.lifecycle || "–"}</b> {now.phase} {now.target && t.target(now.target)}
      </p>
      {now.mission && <Mission view={now} />}
      <Progress view={now} />
      <Robot />
      <Holds view={now} />
    </Panel>
  );
}

/** What a published state means, and whether it waits for somebody. */
function Stage({ view: now }: { view: View }) {
  const t = texts.value.control;
  const stages = missions.shown.value?.value.stages;
  const is = (stage: "returning" | "ended" | "faulted"): boolean => !!stages?.[stage].includes(now.lifecycle);
  return (
    <span class="row">
      {is("returning") && <Pill tone="info">{t.stages.returning}</Pill>}
      {is("ended") && <Pill tone="good">{t.stages.ended}</Pill>}
      {is("faulted") && <Pill tone="bad">{t.stages.faulted}</Pill>}
      {now.held.length > 0 && now.cancelling.length > 0 && <Pill tone="warn">{t.pausing}</Pill>}
      {now.paused && !now.held.length && <Pill tone="warn">{t.waitsForYou}</Pill>}
    </span>
  );
}

function Mission({ view: now }: { view: View }) {
  const t = texts.value.control;
  const begun = now.started_at;
  const idle = isIdle(now);
  const since = begun !== null && !idle && loopNow.value !== undefined ? span(loopNow.value - begun) : "";
  return (
    <p class="soft">
      {now.mission} {now.mission_id} {since && t.since(since)}
    </p>
  );
}

function isIdle(now: View): boolean {
  const stages = missions.shown.value?.value.stages;
  if (!stages) return !now.mission;
  return [...stages.starting, ...stages.ready, ...stages.ended, ...stages.faulted].includes(now.lifecycle);
}

const TONES: Record<Outcome["rating"], Tone> = { good: "good", bad: "bad", "left out": "plain" };

/** How many targets ended in which way, by the words of the profile. */
function Progress({ view: now }: { view: View }) {
  const t = texts.value.control;
  if (!now.total) return null;
  const counts = (missions.shown.value?.value.outcomes ?? []).map((outcome) => ({ ...outcome, count: Number(now[outcome.counter] ?? 0) }));
  const closed = counts.reduce((sum, { count }) => sum + count, 0);
  return (
    <div class="control-progress">
      <progress max={now.total} value={closed} aria-label={t.progress} />
      <p class="row">
        {t.done(number(closed), number(now.total))}
        {counts
          .filter(({ count }) => count > 0)
          .map(({ name, counter, rating, count }) => (
            <Pill key={name} tone={TONES[rating]}>
              {number(count)} {counter}
            </Pill>
          ))}
      </p>
    </div>
  );
}

function Robot() {
  const t = texts.value.control;
  const told = state.shown.value?.value;
  if (!told) return null;
  const percent = number(told.battery_percentage === null ? null : told.battery_percentage * 100, 0);
  return (
    <p class="row">
      {told.battery_low ? <Pill tone="bad">{t.batteryLow(percent)}</Pill> : <Pill>{t.battery(percent)}</Pill>}
      {told.estop_engaged ? <Pill tone="bad">{t.estop}</Pill> : <Pill>{t.noEstop}</Pill>}
    </p>
  );
}

function Holds({ view: now }: { view: View }) {
  const t = texts.value.control;
  if (!now.held.length) return null;
  return (
    <ul class="control-holds" aria-label={t.holds}>
      {now.held.map((name) => {
        const { at, exact } = heldSince(name);
        const text = at === undefined ? "" : span((shownNow.value - at) / 1000);
        return (
          <li key={name} class="row">
            <Pill tone="warn">{now.holds[name] || name}</Pill> {text && (exact ? t.heldFor(text) : t.heldLonger(text))}
          </li>
        );
      })}
    </ul>
  );
}

/** Since when a hold is engaged, and whether that is known: what is known of the past may begin later. */
function heldSince(hold: string): { at: number | undefined; exact: boolean } {
  const newest = steps.shown.value;
  const known = newest ? steps.past.until(newest.at) : [];
  let at: number | undefined;
  for (let index = known.length - 1; index >= 0; index--) {
    const { at: when, value } = known[index]!;
    if (value.boot !== newest!.value.boot || !value.view.held.includes(hold)) return { at, exact: true };
    at = when;
  }
  return { at, exact: false };
}

/** What to do next: the advice of the holds, else of what happened last and of starts that are refused. */
export function ToDo() {
  const t = texts.value.control;
  const now = view.value;
  const offer = missions.shown.value?.value;
  if (!now || !offer) return null;
  const idle = isIdle(now);
  const requests = possible.shown.value?.value.requests ?? [];
  const starts = requests.filter(({ verb }) => verb === "start");
  const refused = idle ? starts.map(({ code }) => code) : [];
  const held = now.held.map((name) => offer.holds[name] ?? "");
  const codes = held.length ? held : [now.code, ...refused];
  const advice = codes.map((code) => offer.codes[code]?.advice ?? "").filter(Boolean);
  if (now.asking.length) advice.unshift(t.toAnswer);
  if (!advice.length && idle && starts.some((each) => each.possible)) advice.push(t.toStart);
  if (!advice.length && !idle && !now.paused) advice.push(t.toWait);
  const last = offer.codes[now.code];
  return (
    <Panel title={t.toDo}>
      {commandHindrance.value && <p class="note">{commandHindrance.value}</p>}
      <ul class="control-todo">
        {[...new Set(advice)].map((each) => (
          <li key={each}>{each}</li>
        ))}
      </ul>
      {now.code && (
        <p class="soft">
          {t.last(last?.label ?? now.code, now.detail)} <code>{now.code}</code>
        </p>
      )}
    </Panel>
  );
}
