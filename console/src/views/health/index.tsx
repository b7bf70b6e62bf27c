// How nodes, machines and the battery are, and what the log warns of.
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { shownNow } from "../../model/time/clock";
import { battery, diagnostics, ENDED, NODE_SILENT_S, nodesNow, nodesOnNetwork, WARNED, type NodeHealth } from "../../model/robot/health";
import { texts } from "../../model/page";
import { isStale } from "../../model/topics";
import { moment, type Known } from "../../model/time/past";
import { notifications } from "../../model/people";
import { rosout } from "../../model/robot/rosout";
import { link } from "../../wire/link";
import { ago, clockTime, dateTime, number, span } from "../../parts/format";
import { Panel, Pill } from "../../parts/panel";
import { Sparkline } from "../../parts/sparkline";
import "./health.css";

/** Milliseconds between two looks at which nodes are on the network. */
const LOOK_EVERY_MS = 5000;
/** Lines of the log that are shown. */
const MOST_LINES = 200;
/** Less charge than this is a warning. */
const LOW_CHARGE = 0.2;
/** Less room than this on the disk is bad, and less than five times as much is a warning. */
const LEAST_DISK_GB = 1;
/** Seconds of silence after which the battery is not heard any more. */
const BATTERY_SILENT_S = 5;

const onNetwork = signal<readonly string[]>([]);
const severity = signal<"warn" | "error">("warn");

function isSilent(node: NodeHealth, now: number): boolean {
  return node.level !== ENDED && now - node.at > (moment.value === null ? NODE_SILENT_S : NODE_SILENT_S + 5) * 1000;
}

function valueOf(node: NodeHealth, name: string): number | undefined {
  const text = node.values[name];
  return text === undefined ? undefined : Number(text);
}

function State({ node, now }: { node: NodeHealth; now: number }) {
  const t = texts.value.health;
  if (node.level === ENDED) return <Pill>{t.endedAt(clockTime(node.at))}</Pill>;
  if (isSilent(node, now)) return <Pill tone="bad">{t.silentSince(clockTime(node.at))}</Pill>;
  if (node.level >= WARNED) return <Pill tone={node.level > WARNED ? "bad" : "warn"}>{node.message}</Pill>;
  return <Pill tone="good">{t.running}</Pill>;
}

function Rates({ node }: { node: NodeHealth }) {
  const t = texts.value.health;
  const told = node.rates.filter(([, rate]) => rate > 0).length;
  if (!node.rates.length) return <>–</>;
  return (
    <details>
      <summary>{t.topics(told, node.rates.length)}</summary>
      <ul class="rates">
        {node.rates.map(([topic, rate]) => (
          <li key={topic} class={rate ? "" : "soft"}>
            <code>{topic}</code> {number(rate)} Hz
          </li>
        ))}
      </ul>
    </details>
  );
}

/** Roles are said, because on a phone rows are laid out as cards, and a browser takes those for no table. */
function NodeRow({ node, now }: { node: NodeHealth; now: number }) {
  const t = texts.value.health;
  const gone = node.level === ENDED || isSilent(node, now);
  return (
    <tr role="row" class={gone ? "gone" : ""}>
      <th role="rowheader" scope="row">
        {node.name}
      </th>
      <td role="cell">
        <State node={node} now={now} />
      </td>
      <td role="cell" data-label={t.heard}>
        {ago((now - node.at) / 1000)}
      </td>
      <td role="cell" data-label={t.up}>
        {span(valueOf(node, "up (s)") ?? 0)}
      </td>
      <td role="cell" data-label={t.processor}>
        {number(valueOf(node, "processor (%)"))} %
      </td>
      <td role="cell" data-label={t.memory}>
        {number(valueOf(node, "memory (MB)"), 0)} MB
      </td>
      <td role="cell" data-label={t.published}>
        <Rates node={node} />
      </td>
    </tr>
  );
}

/** A node that fell silent before this page was opened: the gateway knows since when. */
function LostRow({ name, since }: { name: string; since: number }) {
  return (
    <tr role="row" class="gone">
      <th role="rowheader" scope="row">
        {name}
      </th>
      <td role="cell">
        <Pill tone="bad">{texts.value.health.silentSince(clockTime(since * 1000))}</Pill>
      </td>
      <td role="cell" colSpan={5} />
    </tr>
  );
}

function Nodes({ nodes, now }: { nodes: readonly NodeHealth[]; now: number }) {
  const t = texts.value.health;
  const told = new Set(nodes.map(({ name }) => name));
  const isLive = moment.value === null;
  const lost = notifications.value.filter(({ kind, about, over }) => isLive && kind === "node" && over === null && !told.has(about));
  for (const { about } of lost) told.add(about);
  const others = onNetwork.value.filter((name) => isLive && !told.has(name));
  return (
    <Panel title={t.nodes}>
      {nodes.length === 0 && <p class="soft">{t.nothing}</p>}
      <div class="scroll">
        <table role="table">
          <thead role="rowgroup">
            <tr role="row">
              {[t.node, t.state, t.heard, t.up, t.processor, t.memory, t.published].map((text) => (
                <th key={text} role="columnheader" scope="col">
                  {text}
                </th>
              ))}
            </tr>
          </thead>
          <tbody role="rowgroup">
            {nodes.map((node) => (
              <NodeRow key={node.name} node={node} now={now} />
            ))}
            {lost.map(({ id, about, first }) => (
              <LostRow key={id} name={about} since={first} />
            ))}
            {others.map((name) => (
              <tr role="row" key={name}>
                <th role="rowheader" scope="row">
                  {name}
                </th>
                <td role="cell" colSpan={6} class="soft">
                  {t.foreign}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </Panel>
  );
}

/** A share of 0 to 1: good up to `low`, bad beyond `high`; of what should be much, `much`, the other way round. */
function Gauge({ label, share, text, low = 0.7, high = 0.9, much = false }: { label: string; share: number; text: string; low?: number; high?: number; much?: boolean }) {
  const level = much ? Number(share < high) + Number(share < low) : Number(share > low) + Number(share > high);
  const sign = ["", "▲ ", "✖ "][level]!;
  return (
    <div class="gauge">
      <span>{label}</span>
      <meter min={0} max={1} low={low} high={high} optimum={much ? 1 : 0} value={Math.max(0, Math.min(1, share))} aria-label={`${label}: ${text}`} />
      <span class={["", "warn", "bad"][level]!}>{sign + text}</span>
    </div>
  );
}

function Machine({ name, node, silent }: { name: string; node: NodeHealth; silent: boolean }) {
  const t = texts.value.health;
  const value = (of: string): number => valueOf(node, of) ?? 0;
  const [memory, memoryFree] = [value("machine memory (MB)"), value("machine memory free (MB)")];
  const [disk, diskFree] = [value("disk (GB)"), value("disk free (GB)")];
  const busy = value("machine processor (%)") / 100;
  return (
    <div class={silent ? "machine silent" : "machine"}>
      <h3>{name}</h3>
      {silent && <Pill tone="warn">{t.silentSince(clockTime(node.at))}</Pill>}
      <Gauge label={t.processor} share={busy} text={`${number(busy * 100, 0)} %`} />
      <Gauge
        label={t.memory}
        share={memory ? 1 - memoryFree / memory : 0}
        text={t.free(`${number(memoryFree / 1000)} GB`, `${number(memory / 1000)} GB`)}
        low={0.85}
        high={0.95}
      />
      <Gauge
        label={t.disk}
        share={disk ? 1 - diskFree / disk : 0}
        text={t.free(`${number(diskFree)} GB`, `${number(disk, 0)} GB`)}
        low={disk ? 1 - (5 * LEAST_DISK_GB) / disk : 1}
        high={disk ? 1 - LEAST_DISK_GB / disk : 1}
      />
    </div>
  );
}

function Machines({ nodes, now }: { nodes: readonly NodeHealth[]; now: number }) {
  const t = texts.value.health;
  const newest = new Map<string, NodeHealth>();
  for (const node of nodes) if (node.level !== ENDED && node.at > (newest.get(node.machine)?.at ?? 0)) newest.set(node.machine, node);
  return (
    <Panel title={t.machines}>
      {[...newest].map(([name, node]) => (
        <Machine key={name} name={name} node={node} silent={isSilent(node, now)} />
      ))}
    </Panel>
  );
}

function BatteryPanel() {
  const t = texts.value.health;
  const known = battery.shown.value;
  const past = battery.past
    .until(moment.value)
    .flatMap(({ at, value }): Known<number>[] => (value.charge === undefined ? [] : [{ at, value: value.charge }]));
  const silent = known !== undefined && isStale(battery, BATTERY_SILENT_S);
  const charge = known?.value.charge;
  return (
    <Panel title={t.battery}>
      {known === undefined ? (
        <p class="soft">{t.noBattery}</p>
      ) : (
        <div class={silent ? "silent" : ""}>
          {charge !== undefined && <Gauge label={t.charge} share={charge} text={`${number(charge * 100, 0)} %`} low={LOW_CHARGE} high={2 * LOW_CHARGE} much />}
          <p>
            {known.value.voltage !== undefined && `${number(known.value.voltage)} V `}
            <Sparkline values={past} label={t.chargeHistory(past.length)} />
          </p>
        </div>
      )}
      {silent && <Pill tone="warn">{t.silentSince(clockTime(battery.heardAt.value ?? known.at))}</Pill>}
    </Panel>
  );
}

function Log() {
  const t = texts.value.health;
  const lines = rosout.past
    .until(moment.value)
    .filter(({ value }) => severity.value === "warn" || value.severity === "error")
    .slice(-MOST_LINES)
    .toReversed();
  const tools = (
    <select aria-label={t.show} value={severity.value} onChange={(event) => (severity.value = event.currentTarget.value as "warn" | "error")}>
      <option value="warn">{t.warnings}</option>
      <option value="error">{t.errors}</option>
    </select>
  );
  return (
    <Panel title={t.log} tools={tools}>
      {lines.length === 0 && <p class="soft">{t.noLines}</p>}
      <ol class="loglines" tabIndex={0} aria-label={t.log}>
        {lines.map(({ at, value }, index) => (
          <li key={`${at} ${index}`}>
            <Pill tone={value.severity === "error" ? "bad" : "warn"}>{value.severity === "error" ? t.error : t.warning}</Pill>{" "}
            <time title={dateTime(at)}>{clockTime(at)}</time> <b>{value.node}</b> <span>{value.text}</span>
          </li>
        ))}
      </ol>
    </Panel>
  );
}

export function HealthView() {
  useEffect(() => {
    const look = (): void => {
      if (link.state.peek() === "open") nodesOnNetwork().then((found) => (onNetwork.value = found), () => undefined);
    };
    look();
    const timer = setInterval(look, LOOK_EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  const known = moment.value === null ? nodesNow : (diagnostics.shown.value?.value ?? new Map<string, NodeHealth>());
  const nodes = [...known.values()].sort((one, other) => one.name.localeCompare(other.name));
  const now = shownNow.value;
  return (
    <div class="health">
      <Nodes nodes={nodes} now={now} />
      <div class="pair">
        <Machines nodes={nodes} now={now} />
        <BatteryPanel />
      </div>
      <Log />
    </div>
  );
}
