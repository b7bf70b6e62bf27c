// The console: a bar with what matters most, the views, and on wide screens the mission's buttons beside each of them.
import { render } from "preact";
import { startClock } from "./model/time/clock";
import { startHistory } from "./model/time/history";
import { startLog } from "./model/story/log";
import { state } from "./model/mission/mission";
import { language, mode, open, route, startPage, texts, theme, type Language, type Theme } from "./model/page";
import { startScrubbing } from "./model/time/scrub";
import { startPlayback } from "./model/time/playback";
import { startSimulation } from "./model/mission/simulation";
import { startPeople } from "./model/people";
import { startTopics } from "./model/topics";
import { MomentBar } from "./parts/moment";
import { Contained, Pill } from "./parts/panel";
import { VirtualBar } from "./parts/virtual";
import "./style/base.css";
import { VIEWS } from "./views/list";
import { link } from "./wire/link";

function Bar() {
  const t = texts.value.shell;
  const now = state.shown.value?.value;
  const linked = link.state.value;
  return (
    <section class="bar" aria-label={t.now}>
      <Pill tone={linked === "open" ? "good" : linked === "lost" ? "bad" : "info"}>{t[linked]}</Pill>
      {now ? (
        <span class="where" role="status">
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
      <summary>{t.settings}</summary>
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
        <VirtualBar />
        <Bar />
      </div>
      <main id="content" tabIndex={-1} class={shown === control ? "alone" : ""}>
        <h1 class="unseen">{shown.title(t)}</h1>
        <div class="view" key={shown.id}>
          <Contained>
            <shown.View />
          </Contained>
        </div>
        {shown !== control && (
          <aside class="beside" aria-label={control.title(t)}>
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
link.start();
render(<Console />, document.getElementById("console")!);
