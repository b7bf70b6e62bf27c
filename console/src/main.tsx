// The console: a bar with what matters most, the views, and on wide screens the mission's buttons beside each of them.
import { render } from "preact";
import { alerts, startAlerts } from "./model/alerts";
import { lostSince, startClock } from "./model/time/clock";
import { startHistory } from "./model/time/history";
import { startLog } from "./model/story/log";
import { state } from "./model/mission/mission";
import { missionSince } from "./model/mission/permission";
import { language, mode, open, route, startPage, stopLinked, texts, theme, type Language, type Theme } from "./model/page";
import { startScrubbing } from "./model/time/scrub";
import { startPlayback } from "./model/time/playback";
import { startSimulation } from "./model/mission/simulation";
import { startPeople } from "./model/people";
import { startTopics } from "./model/topics";
import { moment } from "./model/time/past";
import { clockTime } from "./parts/format";
import { MomentBar } from "./parts/moment";
import { Robots, startRobots } from "./parts/robots";
import { Contained, Pill } from "./parts/panel";
import { VirtualBar } from "./parts/virtual";
import "./style/base.css";
import { VIEWS } from "./views/list";
import { link } from "./wire/link";

/** How the connections are: that of what is shown, and that of the stop. */
function Linked() {
  const t = texts.value.shell;
  const linked = link.state.value;
  if (linked === "open" && !stopLinked.value) return <Pill tone="bad">{t.stopLost}</Pill>;
  return <Pill tone={linked === "open" ? "good" : linked === "lost" ? "bad" : "info"}>{t[linked]}</Pill>;
}

/** Of when the mission is that is shown, where nothing newer is known. */
function AsOf() {
  const t = texts.value.shell;
  const since = isOld() ? missionSince.value : undefined;
  return (
    <span role="status" class="bad as-of">
      {since !== undefined && t.asOf(clockTime(since), lostSince.value === undefined ? t.silent : t.lost)}
    </span>
  );
}

/** Whether what is shown is not of now any more: all of it, or the mission only. */
function isOld(what: "all" | "mission" = "mission"): boolean {
  const since = what === "all" ? lostSince.value : missionSince.value;
  return mode.value !== "recording" && moment.value === null && since !== undefined;
}

const SIGNS = { stop: "■", fault: "✖", question: "?" } as const;

/** What everybody is to see at once, in each view; a press leads to where something can be done about it. */
function Alerts() {
  return (
    <div class="alerts" role="alert">
      {alerts.value.map(({ kind, text, isSaid }) => isSaid || (
        <a key={text} href="#control" class={`alert ${kind === "question" ? "warn" : "bad"}`} onClick={() => open("control")}>
          <span aria-hidden="true">{SIGNS[kind]}</span> {text}
        </a>
      ))}
    </div>
  );
}

function Bar() {
  const t = texts.value.shell;
  const now = state.shown.value?.value;
  return (
    <section class="bar" aria-label={t.now}>
      <Linked />
      <AsOf />
      {now ? (
        <span class={isOld() ? "where stale" : "where"} role="status">
          <b>{now.lifecycle_state || "–"}</b> {now.mission_phase} {now.current_target && `· ${now.current_target}`}
          {now.paused && <Pill tone="warn">{t.paused}</Pill>}
        </span>
      ) : (
        <span class="where">{t.noState}</span>
      )}
    </section>
  );
}

function Settings() {
  const t = texts.value.shell;
  return (
    <details class="settings">
      <summary>
        <span class="wide">{t.settings}</span>
        <span class="narrow">⋯ {t.more}</span>
      </summary>
      <label>
        {t.language}{" "}
        <select value={language.value} onChange={(event) => (language.value = event.currentTarget.value as Language)}>
          <option value="en">English</option>
          <option value="nl">Nederlands</option>
        </select>
      </label>
      <label>
        {t.theme}{" "}
        <select value={theme.value} onChange={(event) => (theme.value = event.currentTarget.value as Theme)}>
          {(["auto", "light", "dark"] as const).map((each) => (
            <option value={each}>{t.themes[each]}</option>
          ))}
        </select>
      </label>
    </details>
  );
}

function Badge({ count = 0, text = "" }: { count?: number; text?: string }) {
  if (!count) return null;
  return (
    <span class="badge" title={text}>
      {count}
      <span class="unseen"> {text}</span>
    </span>
  );
}

function Console() {
  const t = texts.value;
  const views = VIEWS.filter(({ only }) => !only || only === mode.value);
  const shown = views.find(({ id }) => route.value.split("/")[0] === id) ?? VIEWS[0]!;
  const control = VIEWS[0]!;
  const stale = (ofMission: boolean): string => (isOld(ofMission ? "mission" : "all") ? "stale" : "");
  return (
    <>
      <a class="skip" href="#content" onClick={(event) => (event.preventDefault(), document.getElementById("content")?.focus())}>
        {t.shell.skip}
      </a>
      <nav aria-label={t.shell.views}>
        {views.map(({ id, sign, title, waiting }) => (
          <a href={`#${id}`} aria-current={id === shown.id ? "page" : undefined} onClick={() => open(id)}>
            <span aria-hidden="true">{sign}</span> {title(t)} <Badge {...waiting?.(t)} />
          </a>
        ))}
        <Settings />
      </nav>
      <div class="bars">
        <Robots />
        <Alerts />
        <VirtualBar />
        <Bar />
      </div>
      <main id="content" tabIndex={-1} class={shown === control ? "alone" : ""}>
        <h1 class="unseen">{shown.title(t)}</h1>
        <div class={`view ${stale(!!shown.ofMission)}`} key={shown.id}>
          <Contained>
            <shown.View />
          </Contained>
        </div>
        {shown !== control && (
          <aside class={`beside ${stale(true)}`} aria-label={control.title(t)}>
            <Contained>
              <control.View />
            </Contained>
          </aside>
        )}
      </main>
      <Contained>
        <MomentBar />
      </Contained>
    </>
  );
}

startPage();
startClock();
startHistory();
startTopics();
startLog();
startScrubbing();
startSimulation();
startPlayback();
startPeople();
startAlerts();
startRobots();
link.start();
render(<Console />, document.getElementById("console")!);
