// The report of a shift: what happened in a span of time, on a page that prints well, and as CSV.
import { computed, signal, untracked } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useMemo } from "preact/hooks";
import { shownNow } from "../../model/time/clock";
import { forgetOlder, isLoading, loadOlder } from "../../model/time/history";
import { open, texts } from "../../model/page";
import { hindrance } from "../../model/mission/permission";
import { loadPressed, pressed } from "../../model/people";
import { shift, type Shift } from "../../model/story/shift";
import { isoTime, saveCsv } from "../../parts/csv";
import { clockTime, dateTime, span } from "../../parts/format";
import { Panel } from "../../parts/panel";

const HOUR_MS = 3_600_000;
const HOURS = [1, 4, 8, 12, 24];

/** The last hours; or from a time to a time, in milliseconds since 1970. */
const chosen = signal<{ readonly hours: number } | { readonly from: number; readonly to: number }>({ hours: 8 });

/** A time for an input of the browser, which has its own zone; empty for what is no time. */
function forInput(at: number): string {
  const local = new Date(at - new Date(at).getTimezoneOffset() * 60_000);
  return Number.isFinite(at) ? local.toISOString().slice(0, 16) : "";
}

/** The time of day; with the date where that is not the day of the report's end. */
function timeWithin(to: number): (at: number) => string {
  const day = new Date(to).toDateString();
  return (at) => (new Date(at).toDateString() === day ? clockTime(at) : dateTime(at));
}

function SpanForm({ from, to }: { from: number; to: number }) {
  const t = texts.value.people.report;
  const set = (name: "from" | "to", text: string): void => {
    const at = Date.parse(text);
    if (Number.isFinite(at)) chosen.value = { from, to, [name]: at };
  };
  const hours = "hours" in chosen.value ? chosen.value.hours : 0;
  return (
    <div class="row no-print">
      <label>
        {t.span}{" "}
        <select value={hours} onChange={(event) => (chosen.value = Number(event.currentTarget.value) ? { hours: Number(event.currentTarget.value) } : { from, to })}>
          {HOURS.map((each) => (
            <option value={each}>{t.hours(each)}</option>
          ))}
          <option value={0}>{t.ownSpan}</option>
        </select>
      </label>
      {(["from", "to"] as const).map((name) => (
        <label key={name}>
          {t[name]}{" "}
          <input type="datetime-local" value={forInput(name === "from" ? from : to)} onChange={(event) => set(name, event.currentTarget.value)} />
        </label>
      ))}
    </div>
  );
}

function Section(props: { title: string; count: number; head: readonly string[]; children: ComponentChildren }) {
  return (
    <section class="report-part">
      <h3>
        {props.title} ({props.count})
      </h3>
      {props.count > 0 && (
        <div class="scroll" role="region" tabIndex={0} aria-label={props.title}>
          <table>
            <thead>
              <tr>
                {props.head.map((text) => (
                  <th key={text} scope="col">
                    {text}
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>{props.children}</tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function Cells({ cells }: { cells: readonly (string | number)[] }) {
  return (
    <tr>
      {cells.map((cell, index) => (
        <td key={index}>{cell}</td>
      ))}
    </tr>
  );
}

type Line = readonly (string | number)[];
interface Part {
  readonly title: string;
  readonly head: readonly string[];
  readonly lines: readonly Line[];
}

/** The parts of a report as tables; `time` writes a time. */
function parts(found: Shift, time: (at: number) => string): readonly Part[] {
  const t = texts.value.people.report;
  const p = texts.value.people;
  const how = (accepted: boolean): string => (accepted ? p.accepted : p.refused);
  return [
    {
      title: t.missions,
      head: [t.mission, t.from, t.to, t.state, t.targets, t.completed, t.failed, t.unreachable, t.skipped],
      lines: found.missions.map((run) => [
        run.type || run.id,
        time(run.began),
        run.ended === undefined ? t.underWay : time(run.ended),
        run.lifecycle,
        run.total,
        run.completed,
        run.failed,
        run.unreachable,
        run.skipped,
      ]),
    },
    {
      title: t.anomalies,
      head: [t.tag, t.what, t.seen, t.from, t.to],
      lines: found.anomalies.map(({ first, last, times, tag, text }) => [tag, text, times, time(first), time(last)]),
    },
    {
      title: t.interventions,
      head: [t.time, t.who, t.what, t.result],
      lines: found.interventions.map(({ at, by, what, accepted, answer }) => [time(at), by, what, [how(accepted), answer].filter(Boolean).join(": ")]),
    },
    {
      title: t.stops,
      head: [t.from, t.to, t.length, t.who],
      lines: found.stops.map(({ began, ended, by }) => [
        time(began),
        ended === undefined ? t.still : time(ended),
        span(((ended ?? found.to) - began) / 1000),
        by,
      ]),
    },
    {
      title: t.faults,
      head: [t.time, t.severity, t.code, t.target, t.what],
      lines: found.faults.map(({ at, severity, code, target, text }) => [time(at), severity > 1 ? t.error : t.warning, code, target, text]),
    },
    {
      title: p.notifications,
      head: [t.time, t.what, t.about, t.known],
      lines: found.notifications.map((one) => [
        time(one.first * 1000),
        one.text,
        one.about,
        one.acknowledged === null ? t.unknown : `${one.by}, ${time(one.acknowledged * 1000)}`,
      ]),
    },
  ];
}

function saved(found: Shift): Line[] {
  const t = texts.value.people.report;
  const tables = parts(found, isoTime).flatMap(({ title, head, lines }): Line[] => [[], [title], head, ...lines]);
  return [[t.title, isoTime(found.from), isoTime(found.to)], ...tables];
}

/** Counting takes some milliseconds, and something happens several times a second: it is done anew this often. */
const COUNTED_EVERY_MS = 10_000;
const turn = computed(() => Math.floor(shownNow.value / COUNTED_EVERY_MS));
/** The end of the last hours: a whole minute. */
const minute = computed(() => Math.ceil(shownNow.value / 60_000) * 60_000);

function Sums({ found }: { found: Shift }) {
  const sums = { completed: 0, missed: 0, skipped: 0 };
  for (const run of found.missions) {
    sums.completed += run.completed;
    sums.missed += run.failed + run.unreachable;
    sums.skipped += run.skipped;
  }
  const t = texts.value.people.report;
  return <p class="sums">{t.sums(found.missions.length, sums.completed, sums.missed, sums.skipped, found.anomalies.length)}</p>;
}

/** All parts; made anew only when they are counted anew. */
function Parts({ found }: { found: Shift }) {
  const language = texts.value;
  return useMemo(
    () => (
      <>
        {parts(found, timeWithin(found.to)).map(({ title, head, lines }) => (
          <Section key={title} title={title} count={lines.length} head={head}>
            {lines.map((line, index) => (
              <Cells key={index} cells={line} />
            ))}
          </Section>
        ))}
      </>
    ),
    [found, language],
  );
}

export function Report() {
  const t = texts.value.people.report;
  const mayKnow = hindrance.value === "";
  useEffect(() => {
    if (mayKnow) void loadPressed().catch(() => undefined);
  }, [mayKnow]);
  useEffect(() => {
    void loadOlder();
    return forgetOlder;
  }, []);
  const now = minute.value;
  const { from, to } = "hours" in chosen.value ? { from: now - chosen.value.hours * HOUR_MS, to: now } : chosen.value;
  const found = useMemo(() => untracked(() => shift(from, to)), [from, to, turn.value, isLoading.value, pressed.value]);
  const tools = (
    <div class="row no-print">
      <button onClick={() => open("people")}>{t.back}</button>
      <button onClick={() => saveCsv(`shift-${isoTime(from).replaceAll(":", "")}.csv`, saved(shift(from, to)))}>{t.csv}</button>
      <button class="main" onClick={() => print()}>
        {t.print}
      </button>
    </div>
  );
  return (
    <Panel title={t.title} class="report" tools={tools}>
      <SpanForm from={from} to={to} />
      <p>
        {dateTime(from)} – {dateTime(to)}
      </p>
      {(found.knownFrom === undefined || found.knownFrom > from) && (
        <p class="note warn">{found.knownFrom === undefined ? t.nothingKnown : t.knownFrom(dateTime(found.knownFrom))}</p>
      )}
      {!mayKnow && <p class="note warn">{t.withoutCommands}</p>}
      <Sums found={found} />
      <Parts found={found} />
    </Panel>
  );
}
