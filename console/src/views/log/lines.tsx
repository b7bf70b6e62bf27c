// The lines of the log: only those are made that are to be seen.
import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { open, texts } from "../../model/page";
import { moment } from "../../model/time/past";
import { goLive, showMoment } from "../../model/time/scrub";
import type { Entry } from "../../model/story/story";
import { clockTime, dateTime } from "../../parts/format";
import { lines } from "./filter";

/** The height of a line in pixels; log.css has the same. */
const LINE_PX = 28;
/** Lines that are made above and below those that are seen. */
const MORE = 10;
const TONES = ["", "warn", "bad"] as const;
const SIGNS = ["●", "▲", "✖"] as const;

/** How many lines are not later than the moment that is shown. */
function upTo(list: readonly Entry[], at: number | null): number {
  if (at === null) return list.length;
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle]!.at <= at) low = middle + 1;
    else high = middle;
  }
  return low;
}

function Line(props: { entry: Entry; index: number; isCurrent: boolean; isLater: boolean }) {
  const t = texts.value.log;
  const { entry, index, isCurrent, isLater } = props;
  const { at, severity, text, moved, state, target, commands = [], notes = [] } = entry;
  const more = [...commands, ...(entry.kind === "code" ? [] : notes.map((note) => `(${note})`))].join(" · ");
  return (
    <div
      role="row"
      id={`line-${index}`}
      aria-rowindex={index + 2}
      aria-selected={isCurrent}
      class={`line ${TONES[severity]} ${isLater ? "later" : ""}`}
      style={{ top: `${index * LINE_PX}px` }}
      onClick={() => void showMoment(at)}
    >
      <span role="gridcell" class="line-time" title={dateTime(at)}>
        {clockTime(at)}
        <small>.{String(Math.floor(at % 1000)).padStart(3, "0")}</small>
      </span>
      <span role="gridcell" class="line-sign" title={t.severity[severity]}>
        <span aria-hidden="true">{SIGNS[severity]}</span>
        <span class="unseen">{t.severity[severity]}</span>
      </span>
      <span role="gridcell" class="line-moved">
        {moved && state ? (
          <button
            class="link"
            tabIndex={-1}
            title={t.openState(state)}
            onClick={(event) => {
              event.stopPropagation();
              void showMoment(at);
              open(`chart/${state}`);
            }}
          >
            {moved}
          </button>
        ) : (
          moved
        )}
      </span>
      <span role="gridcell" class="line-text" title={text}>
        {target && <b>{target} </b>}
        {text}
      </span>
      <span role="gridcell" class="line-more soft" title={more}>
        {more}
      </span>
    </div>
  );
}

export function Lines() {
  const t = texts.value.log;
  const box = useRef<HTMLDivElement>(null);
  const top = useSignal(0);
  const height = useSignal(400);
  const list = lines.value;
  const current = upTo(list, moment.value) - 1;

  useEffect(() => {
    const watch = new ResizeObserver(([entry]) => (height.value = entry!.contentRect.height));
    watch.observe(box.current!);
    return () => watch.disconnect();
  }, []);

  // The last line is kept in sight while it is now; the line of the moment when that changes.
  useSignalEffect(() => {
    const at = moment.value;
    const last = upTo(lines.value, at) - 1;
    requestAnimationFrame(() => show(last, at === null));
  });
  const show = (index: number, isLast: boolean): void => {
    const element = box.current;
    if (!element || index < 0) return;
    const [from, to] = [index * LINE_PX, (index + 2) * LINE_PX];
    if (isLast) element.scrollTop = element.scrollHeight;
    else if (from < element.scrollTop || to > element.scrollTop + element.clientHeight) element.scrollTop = from - element.clientHeight / 2;
  };

  const go = (index: number): void => {
    const entry = list[Math.max(0, index)];
    if (!entry) goLive();
    else void showMoment(entry.at);
  };
  const key = (event: KeyboardEvent): void => {
    const page = Math.max(1, Math.floor(height.value / LINE_PX) - 2);
    // Lines of one time are gone through as one.
    const at = list[current]?.at;
    const first = list.findIndex((entry) => entry.at === at);
    const steps: Record<string, () => void> = {
      ArrowUp: () => go(first - 1),
      ArrowDown: () => go(current + 1),
      PageUp: () => go(current - page),
      PageDown: () => go(current + page),
      Home: () => go(0),
      End: goLive,
      Enter: () => list[current]?.state && open(`chart/${list[current].state}`),
    };
    if (event.key === "Escape" && !event.shiftKey) goLive();
    else if (!steps[event.key]) return;
    else steps[event.key]!();
    event.preventDefault();
  };

  const from = Math.max(0, Math.floor(top.value / LINE_PX) - MORE);
  const to = Math.min(list.length, Math.ceil((top.value + height.value) / LINE_PX) + MORE);
  return (
    <div
      ref={box}
      class="lines"
      role="grid"
      tabIndex={0}
      aria-label={t.title}
      aria-rowcount={list.length + 1}
      aria-activedescendant={current >= from && current < to ? `line-${current}` : undefined}
      onScroll={({ currentTarget }) => (top.value = currentTarget.scrollTop)}
      onKeyDown={key}
    >
      <div role="row" aria-rowindex={1} class="line line-head">
        {(["time", "severity", "moved", "text", "commands"] as const).map((name) => (
          <span role="columnheader" class={{ time: "line-time", severity: "line-sign unseen", moved: "line-moved", text: "line-text", commands: "line-more" }[name]}>
            {t.columns[name]}
          </span>
        ))}
      </div>
      <div role="rowgroup" class="lines-all" style={{ height: `${list.length * LINE_PX}px` }}>
        {list.slice(from, to).map((entry, offset) => (
          <Line key={from + offset} entry={entry} index={from + offset} isCurrent={from + offset === current} isLater={from + offset > current} />
        ))}
      </div>
    </div>
  );
}
