// What a mission asks: its choices, and the time until the default counts.
import { secondsLeft } from "../../model/time/countdown";
import { possible, view } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { span } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { RequestButton } from "./button";
import type { Question } from "../../records";

export function Questions() {
  const t = texts.value.control;
  const asked = view.value?.asking ?? [];
  if (!asked.length) return null;
  return (
    <Panel title={t.asks} class="control-asks">
      {asked.map((question) => (
        <Asked key={question.state} question={question} />
      ))}
    </Panel>
  );
}

function Asked({ question }: { question: Question }) {
  const t = texts.value.control;
  const left = secondsLeft(question);
  const standard = question.choices.find(({ name }) => name === question.default)?.label ?? question.default;
  const time = left === null ? "–" : span(left);
  return (
    <div role="group" aria-label={question.question}>
      <p role="alert" class="control-question">
        {question.question}
      </p>
      {question.choices.map(({ name, label }) => (
        <RequestButton
          key={name}
          label={label}
          verb="answer"
          request={{ choice: name }}
          possible={possible.shown.value?.value.requests.find((each) => each.request === `answer.${name}`)}
        />
      ))}
      <p class="soft">{question.deadline === null ? t.defaultHeld(standard, time) : t.byDefault(standard, time)}</p>
    </div>
  );
}
