// What is known of a state or an arrow: its lines, what can happen and why not, how often it was met.
import { useEffect, useState } from "preact/hooks";
import { shownNow } from "../../model/time/clock";
import { steps } from "../../model/mission/mission";
import { mode, texts } from "../../model/page";
import { moment, type Known } from "../../model/time/past";
import { ago, clockTime } from "../../parts/format";
import { Pill } from "../../parts/panel";
import type { ExplainResponse } from "../../ros";
import { link } from "../../wire/link";
import { choose, shortName } from "./names";
import type { ChartRecord, ExplanationRecord, RuleRecord, StateRecord, StepRecord, TransitionRecord } from "../../records";

/** Milliseconds between two questions why something can happen. */
const ASK_EVERY_MS = 400;
/** Moments that are listed, and lines of YAML. */
const LISTED = 6;
const LINES = 200;

export function Detail(props: { chart: ChartRecord; element: string; tools?: preact.ComponentChildren }) {
  const t = texts.value.chart;
  const { chart, element } = props;
  const state = chart.states[element];
  const transition = chart.transitions[element];
  const place = state ?? transition;
  if (!place) return <p class="note warn">{t.unknown(element)}</p>;
  const label = transition?.label ?? "";
  return (
    <div class="detail">
      <h3>
        {state ? shortName(element) : label || element}{" "}
        {state && isActive(element) && <Pill tone="info">{t.active}</Pill>}
      </h3>
      <p class="soft">{element}</p>
      {state?.summary && <p>{state.summary}</p>}
      <div class="row">
        {props.tools}
        {transition?.state && <StateButton name={transition.state} word={t.from} />}
        {transition?.target && <StateButton name={transition.target} word={t.to} />}
      </div>
      <Met element={element} isState={state !== undefined} />
      <Why chart={chart} element={element} />
      <Lines chart={chart} place={place} />
    </div>
  );
}

function StateButton(props: { name: string; word: string }) {
  return (
    <button onClick={() => choose(props.name)}>
      {props.word} {shortName(props.name)}
    </button>
  );
}

function isActive(name: string): boolean {
  return steps.shown.value?.value.view.configuration.includes(name) ?? false;
}

// -- how often ------------------------------------------------------------------------------------------------

function Met(props: { element: string; isState: boolean }) {
  const t = texts.value.chart;
  void Math.floor(shownNow.value / 1000); // looked at once a second, not at each of many steps
  const list = props.isState ? "entered" : "taken";
  const met = steps.past.until(moment.value).filter(({ value }) => value.step[list]?.includes(props.element));
  const last = met.at(-1);
  return (
    <>
      <p>
        {t[list](met.length)} {last && ago((shownNow.value - last.at) / 1000)}
      </p>
      {last && (
        <div class="row" role="group" aria-label={t.moments}>
          {met.slice(-LISTED).reverse().map(({ at }: Known<StepRecord>) => (
            <button class="small" onClick={() => (moment.value = at)}>
              {clockTime(at)}
            </button>
          ))}
        </div>
      )}
    </>
  );
}

// -- what can happen, and why not -----------------------------------------------------------------------------

function Why(props: { chart: ChartRecord; element: string }) {
  const t = texts.value.chart;
  const { told, problem } = useExplanation(props.chart, props.element);
  if (moment.value !== null && mode.value !== "recording") return <p class="soft">{t.onlyNow}</p>;
  if (problem) return <p class="note warn">{problem}</p>;
  if (!told || told.element !== props.element) return <p class="soft">{t.asking}</p>;
  if (!told.rules.length) return <p class="soft">{t.noRules}</p>;
  return (
    <table class="outcomes">
      <caption>{t.can}</caption>
      <tbody>
        {told.rules.map((rule) => (
          <Outcome chart={props.chart} rule={rule} isOwn={rule.state === props.element || rule.id === props.element} />
        ))}
      </tbody>
    </table>
  );
}

function Outcome(props: { chart: ChartRecord; rule: RuleRecord; isOwn: boolean }) {
  const t = texts.value.chart;
  const { rule } = props;
  const known = props.chart.transitions[rule.id];
  return (
    <tr>
      <th scope="row">
        <button class="link" onClick={() => choose(rule.id)}>
          {known?.label || rule.event || t.always}
        </button>
        {known?.target && <span class="soft"> → {shortName(known.target)}</span>}
        {known?.refuse && <span class="soft"> {t.refuses(known.refuse)}</span>}
        {!props.isOwn && rule.state && <span class="soft"> {t.of(shortName(rule.state))}</span>}
      </th>
      <td>
        {rule.possible ? <Pill tone="good">{t.possible}</Pill> : <Pill tone="warn">{t.impossible}</Pill>} {rule.reason}
      </td>
    </tr>
  );
}

/** What the engine says of an element now, or at the moment of a recording; asked anew, but not after each of many steps. */
function useExplanation(chart: ChartRecord, element: string): { told?: ExplanationRecord; problem?: string } {
  const [answer, setAnswer] = useState<{ told?: ExplanationRecord; problem?: string }>({});
  useEffect(() => {
    let timer = 0;
    let ended = false;
    let askedFor: unknown;
    const asksFor = (): unknown => (mode.peek() === "recording" ? shownNow.peek() : steps.past.at(null)?.at);
    const ask = async (): Promise<void> => {
      timer = 0;
      askedFor = asksFor();
      let found: { told?: ExplanationRecord; problem?: string };
      try {
        const sent = { chart: chart.hash, element, ...(mode.peek() === "recording" && { moment: shownNow.peek() }) };
        const response = await link.call<ExplainResponse>("/mission_orchestrator/explain", sent);
        found = response.success ? { told: JSON.parse(response.explanation) as ExplanationRecord } : { problem: response.message };
      } catch (problem) {
        found = { problem: problem instanceof Error ? problem.message : String(problem) };
      }
      if (!ended) setAnswer(found);
    };
    const look = (): void => {
      const canAsk = moment.value === null || mode.value === "recording";
      if (canAsk && asksFor() !== askedFor) timer ||= window.setTimeout(ask, ASK_EVERY_MS);
    };
    const stops = [steps.shown.subscribe(look), moment.subscribe(look), mode.subscribe(look), link.state.subscribe((now) => now === "open" && void ask())];
    return () => {
      ended = true;
      clearTimeout(timer);
      for (const stop of stops) stop();
    };
  }, [chart.hash, element]);
  return answer;
}

// -- the lines ------------------------------------------------------------------------------------------------

function Lines(props: { chart: ChartRecord; place: StateRecord | TransitionRecord }) {
  const t = texts.value.chart;
  const { file, line } = props.place;
  const text = props.chart.files[file];
  if (text === undefined) return <p class="soft">{t.noFile(file)}</p>;
  return (
    <details class="yaml" open>
      <summary>
        {file}:{line}
      </summary>
      <pre tabIndex={0} aria-label={`${file}:${line}`}>
        {block(text.split("\n"), line).map(([number, content]) => (
          <code class="yaml-line">
            <span class="soft">{String(number).padStart(4)} </span>
            {content}
            {"\n"}
          </code>
        ))}
      </pre>
    </details>
  );
}

/** What a transition begins with that is written below its event. */
const PART = /^(target|guard|do|refuse|code|during|releases|detail|internal)\b/;

/** The lines of what begins in a line, by their indentation, each with its number; comments right above as well. */
export function block(lines: readonly string[], line: number): [number, string][] {
  const indent = (text: string): number => text.length - text.trimStart().length;
  let first = Math.min(Math.max(line, 1), lines.length) - 1;
  if (first > 0 && PART.test(lines[first]!.trim()) && indent(lines[first - 1]!) < indent(lines[first]!)) first--;
  const depth = indent(lines[first] ?? "");
  let begin = first;
  while (begin > 0 && lines[begin - 1]!.trimStart().startsWith("#")) begin--;
  let end = first + 1;
  while (end < lines.length && (!lines[end]!.trim() || indent(lines[end]!) > depth)) end++;
  while (end > first + 1 && !lines[end - 1]!.trim()) end--;
  return lines.slice(begin, Math.min(end, begin + LINES)).map((text, offset) => [begin + offset + 1, text]);
}
