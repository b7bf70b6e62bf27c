// All tags as a table: what is known of each, and how it came to be.
import { signal } from "@preact/signals";
import { shownNow } from "../../model/time/clock";
import { open, texts } from "../../model/page";
import { picked, picking, toggle } from "../../model/mission/picking";
import { measured, sensorName } from "../../model/robot/sensors";
import { isStale, useTopic } from "../../model/topics";
import { TWIN_SILENT_S, twin, valueOf } from "../../model/robot/twin";
import { isoTime, saveCsv } from "../../parts/csv";
import { ago, clockTime, number } from "../../parts/format";
import { Panel, Pill, type Tone } from "../../parts/panel";
import { Sparkline } from "../../parts/sparkline";
import { columnKey, exported, FRESH_S, matches, rows, sensors, sorted, type Column, type Outcome, type Row } from "./rows";
import "./twin.css";

type Only = "all" | "anomalies" | "old" | "failed";

const order = signal<{ readonly column: Column; readonly down: boolean }>({ column: "id", down: false });
const wanted = signal("");
const only = signal<Only>("all");
/** The tag at which the keyboard is. */
const cursor = signal("");

const TONES: Readonly<Record<Outcome, Tone>> = { ok: "good", unreachable: "bad", scanFailed: "warn", skipped: "plain" };

function isWanted(row: Row): boolean {
  if (!matches(row, wanted.value.trim())) return false;
  if (only.value === "anomalies") return row.tag.anomaly;
  if (only.value === "old") return row.age === undefined || row.age > FRESH_S;
  return only.value !== "failed" || (row.visit !== undefined && row.visit.outcome !== "ok");
}

/** What a press on a tag does: it is picked while a form asks for tags, else it is shown on the map. */
function choose(id: string): void {
  if (picking.value) toggle(id);
  else open(`map/${id}`);
}

function Head(props: { column: Column; text: string; class?: string }) {
  const { column, down } = order.value;
  const here = columnKey(column) === columnKey(props.column);
  return (
    <th scope="col" class={props.class} aria-sort={here ? (down ? "descending" : "ascending") : undefined}>
      <button class="sort" onClick={() => (order.value = { column: props.column, down: here && !down })}>
        {props.text}
        <span aria-hidden="true">{here ? (down ? " ▼" : " ▲") : ""}</span>
      </button>
    </th>
  );
}

function SensorCell({ row, sensor }: { row: Row; sensor: string }) {
  const past = row.past[sensor] ?? [];
  const value = valueOf(row.tag, sensor);
  const text = value === undefined ? "–" : measured(sensor, value);
  const first = past[0];
  const label = first
    ? texts.value.twin.history(sensorName(sensor), past.length, clockTime(first.at))
    : texts.value.twin.noHistory(sensorName(sensor));
  return (
    <td class="sensor">
      {text} <Sparkline values={past} label={label} />
    </td>
  );
}

function TagRow({ row }: { row: Row }) {
  const t = texts.value.twin;
  const { tag, age, visit } = row;
  const id = tag.tag_id;
  const old = age === undefined || age > FRESH_S;
  const seen = age === undefined ? texts.value.map.neverRead : ago(age);
  const isPicked = picking.value !== undefined && picked.value.includes(id);
  return (
    <tr class={`${old ? "old" : ""} ${isPicked ? "picked" : ""}`}>
      <th scope="row">
        <button
          class="tag"
          data-tag={id}
          tabIndex={cursor.value === id ? 0 : -1}
          aria-label={picking.value ? t.pick(id) : t.onMap(id)}
          aria-pressed={picking.value ? isPicked : undefined}
          onFocus={() => (cursor.value = id)}
          onClick={() => choose(id)}
        >
          {isPicked ? "✓ " : ""}
          {id}
        </button>
      </th>
      <td>
        {old ? <Pill>{seen}</Pill> : seen}
      </td>
      <td>{visit ? <Pill tone={TONES[visit.outcome]} title={visit.detail}>{t.outcomes[visit.outcome]}</Pill> : "–"}</td>
      <td>
        {tag.anomaly && <Pill tone="bad">{t.anomaly}</Pill>} {tag.species || "–"}
        {tag.species && <span class="soft"> {number((tag.species_confidence ?? 0) * 100, 0)} %</span>}
        {tag.flowers.length > 0 && <span class="soft"> · {t.flowers(tag.flowers.length)}</span>}
      </td>
      {sensors.value.map((sensor) => (
        <SensorCell key={sensor} row={row} sensor={sensor} />
      ))}
    </tr>
  );
}

/** Arrow keys go through the rows. */
function onKeys(event: KeyboardEvent): void {
  const step = { ArrowDown: 1, ArrowUp: -1, Home: -Infinity, End: Infinity }[event.key];
  const all = [...(event.currentTarget as HTMLElement).querySelectorAll<HTMLButtonElement>("button.tag")];
  const here = all.findIndex((each) => each === document.activeElement);
  if (step === undefined || here < 0) return;
  event.preventDefault();
  all[Math.max(0, Math.min(all.length - 1, here + step))]?.focus();
}

function Tools({ shown }: { shown: readonly Row[] }) {
  const t = texts.value.twin;
  return (
    <div class="row">
      <input
        type="search"
        aria-label={t.search}
        placeholder={t.search}
        value={wanted.value}
        onInput={(event) => (wanted.value = event.currentTarget.value)}
      />
      <select aria-label={t.only} value={only.value} onChange={(event) => (only.value = event.currentTarget.value as Only)}>
        {(["all", "anomalies", "old", "failed"] as const).map((each) => (
          <option value={each}>{t.filters[each]}</option>
        ))}
      </select>
      <button disabled={!shown.length} onClick={() => saveCsv(`tags-${isoTime(shownNow.value).replaceAll(":", "")}.csv`, exported(shown))}>
        {t.export}
      </button>
    </div>
  );
}

export function TwinView() {
  const t = texts.value.twin;
  useTopic(twin);
  const all = rows.value;
  const shown = sorted(all.filter(isWanted), order.value.column, order.value.down);
  if (!shown.some(({ tag }) => tag.tag_id === cursor.value)) cursor.value = shown[0]?.tag.tag_id ?? "";
  const silent = isStale(twin, TWIN_SILENT_S);
  return (
    <Panel title={t.title} class="twin" tools={<Tools shown={shown} />}>
      <p role="status" class="soft">
        {picking.value ? t.picking(picking.value.field) : t.count(shown.length, all.length)}
        {silent && <Pill tone="warn">{twin.heardAt.value ? t.silentSince(clockTime(twin.heardAt.value)) : t.silent}</Pill>}
      </p>
      {all.length > 0 && (
        <div class={`scroll ${silent ? "silent" : ""}`} onKeyDown={onKeys}>
          <table>
            <thead>
              <tr>
                <Head column="id" text={t.tag} />
                <Head column="age" text={t.observed} />
                <Head column="visit" text={t.visit} />
                <Head column="species" text={t.species} />
                {sensors.value.map((sensor) => (
                  <Head key={sensor} column={{ sensor }} text={sensorName(sensor)} />
                ))}
              </tr>
            </thead>
            <tbody>
              {shown.map((row) => (
                <TagRow key={row.tag.tag_id} row={row} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Panel>
  );
}
