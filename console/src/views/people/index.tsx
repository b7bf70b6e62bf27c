// Who else is here, what they pressed, what there is to know of, and the report of a shift.
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { shownNow } from "../../model/time/clock";
import { open, route, texts } from "../../model/page";
import { hindrance } from "../../model/mission/permission";
import { acknowledge, loadPressed, notifications, openNotifications, ownPage, people, pressed, type Pressed } from "../../model/people";
import { ago, clockTime, dateTime } from "../../parts/format";
import { Panel, Pill } from "../../parts/panel";
import "./people.css";
import { Report } from "./report";
import { sound } from "./sound";
import type { Notification } from "../../records";

/** Commands that are shown. */
const MOST_SHOWN = 100;

const problem = signal("");

function viewName(view: string): string {
  const found = (texts.value as unknown as Record<string, { title?: string }>)[view];
  return found?.title ?? view;
}

function Here() {
  const t = texts.value.people;
  const here = people.shown.value?.value.people ?? [];
  const now = shownNow.value / 1000;
  return (
    <Panel title={t.here}>
      <table>
        <thead>
          <tr>
            {[t.name, t.role, t.page, t.since].map((text) => (
              <th key={text} scope="col">
                {text}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {here.map((one) => (
            <tr key={one.page}>
              <th scope="row">
                {one.page} {one.page === ownPage.value && <Pill tone="info">{t.you}</Pill>}
              </th>
              <td>{t.roles[one.role as keyof typeof t.roles] ?? one.role}</td>
              <td>{one.view ? viewName(one.view) : t.noConsole}</td>
              <td title={dateTime(one.since * 1000)}>{ago(Math.max(0, now - one.since))}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </Panel>
  );
}

async function know(ids: readonly number[]): Promise<void> {
  problem.value = await acknowledge(ids);
}

function Times({ one }: { one: Notification }) {
  const t = texts.value.people;
  return (
    <span class="soft">
      <time title={dateTime(one.first * 1000)}>{clockTime(one.first * 1000)}</time>
      {one.times > 1 && ` · ${t.times(one.times, clockTime(one.last * 1000))}`}
      {one.over !== null && ` · ${t.over(clockTime(one.over * 1000))}`}
    </span>
  );
}

function Notice({ one, why }: { one: Notification; why: string }) {
  const t = texts.value.people;
  return (
    <li class={one.acknowledged === null ? "open" : "known"}>
      <Pill tone={one.severity > 1 ? "bad" : "warn"}>{t.kinds[one.kind as keyof typeof t.kinds] ?? one.kind}</Pill>
      <span class="what">
        {!one.text.includes(one.about) && <b>{one.about}</b>} {one.text} <Times one={one} />
      </span>
      {one.acknowledged === null ? (
        <button disabled={!!why} title={why} aria-label={t.acknowledgeNamed(one.text)} onClick={() => void know([one.id])}>
          {t.acknowledge}
        </button>
      ) : (
        <span class="soft" title={dateTime(one.acknowledged * 1000)}>
          ✓ {t.acknowledgedBy(one.by, clockTime(one.acknowledged * 1000))}
        </span>
      )}
    </li>
  );
}

function Notices() {
  const t = texts.value.people;
  const why = hindrance.value;
  const unknown = openNotifications.value;
  const tools = (
    <div class="row">
      <label>
        <input type="checkbox" checked={sound.value} onChange={(event) => (sound.value = event.currentTarget.checked)} /> {t.sound}
      </label>
      <button disabled={!!why || !unknown.length} title={why} onClick={() => void know(unknown.map(({ id }) => id))}>
        {t.acknowledgeAll}
      </button>
    </div>
  );
  return (
    <Panel title={t.notifications} tools={tools}>
      <p role="status" class="soft">
        {unknown.length ? t.open(unknown.length) : t.noneOpen}
      </p>
      {problem.value && <p class="note bad">✖ {problem.value}</p>}
      <ol class="notices" tabIndex={0} aria-label={t.notifications}>
        {notifications.value.map((one) => (
          <Notice key={one.id} one={one} why={why} />
        ))}
      </ol>
    </Panel>
  );
}

function PressedRow({ line }: { line: Pressed }) {
  const t = texts.value.people;
  const tone = line.accepted === false ? "warn" : line.accepted ? "good" : "plain";
  const at = Date.parse(line.wall);
  return (
    <tr>
      <td>
        <time title={dateTime(at)}>{clockTime(at)}</time>
      </td>
      <th scope="row">{line.page || line.who}</th>
      <td>
        <code>{line.name}</code> <span class="soft">{line.sent === "{}" ? "" : line.sent}</span>
      </td>
      <td>
        <Pill tone={tone}>{line.accepted === false ? t.refused : line.accepted ? t.accepted : t.sent}</Pill> {line.answer}
      </td>
    </tr>
  );
}

function PressedPanel() {
  const t = texts.value.people;
  const why = hindrance.value;
  const count = people.shown.value?.value.commands;
  const isAllowed = !why;
  useEffect(() => {
    if (isAllowed) void loadPressed().catch(() => undefined);
  }, [count, isAllowed]);
  return (
    <Panel title={t.pressed}>
      {why && <p class="note warn">{why}</p>}
      {isAllowed && pressed.value.length === 0 && <p class="soft">{t.nothingPressed}</p>}
      <div class="scroll" role="group" tabIndex={0} aria-label={t.pressed}>
        <table>
          <tbody>
            {pressed.value
              .slice(-MOST_SHOWN)
              .toReversed()
              .map((line) => (
                <PressedRow key={line.number} line={line} />
              ))}
          </tbody>
        </table>
      </div>
    </Panel>
  );
}

export function PeopleView() {
  const t = texts.value.people;
  if (route.value === "people/report") return <Report />;
  return (
    <div class="people">
      <div class="row">
        <a class="button" href="#people/report" onClick={() => open("people/report")}>
          {t.report.title}
        </a>
      </div>
      <Notices />
      <Here />
      <PressedPanel />
    </div>
  );
}
