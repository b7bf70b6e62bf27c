// The chart that runs, live: where it is, what was just taken, what runs down, and on request why.
import { computed, useSignal } from "@preact/signals";
import { chart, steps, view } from "../../model/mission/mission";
import { route, texts } from "../../model/page";
import { moment } from "../../model/time/past";
import { Panel, Pill } from "../../parts/panel";
import "./chart.css";
import { Detail } from "./detail";
import { deepest, folded, foldedAt, inner, toggle, usualDepth } from "./folds";
import { around, choose, shortName } from "./names";
import { Stage } from "./stage";
import type { ChartRecord } from "../../records";

/** Hits of a search that are listed. */
const MOST_HITS = 20;

/** The state or transition that the page's address names. */
function chosen(): string {
  const name = route.value.startsWith("chart/") ? route.value.slice("chart/".length) : "";
  try {
    return decodeURIComponent(name);
  } catch {
    return name;
  }
}

export function ChartView() {
  const t = texts.value.chart;
  // A moment before this page heard of a chart shows the one that it knows, if the steps are of it.
  const record = chart.shown.value?.value ?? chart.past.at(null)?.value;
  if (!record) {
    return (
      <Panel title={t.title}>
        <p>{t.none}</p>
      </Panel>
    );
  }
  return <Chart key={`${record.hash} ${record.boot}`} record={record} />;
}

/** Of which chart the steps are that happen; it changes seldom, they often. */
const happening = computed(() => steps.shown.value?.value.chart);

/** The chart that was shown before, by which a new one is noticed. */
let before = "";

function Chart(props: { record: ChartRecord }) {
  const t = texts.value.chart;
  const { record } = props;
  const renewed = useSignal(startWith(record));
  const element = chosen();
  const stepsOf = happening.value ?? record.hash;
  return (
    <>
      <Panel title={t.title} class="chart" tools={<Search chart={record} />}>
        {renewed.value && (
          <p class="note info" role="status">
            {t.renewed(record.hash.slice(0, 8))} <button onClick={() => (renewed.value = false)}>{t.fine}</button>
          </p>
        )}
        {stepsOf !== record.hash && <p class="note warn" role="status">{t.otherChart(stepsOf.slice(0, 8), record.hash.slice(0, 8))}</p>}
        <div class="row">
          <Depth chart={record} />
          <Active />
        </div>
        <Stage chart={record} chosen={element} />
      </Panel>
      {element && (
        <Panel title={t.about} class="chart-detail">
          <Detail key={element} chart={record} element={element} tools={<Tools chart={record} element={element} />} />
        </Panel>
      )}
    </>
  );
}

/** Begin with a chart; says whether another one was shown before. */
function startWith(record: ChartRecord): boolean {
  const isOther = before !== "" && before !== record.hash && moment.peek() === null;
  if (before !== record.hash) folded.value = foldedAt(record, usualDepth(record));
  before = record.hash;
  return isOther;
}

function Depth(props: { chart: ChartRecord }) {
  const t = texts.value.chart;
  const last = deepest(props.chart);
  const depths = Array.from({ length: last }, (_, place) => place + 1);
  const names = folded.value;
  const isShown = (depth: number): boolean => {
    const wanted = foldedAt(props.chart, depth);
    return wanted.size === names.size && [...wanted].every((name) => names.has(name));
  };
  return (
    <label>
      {t.depth}{" "}
      <select
        value={depths.find(isShown) ?? ""}
        onChange={({ currentTarget }) => currentTarget.value && (folded.value = foldedAt(props.chart, Number(currentTarget.value)))}
      >
        <option value="">{t.byHand}</option>
        {depths.map((depth) => (
          <option value={depth}>{depth === last ? t.all : depth}</option>
        ))}
      </select>
    </label>
  );
}

function Tools(props: { chart: ChartRecord; element: string }) {
  const t = texts.value.chart;
  const { element } = props;
  return (
    <>
      {inner(props.chart).has(element) && (
        <button onClick={() => toggle(element)}>{folded.value.has(element) ? t.unfold : t.fold}</button>
      )}
      <button onClick={() => choose("")}>{t.close}</button>
    </>
  );
}

/** The innermost active states, each a button that leads there: what the picture shows, in words. */
function Active() {
  const t = texts.value.chart;
  const names = (view.value?.configuration ?? []).filter(Boolean);
  const parents = new Set(names.map(around));
  const innermost = names.filter((name) => !parents.has(name));
  return (
    <div class="row" role="group" aria-label={t.activeNow}>
      <span class="soft">{t.activeNow}</span>
      {innermost.map((name) => (
        <button class="small" title={name} onClick={() => choose(name)}>
          {shortName(name)}
        </button>
      ))}
      {view.value?.attempts
        .filter(({ tries }) => tries > 1)
        .map(({ operation, tries }) => <Pill tone="warn">{t.tries(operation, tries)}</Pill>)}
    </div>
  );
}

function Search(props: { chart: ChartRecord }) {
  const t = texts.value.chart;
  const wanted = useSignal("");
  const text = wanted.value.trim().toLowerCase();
  const states = Object.keys(props.chart.states).map((name) => ({ id: name, told: shortName(name), more: around(name) }));
  const arrows = Object.entries(props.chart.transitions).map(([id, { label, state }]) => ({
    id,
    told: label || id,
    more: shortName(state ?? ""),
  }));
  const fits = ({ id, told }: { id: string; told: string }): boolean => `${told} ${id}`.toLowerCase().includes(text);
  const hits = text ? [...states, ...arrows].filter(fits).slice(0, MOST_HITS) : [];
  const go = (id: string): void => {
    wanted.value = "";
    choose(id);
  };
  return (
    <form class="search" role="search" onSubmit={(event) => (event.preventDefault(), hits[0] && go(hits[0].id))}>
      <input
        type="search"
        placeholder={t.search}
        aria-label={t.search}
        value={wanted.value}
        onInput={({ currentTarget }) => (wanted.value = currentTarget.value)}
      />
      {text && (
        <ul aria-label={t.hits}>
          {hits.map(({ id, told, more }) => (
            <li>
              <button type="button" class="link" onClick={() => go(id)}>
                {told} <span class="soft">{more}</span>
              </button>
            </li>
          ))}
          {!hits.length && <li role="status">{t.noHits}</li>}
        </ul>
      )}
    </form>
  );
}
