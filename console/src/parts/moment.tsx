// The moment that is shown: now, or one of the past. All views follow it.
import { robotNow, shownNow } from "../model/time/clock";
import { isLoading } from "../model/time/history";
import { begin, gaps, problems, stepStory } from "../model/story/log";
import { texts } from "../model/page";
import { moment } from "../model/time/past";
import { goLive, goProblem, goStep, hasProblem, scrubByKey, showMoment } from "../model/time/scrub";
import { LIFECYCLE, type Span } from "../model/story/story";
import { timeWithZone } from "./format";
import "./moment.css";

/** The parts of the strip are so fine; what is narrower is not drawn. */
const FINEST = 1 / 600;

/** A strip of all that is known: the phases of life, problems and gaps. */
function Strip(props: { from: number; to: number }) {
  const { from, to } = props;
  const place = (at: number): number => Math.min(1, Math.max(0, (at - from) / (to - from)));
  const part = (span: Span, index: number, kind: string) => {
    const left = place(span.from);
    const width = place(span.to ?? to) - left;
    if (width < FINEST) return null;
    return <rect key={`${kind}${index}`} class={kind} x={left} width={width} y={0} height={1} />;
  };
  let last = -1;
  const marks = problems.value.flatMap(({ at, severity }, index) => {
    const x = place(at);
    if (x - last < FINEST) return [];
    last = x;
    return [<rect key={`p${index}`} class={severity > 1 ? "error" : "warning"} x={x - 0.001} width={0.002} y={severity > 1 ? 0 : 0.4} height={1} />];
  });
  return (
    <svg class="strip" viewBox="0 0 1 1" preserveAspectRatio="none" aria-hidden="true">
      {stepStory.value.reader.rows.get(LIFECYCLE)!.map((span, index) => part(span, index, `life ${span.severity ? "fault" : `n${index % 2}`}`))}
      {gaps.value.map((span, index) => part(span, index, "gap"))}
      {marks}
    </svg>
  );
}

export function MomentBar() {
  const t = texts.value.log;
  const at = moment.value;
  const now = robotNow();
  const to = at === null ? shownNow.value : Math.max(at, now);
  const from = Math.min(begin.value ?? to, to - 1000);
  const time = timeWithZone(shownNow.value);
  return (
    <footer class={`moment ${at === null ? "" : "in-past"}`} aria-label={t.momentBar}>
      <span class="moment-buttons">
        <button aria-label={t.previousProblem} title={t.previousProblem} disabled={!hasProblem.before.value} onClick={() => goProblem(-1)}>
          ▲◀
        </button>
        <button aria-label={t.previousStep} title={t.previousStep} onClick={() => goStep(-1)}>
          ◀
        </button>
        <button aria-label={t.nextStep} title={t.nextStep} disabled={at === null} onClick={() => goStep(1)}>
          ▶
        </button>
        <button aria-label={t.nextProblem} title={t.nextProblem} disabled={!hasProblem.after.value} onClick={() => goProblem(1)}>
          ▶▲
        </button>
      </span>
      <span class="moment-track">
        <Strip from={from} to={to} />
        <input
          type="range"
          aria-label={t.momentBar}
          aria-valuetext={at === null ? t.momentNow(time) : time}
          min={from}
          max={to}
          step="any"
          value={at ?? to}
          onInput={({ currentTarget }) => void showMoment(currentTarget.valueAsNumber >= to - (to - from) / 500 ? Infinity : currentTarget.valueAsNumber)}
          onKeyDown={scrubByKey}
        />
      </span>
      <span class="moment-time">
        {at !== null && <strong class="moment-past">{t.past}</strong>}
        <time dateTime={new Date(shownNow.value).toISOString()}>{time}</time>
        {isLoading.value && at === null && <span class="soft"> {t.loading}</span>}
      </span>
      <button class={at === null ? "" : "main"} aria-pressed={at === null} title={t.liveHint} aria-keyshortcuts="L" onClick={goLive}>
        ● {t.live}
      </button>
    </footer>
  );
}
