// Where the mission stands: state, progress, holds, battery, e-stop, and what to do next.
import { loopNow } from "../../model/time/countdown";
import { isFault, missions, possible, state, steps, view } from "../../model/mission/mission";
import { stoppers } from "../../model/alerts";
import { moment } from "../../model/time/past";
import { lostSince } from "../../model/time/clock";
import { mode, texts } from "../../model/page";
import { commandHindrance, missionNow, missionSince, verbText } from "../../model/mission/permission";
import { clockTime, number, span } from "../../parts/format";
import { Panel, Pill, type Tone } from "../../parts/panel";
import { inOrder } from "./button";
import type { MissionsRecord, OutcomeRecord, PossibleRecord, StepRecord, View } from "../../records";

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
      <Asked />
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
      {is("ended") && <Pill>{t.stages.ended}</Pill>}
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

const TONES: Record<OutcomeRecord["rating"], Tone> = { good: "good", bad: "bad", "left out": "plain" };

/** How many targets ended in which way, by the words of the profile. */
function Progress({ view: now }: { view: View }) {
  const t = texts.value.control;
  if (!now.total) return null;
  const counts = (missions.shown.value?.value.outcomes ?? []).map((outcome) => ({ ...outcome, count: Number(now[outcome.counter] ?? 0) }));
  const done = counts.reduce((sum, { count, rating }) => sum + (rating === "good" ? count : 0), 0);
  return (
    <div class="control-progress">
      <progress max={now.total} value={done} aria-label={t.progress} />
      <p class="row">
        {t.done(number(done), number(now.total))}
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
      {told.estop_engaged && <Pill tone="bad">{t.estop}</Pill>}
    </p>
  );
}

/** What the e-stop's hold is called: the level that engaged it may be over, and it holds on. */
const ESTOP = "estop";

function Holds({ view: now }: { view: View }) {
  const t = texts.value.control;
  if (!now.held.length) return null;
  const isReleased = state.shown.value?.value.estop_engaged === false;
  return (
    <ul class="control-holds" aria-label={t.holds}>
      {now.held.map((name) => {
        const { at, exact, by: asker } = heldSince(name);
        const by = asker || (name === ESTOP && !isReleased ? stoppersNow() : "");
        const text = at === undefined ? "" : span((missionNow.value - at) / 1000);
        const ends = verbsOf(({ releases }) => releases.includes(name));
        return (
          <li key={name} class="row">
            <Pill tone="warn">{name === ESTOP && isReleased ? t.stopReleased : now.holds[name] || name}</Pill> {by && t.by(by)}{" "}
            {text && (exact ? t.heldFor(text) : t.heldLonger(text))} {ends && t.endedBy(ends)}
          </li>
        );
      })}
    </ul>
  );
}

/** Who stops the robot, as far as that is known: not who began it, but all who have not let go. */
function stoppersNow(): string {
  const { pages, others } = stoppers(moment.value);
  return [...pages, ...others].join(", ");
}

/** The verbs of what is possible now and is like this. */
function verbsOf(isWanted: (request: PossibleRecord) => boolean): string {
  const requests = possible.shown.value?.value.requests ?? [];
  const wanted = requests.filter((each) => each.possible && isWanted(each)).sort(inOrder);
  return [...new Set(wanted.map(({ verb }) => verbText(verb)))].join(", ");
}

/** Since when a hold is engaged and by whom, and whether that is known: what is known of the past may begin later. */
function heldSince(hold: string): { at: number | undefined; exact: boolean; by: string } {
  const newest = steps.shown.value;
  const known = newest ? steps.past.until(newest.at) : [];
  let at: number | undefined;
  let by = "";
  for (let index = known.length - 1; index >= 0; index--) {
    const { at: when, value } = known[index]!;
    if (value.boot !== newest!.value.boot || !value.view.held.includes(hold)) return { at, exact: true, by };
    at = when;
    by = value.command?.by ?? "";
  }
  return { at, exact: false, by: "" };
}

/** What was asked for last, and by whom: who paused, resumed or ended the mission. */
function Asked() {
  const t = texts.value.control;
  const newest = steps.shown.value;
  const last = newest && steps.past.until(newest.at).findLast(({ value }) => value.step.accepted && value.command?.by);
  if (!last) return null;
  const verb = last.value.step.event.replace(/^.*\./, "");
  return <p class="soft">{t.asked(verbText(verb), last.value.command!.by!, clockTime(last.at))}</p>;
}

/** The codes of warnings and errors that were reported since the mission is where it is: in this phase, at this target. */
function presentCodes(): readonly string[] {
  const newest = steps.shown.value;
  const known = newest ? steps.past.until(newest.at) : [];
  const isHere = ({ boot, view: { lifecycle, phase, target, mission_id } }: StepRecord): boolean => {
    const now = newest!.value;
    return boot === now.boot && lifecycle === now.view.lifecycle && phase === now.view.phase && target === now.view.target && mission_id === now.view.mission_id;
  };
  const found: string[] = [];
  for (let index = known.length - 1; index >= 0 && isHere(known[index]!.value); index--)
    for (const { code, severity } of known[index]!.value.step.codes ?? []) if (severity > 0) found.unshift(code);
  return found;
}

/** When a code was reported last, as a time of day; "" where that is not known. */
function toldAt(code: string): string {
  const newest = steps.shown.value;
  const found = newest && steps.past.until(newest.at).findLast(({ value }) => value.step.codes?.some((each) => each.code === code));
  return found ? clockTime(found.at) : "";
}

/** What the present asks of somebody: a question, what holds, what went wrong here, a start that is refused. */
function advice(now: View, offer: MissionsRecord): readonly string[] {
  const t = texts.value.control;
  const idle = isIdle(now);
  const starts = (possible.shown.value?.value.requests ?? []).filter(({ verb }) => verb === "start");
  const held = now.held.map((name) => offer.holds[name] ?? "");
  const present = held.length && !isFault(now.lifecycle) ? [] : presentCodes();
  const codes = [...held, ...present, ...(idle && !held.length ? starts.map(({ code }) => code) : [])];
  const found = codes.map((code) => offer.codes[code]?.advice ?? "").filter(Boolean);
  if (now.asking.length) found.unshift(t.toAnswer);
  if (found.length) return [...new Set(found)];
  if (idle && starts.some((each) => each.possible)) return [t.toStart];
  const verbs = verbsOf(({ verb }) => verb !== "pause" && verb !== "answer");
  return [idle || now.paused ? t.toChoose(verbs || "–") : t.toWait];
}

/** What to do about it that nothing newer is known; "" where that is not so. */
function unheard(): string {
  const t = texts.value.control;
  if (missionSince.value === undefined) return "";
  return (lostSince.value === undefined ? t.toFind : t.toReach)(clockTime(missionSince.value));
}

/** What to do now. */
export function ToDo() {
  const t = texts.value.control;
  const now = view.value;
  const offer = missions.shown.value?.value;
  const lost = mode.value === "recording" ? "" : unheard();
  if (!lost && (!now || !offer)) return null;
  const last = now && offer?.codes[now.code];
  return (
    <Panel title={t.toDo}>
      {commandHindrance.value && <p class="note">{commandHindrance.value}</p>}
      <ul class="control-todo">
        {(lost ? [lost] : advice(now!, offer!)).map((each) => (
          <li key={each}>{each}</li>
        ))}
      </ul>
      {now?.code && (
        <p class="soft">
          {t.last(last?.label ?? now.code, now.detail, toldAt(now.code))} <code>{now.code}</code>
        </p>
      )}
    </Panel>
  );
}
