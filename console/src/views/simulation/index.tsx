// What can be done to a simulation: every failure that is declared, silence and lateness, what the robot senses, crashes.
import { useState } from "preact/hooks";
import { texts } from "../../model/page";
import { said, simulate, simulated } from "../../model/mission/simulation";
import { number } from "../../parts/format";
import { Panel, Pill } from "../../parts/panel";
import "./simulation.css";
import type { InputRecord, OperationRecord } from "../../records";

export function SimulationView() {
  const t = texts.value.simulation;
  const now = simulated.value;
  if (!now) return null;
  return (
    <>
      <Panel title={t.faults} tools={<span class="soft">{now.next === null ? t.nothingNext : t.next(number(now.next))}</span>}>
        {now.operations.length === 0 && <p class="soft">{t.noOperations}</p>}
        {now.operations.map((each) => (
          <Operation key={each.operation} {...each} />
        ))}
        {now.silent.length > 0 && (
          <div class="row">
            <h3>{t.silent}</h3>
            {now.silent.map((name) => (
              <button key={name} onClick={() => void simulate("answer", name)}>
                {t.answer(name)}
              </button>
            ))}
          </div>
        )}
        {said.value?.success === false && (
          <p class="note bad" role="alert">
            {said.value.text}
          </p>
        )}
      </Panel>
      <Panel title={t.inputs} class="simulated-inputs">
        <table>
          <thead>
            <tr>
              <th scope="col">{t.input}</th>
              <th scope="col">{t.now}</th>
              <th scope="col">{t.change}</th>
            </tr>
          </thead>
          <tbody>
            {now.values.map((each) => (
              <Input key={each.name} {...each} />
            ))}
          </tbody>
        </table>
      </Panel>
      {now.events.length > 0 && (
        <Panel title={t.events}>
          {now.events.map(({ name, fields }) => (
            <PluginEvent key={name} name={name} fields={fields} />
          ))}
        </Panel>
      )}
      <Panel title={t.orchestrator}>
        <div class="row">
          <button onClick={() => void simulate("crash")}>{t.crash}</button>
          <Words command="clock" label={t.clock} placeholder="2026-11-22 22:00" button={t.set} />
        </div>
      </Panel>
    </>
  );
}

function Operation({ operation, codes, result }: OperationRecord) {
  const t = texts.value.simulation;
  const [chosen, setChosen] = useState("");
  const [seconds, setSeconds] = useState("30 s");
  const code = chosen || codes[0]?.code || "";
  const fields = Object.entries(result).map(([name, type]) => `${name}: ${type}`);
  return (
    <fieldset class="simulated-operation">
      <legend>{operation}</legend>
      {codes.length > 0 && (
        <span class="row">
          <label>
            {t.fail}{" "}
            <select value={code} onChange={(event) => setChosen(event.currentTarget.value)}>
              {codes.map((each) => (
                <option value={each.code}>
                  {each.code}: {each.label}
                </option>
              ))}
            </select>
          </label>
          <button onClick={() => void simulate("fail", operation, code)}>{t.failNow}</button>
        </span>
      )}
      <span class="row">
        <button onClick={() => void simulate("done", operation)} title={fields.join(", ")}>
          {t.done}
        </button>
        <button onClick={() => void simulate("silence", operation)}>{t.silence}</button>
        <label>
          {t.late} <input class="short" value={seconds} onInput={(event) => setSeconds(event.currentTarget.value)} />
        </label>
        <button onClick={() => void simulate("late", operation, seconds)}>{t.lateNow}</button>
      </span>
    </fieldset>
  );
}

function Input({ name, type, unit, choices, now }: InputRecord) {
  const t = texts.value.simulation;
  return (
    <tr>
      <th scope="row">
        {name} <span class="soft">{[type, unit].filter(Boolean).join(", ")}</span>
      </th>
      <td>{now === null ? <Pill tone="warn">{t.unknown}</Pill> : <code>{JSON.stringify(now)}</code>}</td>
      <td>
        {choices.length ? (
          <span class="row">
            {choices.map((each) => (
              <button key={each} aria-label={`${name} ${each}`} aria-pressed={String(now) === each} onClick={() => void simulate("set", name, each)}>
                {each}
              </button>
            ))}
          </span>
        ) : (
          <Words command="set" first={name} label={`${t.change}: ${name}`} placeholder={example(now)} button={t.set} />
        )}
      </td>
    </tr>
  );
}

/** How a value is written that could stand where this one does. */
function example(now: unknown): string {
  if (typeof now === "object" && now !== null && "value" in now) return String(now.value);
  return now === null ? "" : JSON.stringify(now);
}

/** A field for words, and a button that sends them. */
function Words(props: { command: string; first?: string; label: string; placeholder: string; button: string; split?: boolean }) {
  const [text, setText] = useState("");
  const words = props.split ? text.split(/\s+/).filter(Boolean) : [text];
  const first = props.first === undefined ? [] : [props.first];
  return (
    <form
      class="row"
      onSubmit={(event) => {
        event.preventDefault();
        void simulate(props.command, ...first, ...words);
      }}
    >
      <input aria-label={props.label} placeholder={props.placeholder} value={text} onInput={(event) => setText(event.currentTarget.value)} />
      <button disabled={!text && !props.split} title={props.label}>
        {props.button}
      </button>
    </form>
  );
}

function PluginEvent({ name, fields }: { name: string; fields: Readonly<Record<string, string>> }) {
  const t = texts.value.simulation;
  const wanted = Object.entries(fields).map(([field, type]) => `${field}=${type.toUpperCase().replaceAll(" ", "_")}`);
  return (
    <div class="row">
      <code>{name}</code>
      {wanted.length ? (
        <Words command="send" first={name} label={`${name}: ${t.fields}`} placeholder={wanted.join(" ")} button={t.send} split />
      ) : (
        <button aria-label={`${t.send} ${name}`} onClick={() => void simulate("send", name)}>
          {t.send}
        </button>
      )}
    </div>
  );
}
