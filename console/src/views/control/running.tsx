// Running now: each operation with its target, try, deadline and what it waits for; what is being cancelled.
import { secondsLeft } from "../../model/time/countdown";
import { view } from "../../model/mission/mission";
import { open, texts } from "../../model/page";
import { span } from "../../parts/format";
import { Panel, Pill } from "../../parts/panel";
import type { Attempting } from "../../records";

export function RunningNow() {
  const t = texts.value.control;
  const now = view.value;
  const attempts = now?.attempts ?? [];
  const cancelling = now?.cancelling ?? [];
  const others = cancelling.filter((operation) => !attempts.some((each) => each.operation === operation && each.phase === "cancelling"));
  return (
    <Panel title={t.running} class="control-running">
      {!attempts.length && !others.length && <p class="soft">{t.none}</p>}
      <ul>
        {attempts.map((attempt) => (
          <Operation key={`${attempt.state} ${attempt.operation}`} attempt={attempt} target={now?.target ?? ""} />
        ))}
        {others.map((operation) => (
          <li key={operation}>
            {operation} <Pill tone="warn">{t.cancelling}</Pill>
          </li>
        ))}
      </ul>
    </Panel>
  );
}

function Operation({ attempt, target }: { attempt: Attempting; target: string }) {
  const t = texts.value.control;
  const where = `chart/${attempt.state}`;
  return (
    <li>
      <a href={`#${where}`} onClick={() => open(where)} title={t.inState(attempt.state)}>
        {attempt.operation}
      </a>{" "}
      <span class="soft">
        {target && t.target(target)} {t.tryNumber(String(attempt.tries))}
      </span>{" "}
      {attempt.phase === "cancelling" && <Pill tone="warn">{t.cancelling}</Pill>}
      <Deadline attempt={attempt} />
      {attempt.detail && <p>{attempt.detail}</p>}
    </li>
  );
}

function Deadline({ attempt }: { attempt: Attempting }) {
  const t = texts.value.control;
  const left = secondsLeft(attempt);
  if (left === null) return <p class="soft">{t.noDeadline}</p>;
  const text = attempt.deadline === null ? t.leftHeld(span(left)) : t.left(span(left));
  return (
    <p class="row soft">
      {attempt.limit !== null && <meter min={0} max={attempt.limit} value={left} aria-label={text} />}
      {text}
    </p>
  );
}
