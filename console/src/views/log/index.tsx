// What happened: the timeline, and the log below it. Whatever is clicked there sets the moment that all views show.
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { robotNow } from "../../model/time/clock";
import { forgetOlder, hasOlder, isLoading, loadOlder } from "../../model/time/history";
import { entries } from "../../model/story/log";
import { open, texts } from "../../model/page";
import { moment } from "../../model/time/past";
import { goTarget, showMoment, timeOfDay } from "../../model/time/scrub";
import { KINDS, type Kind, type Severity } from "../../model/story/story";
import { dateTime } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { hidden, least, lines, targets, wantedTarget, wantedText } from "./filter";
import { Lines } from "./lines";
import "./log.css";
import { save } from "./save";
import { Timeline } from "./timeline";

function toggle(kind: Kind): void {
  const next = new Set(hidden.value);
  if (!next.delete(kind)) next.add(kind);
  hidden.value = next;
}

function Jump() {
  const t = texts.value.log;
  const wrong = useSignal(false);
  return (
    <label>
      {t.jump}{" "}
      <input
        class="jump"
        placeholder="03:12"
        title={t.jumpHint}
        aria-invalid={wrong.value}
        onInput={() => (wrong.value = false)}
        onKeyDown={(event) => {
          if (event.key !== "Enter") return;
          const at = timeOfDay(event.currentTarget.value, robotNow());
          wrong.value = at === undefined;
          if (at !== undefined) void showMoment(at);
        }}
      />
      {wrong.value && (
        <span class="bad" role="alert">
          {" "}
          {t.noTime}
        </span>
      )}
    </label>
  );
}

/** There is room for all filters at once. */
const isWide = matchMedia("(min-width: 44rem)").matches;

function Filters() {
  const t = texts.value.log;
  return (
    <details class="log-filters" open={isWide}>
      <summary>{t.filter}</summary>
      <div class="row">
        <label>
          {t.text} <input type="search" value={wantedText.value} onInput={({ currentTarget }) => (wantedText.value = currentTarget.value)} />
        </label>
        <label>
          {t.columns.severity}{" "}
          <select value={least.value} onChange={({ currentTarget }) => (least.value = Number(currentTarget.value) as Severity)}>
            {t.severities.map((name, severity) => (
              <option value={severity}>{name}</option>
            ))}
          </select>
        </label>
        <label>
          {t.columns.target}{" "}
          <select value={wantedTarget.value} onChange={({ currentTarget }) => (wantedTarget.value = currentTarget.value)}>
            <option value="">{t.anyTarget}</option>
            {targets.value.map((target) => (
              <option value={target}>{target}</option>
            ))}
          </select>
        </label>
        <button disabled={!wantedTarget.value} title={t.goTargetHint} onClick={() => goTarget(wantedTarget.value)}>
          {t.goTarget}
        </button>
        <details class="log-kinds">
          <summary>
            {t.columns.kind}
            {hidden.value.size > 0 && ` (${KINDS.length - hidden.value.size}/${KINDS.length})`}
          </summary>
          <fieldset>
            {KINDS.map((kind) => (
              <label>
                <input type="checkbox" checked={!hidden.value.has(kind)} onChange={() => toggle(kind)} /> {t.kind[kind]}
              </label>
            ))}
          </fieldset>
        </details>
        <Jump />
        <span class="row">
          {(["csv", "json"] as const).map((kind) => (
            <button disabled={!lines.value.length} onClick={() => save(lines.value, kind)}>
              {t.export} {kind.toUpperCase()}
            </button>
          ))}
        </span>
      </div>
    </details>
  );
}

/** The last line at the moment that is shown, in full. */
function Detail() {
  const t = texts.value.log;
  const entry = lines.value.findLast(({ at }) => at <= (moment.value ?? Infinity));
  if (!entry) return null;
  const { at, text, state, commands = [], notes = [], sequence, severity, kind } = entry;
  return (
    <div class="log-detail" role="status">
      <p>
        <time>{dateTime(at)}</time> · {t.severity[severity]} · {t.kind[kind]}
        {sequence !== undefined && ` · ${t.step(sequence)}`}
      </p>
      <p>{text}</p>
      {[...commands, ...notes].map((line) => (
        <p class="soft">{line}</p>
      ))}
      {state && (
        <button class="link" onClick={() => open(`chart/${state}`)}>
          {t.openState(state)}
        </button>
      )}
    </div>
  );
}

export function LogView() {
  const t = texts.value.log;
  useEffect(() => forgetOlder, []);
  const [shown, all] = [lines.value.length, entries.value.length];
  const empty = isLoading.value ? t.loading : all ? t.nothingFound : t.nothing;
  return (
    <>
      <Timeline />
      <Panel title={t.title} tools={<span class="soft">{t.showing(shown, all)}</span>} class="log">
        <Filters />
        {hasOlder() && (
          <button class="log-older" disabled={isLoading.value} onClick={() => void loadOlder()}>
            {t.older}
          </button>
        )}
        {shown ? <Lines /> : <p class="note soft">{empty}</p>}
        <Detail />
      </Panel>
    </>
  );
}
