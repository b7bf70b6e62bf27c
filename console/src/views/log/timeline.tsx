// The timeline: what lasted how long, in rows, and when something was reported.
import { computed, signal, untracked, useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { robotNow, shownNow } from "../../model/time/clock";
import { begin, entries, gaps, stepStory, stopStory } from "../../model/story/log";
import { open, texts, theme } from "../../model/page";
import { moment } from "../../model/time/past";
import { scrubByKey, showMoment } from "../../model/time/scrub";
import { HOLDS, LIFECYCLE, OPERATION, PHASE, TARGET, type Entry, type Severity, type Span } from "../../model/story/story";
import { clockTime, dateTime, span as spanText } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { AXIS_PX, drawTimeline, ROW_PX, type TimelineRow } from "./draw";

/** What is seen: at most so many milliseconds, up to a time; `null` is now. */
const seen = signal<{ readonly length: number; readonly end: number | null }>({ length: 600_000, end: null });
const SHORTEST_MS = 1000;
const ZOOM = 1.6;

/** From when to when the timeline is seen. */
function seenFromTo(): { from: number; to: number } {
  const now = robotNow();
  const first = Math.min(begin.value ?? now - 60_000, now - 10_000);
  const length = Math.min(seen.value.length, (now - first) * 1.02);
  const to = seen.value.end ?? now + length * 0.02;
  return { from: to - length, to };
}

/** Zoom about a time that stays in its place. */
function zoom(factor: number, about?: number): void {
  const { from, to } = seenFromTo();
  const now = robotNow();
  const fixed = about ?? moment.value ?? (seen.value.end === null ? now : (from + to) / 2);
  const length = Math.max(SHORTEST_MS, (to - from) * factor);
  const end = fixed + (to - fixed) * (length / (to - from));
  seen.value = { length, end: end >= now ? null : end };
}

function pan(ms: number): void {
  const { from, to } = seenFromTo();
  const first = (begin.value ?? from) - (to - from) / 2;
  const end = Math.max(first + (to - from) / 2, to + ms);
  seen.value = { length: to - from, end: end >= robotNow() + (to - from) * 0.02 ? null : end };
}

/** Move so that the moment is in sight, in the middle if it was not; back to now with the moment. */
function follow(at: number | null): void {
  const { length, end } = seen.peek();
  const { from, to } = untracked(seenFromTo);
  if (at === null) seen.value = { length, end: null };
  else if (at < from || at > to) seen.value = { length, end: at + (to - from) / 2 };
  else if (end === null) seen.value = { length, end: to };
}

const rows = computed<readonly TimelineRow[]>(() => {
  const t = texts.value.log.rows;
  const told = stepStory.value.reader.rows;
  const marks = (kind: Entry["kind"]) => entries.value.filter((entry) => entry.kind === kind);
  const row = (title: string, spans: readonly Span[] = [], marked: TimelineRow["marks"] = []): TimelineRow => ({ title, spans, marks: marked });
  const operations = [...told].filter(([name]) => name.startsWith(OPERATION)).sort(([one], [other]) => (one < other ? -1 : 1));
  return [
    row(t.lifecycle, told.get(LIFECYCLE)),
    row(t.phase, told.get(PHASE)),
    row(t.target, told.get(TARGET), marks("target").filter(({ severity }) => severity > 0)),
    ...operations.map(([name, spans]) => row(name.slice(OPERATION.length), spans)),
    row(t.holds, told.get(HOLDS)),
    row(t.codes, [], marks("code")),
    row(t.stops, stopStory.value.reader.spans),
  ];
});

/** What lasts at a time, by rows. */
function lasting(at: number): { row: string; span: Span }[] {
  return rows.value.flatMap(({ title, spans }) =>
    spans.filter(({ from, to }) => from <= at && (to === undefined || to > at)).map((span) => ({ row: title, span })),
  );
}

/** While nothing happens it is drawn this often: now moves by a pixel or two. */
const DRAWN_EVERY_MS = 3000;
const turn = computed(() => Math.floor(shownNow.value / DRAWN_EVERY_MS));

/** The fingers that are on the canvas, by their pointers, where they are. */
type Fingers = Map<number, number>;

function Canvas() {
  const t = texts.value.log;
  const canvas = useRef<HTMLCanvasElement>(null);
  const hint = useSignal<{ x: number; y: number; text: string } | undefined>(undefined);
  const fingers = useRef<Fingers>(new Map());
  const moved = useRef(0);
  const size = useSignal(0);

  useEffect(() => {
    const watch = new ResizeObserver(([entry]) => (size.value = entry!.contentRect.width));
    watch.observe(canvas.current!);
    const wheel = (event: WheelEvent): void => {
      event.preventDefault();
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY) || event.shiftKey) panBy(event.deltaX || event.deltaY);
      else zoom(event.deltaY > 0 ? ZOOM : 1 / ZOOM, timeAt(event.clientX));
    };
    canvas.current!.addEventListener("wheel", wheel, { passive: false });
    return () => watch.disconnect();
  }, []);

  useSignalEffect(() => follow(moment.value));
  const frame = useRef(0);
  useSignalEffect(() => {
    void [size.value, theme.value, seen.value];
    const { from, to } = seenFromTo();
    void (moment.value === null && turn.value);
    const now = robotNow();
    const label = to - from > 300_000 ? (at: number) => clockTime(at).slice(0, 5) : clockTime;
    const scene = { rows: rows.value, gaps: gaps.value, from, to, now, moment: moment.value, label };
    cancelAnimationFrame(frame.current);
    frame.current = requestAnimationFrame(() => canvas.current && drawTimeline(canvas.current, scene));
  });

  const timeAt = (clientX: number): number => {
    const { left, width } = canvas.current!.getBoundingClientRect();
    const { from, to } = seenFromTo();
    return from + ((clientX - left) / width) * (to - from);
  };
  const panBy = (pixels: number): void => {
    const { from, to } = seenFromTo();
    pan((pixels / canvas.current!.clientWidth) * (to - from));
  };

  const down = (event: PointerEvent): void => {
    canvas.current!.setPointerCapture(event.pointerId);
    fingers.current.set(event.pointerId, event.clientX);
    moved.current = 0;
  };
  const move = (event: PointerEvent): void => {
    const before = fingers.current.get(event.pointerId);
    if (before === undefined) {
      point(event);
      return;
    }
    const others = [...fingers.current].filter(([id]) => id !== event.pointerId).map(([, x]) => x);
    moved.current += Math.abs(event.clientX - before);
    fingers.current.set(event.pointerId, event.clientX);
    if (others.length) {
      const wide = Math.max(10, Math.abs(event.clientX - others[0]!));
      zoom(Math.max(10, Math.abs(before - others[0]!)) / wide, timeAt((event.clientX + others[0]!) / 2));
    } else if (moved.current > 4) panBy(before - event.clientX);
  };
  const up = (event: PointerEvent): void => {
    if (fingers.current.delete(event.pointerId) && moved.current <= 4 && event.type === "pointerup") void showMoment(timeAt(event.clientX));
  };
  const point = (event: PointerEvent): void => {
    const box = canvas.current!.getBoundingClientRect();
    const y = event.clientY - box.top;
    const row = rows.value[Math.floor(y / ROW_PX)];
    const at = timeAt(event.clientX);
    const gap = gaps.value.find(({ from, to }) => from <= at && (to ?? Infinity) > at);
    const found = row?.spans.findLast(({ from, to }) => from <= at && (to === undefined || to > at));
    const text = gap?.text ?? (found && `${row!.title}: ${found.text} (${spanText(((found.to ?? robotNow()) - found.from) / 1000)})`);
    hint.value = { x: event.clientX - box.left, y, text: [clockTime(at), text].filter(Boolean).join(" · ") };
  };
  const key = (event: KeyboardEvent): void => {
    if (scrubByKey(event)) return;
    if (event.key === "+" || event.key === "=") zoom(1 / ZOOM);
    else if (event.key === "-") zoom(ZOOM);
  };

  const at = moment.value;
  const now = shownNow.value;
  return (
    <div class="timeline-canvas" onPointerLeave={() => (hint.value = undefined)}>
      <canvas
        ref={canvas}
        style={{ height: `${rows.value.length * ROW_PX + AXIS_PX}px` }}
        role="slider"
        tabIndex={0}
        aria-label={t.timeline}
        aria-description={t.keys}
        aria-valuemin={Math.round(begin.value ?? now)}
        aria-valuemax={Math.round(robotNow())}
        aria-valuenow={Math.round(now)}
        aria-valuetext={at === null ? t.momentNow(dateTime(now)) : dateTime(now)}
        onPointerDown={down}
        onPointerMove={move}
        onPointerUp={up}
        onPointerCancel={up}
        onKeyDown={key}
      />
      {hint.value && (
        <div class="timeline-hint" style={{ left: `${Math.max(0, hint.value.x - 60)}px`, top: `${hint.value.y + 18}px` }}>
          {hint.value.text}
        </div>
      )}
    </div>
  );
}

const SIGNS: Record<Severity, string> = { 0: "●", 1: "▲", 2: "✖" };

function LastingTable() {
  const t = texts.value.log;
  return (
    <table>
      <caption class="soft">{t.spanTable}</caption>
      <thead>
        <tr>
          <th>{t.row}</th>
          <th>{t.columns.text}</th>
          <th>{t.since}</th>
          <th>{t.until}</th>
        </tr>
      </thead>
      <tbody>
        {lasting(shownNow.value).map(({ row, span }) => (
          <tr>
            <th scope="row">{row}</th>
            <td>
              {span.severity > 0 && `${SIGNS[span.severity]} `}
              {span.state ? (
                <button class="link" onClick={() => open(`chart/${span.state}`)}>
                  {span.text}
                </button>
              ) : (
                span.text
              )}
            </td>
            <td>{clockTime(span.from)}</td>
            <td>{span.to === undefined ? t.lasts : clockTime(span.to)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

export function Timeline() {
  const t = texts.value.log;
  const tools = (
    <span class="row">
      <button aria-label={t.zoomIn} title={t.zoomIn} onClick={() => zoom(1 / ZOOM)}>
        +
      </button>
      <button aria-label={t.zoomOut} title={t.zoomOut} onClick={() => zoom(ZOOM)}>
        −
      </button>
      <button onClick={() => (seen.value = { length: Infinity, end: null })}>{t.whole}</button>
    </span>
  );
  return (
    <Panel title={t.timeline} tools={tools} class="timeline">
      <div class="timeline-body">
        <ul class="timeline-rows" aria-hidden="true">
          {rows.value.map(({ title }) => (
            <li style={{ height: `${ROW_PX}px` }} title={title}>
              {title}
            </li>
          ))}
        </ul>
        <Canvas />
      </div>
      <details>
        <summary>{t.asTable}</summary>
        <LastingTable />
      </details>
    </Panel>
  );
}
