// The missions that can be started, each with a form that its request's declaration makes.
import { signal } from "@preact/signals";
import { useId } from "preact/hooks";
import { missions, possible } from "../../model/mission/mission";
import { open, texts } from "../../model/page";
import { verbText } from "../../model/mission/permission";
import { endPicking, picked, picking, startPicking, toggle } from "../../model/mission/picking";
import { draftOf, elements, fill, formOf, isList, meaningOf, requestOf, written } from "../../model/mission/requestForm";
import { number } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { RequestButton } from "./button";
import type { FieldRecord, OfferedMission } from "../../records";

/** So many elements of a default are shown. */
const SHOWN_ELEMENTS = 6;

/** The missions that somebody tried to start with mistakes: what is missing is told from then on. */
const tried = signal<ReadonlySet<string>>(new Set());

export function Starts() {
  const t = texts.value.control;
  const offer = missions.shown.value?.value;
  if (!offer) return null;
  return (
    <Panel title={t.missions}>
      {offer.problems.length > 0 && (
        <div class="note bad">
          <p>{t.problems}</p>
          {offer.problems.map((problem) => (
            <pre key={problem}>{problem}</pre>
          ))}
        </div>
      )}
      {offer.missions.map((mission) => (
        <Start key={mission.mission} mission={mission} />
      ))}
    </Panel>
  );
}

function Start({ mission }: { mission: OfferedMission }) {
  const t = texts.value.control;
  const { request, problems } = requestOf(mission, t.wrong);
  const form = useId();
  const check = (): boolean => {
    const [first] = Object.keys(problems);
    if (first === undefined) return true;
    tried.value = new Set([...tried.value, mission.mission]);
    document.getElementById(`${form}-${first}`)?.focus();
    return false;
  };
  const told = possible.shown.value?.value.requests;
  const needed = mission.request.some(({ required }) => required);
  const touched = mission.request.some(({ name }) => draftOf(mission.mission)[name]);
  return (
    <form
      class="control-mission"
      aria-label={mission.mission}
      onSubmit={(event) => event.preventDefault()}
    >
      <h3>{mission.mission}</h3>
      <p class="soft">{mission.summary}</p>
      {mission.request.length > 0 && (
        <details open={needed || touched || picking.value?.mission === mission.mission}>
          <summary>{t.options}</summary>
          {mission.request.map((field) => (
            <Field key={field.name} id={`${form}-${field.name}`} mission={mission.mission} field={field} />
          ))}
        </details>
      )}
      <RequestButton
        main
        label={`${verbText("start")} ${mission.file || mission.mission}`}
        verb="start"
        mission={mission.mission}
        request={request}
        check={check}
        possible={told?.find((each) => each.verb === "start" && each.mission === mission.mission)}
      />
    </form>
  );
}

function Field({ id, mission, field }: { id: string; mission: string; field: FieldRecord }) {
  const t = texts.value.control;
  const text = draftOf(mission)[field.name] ?? "";
  const meaning = text || tried.value.has(mission) ? meaningOf(field, text, t.wrong) : undefined;
  const problem = meaning && "problem" in meaning ? meaning.problem : "";
  const props = {
    id,
    value: text,
    "aria-invalid": !!problem,
    "aria-required": field.required,
    "aria-describedby": `${id}-about ${id}-wrong`,
  };
  return (
    <div class="control-field">
      <label for={id}>
        {field.name} {field.unit && <span class="soft">[{field.unit}]</span>} {field.required && <b>{t.required}</b>}
      </label>
      <div class="row">
        <Input props={props} field={field} set={(to) => fill(mission, field.name, to)} />
        <Picker mission={mission} field={field} text={text} />
      </div>
      <Names mission={mission} field={field} />
      <p id={`${id}-about`} class="soft">
        {about(field)}
      </p>
      <p id={`${id}-wrong`} class="bad" role="status">
        {problem}
      </p>
    </div>
  );
}

function Input({ props, field, set }: { props: { id: string; value: string }; field: FieldRecord; set: (to: string) => void }) {
  const t = texts.value.control;
  const choices = field.allowed ?? (field.kind === "bool" ? ["true", "false"] : undefined);
  if (!choices || isList(field))
    return (
      <input
        {...props}
        autocomplete="off"
        inputMode={field.kind === "integer" && !isList(field) ? "numeric" : undefined}
        placeholder={field.required ? "" : defaultText(field)}
        onInput={(event) => set(event.currentTarget.value)}
      />
    );
  const label: Record<string, string> = field.kind === "bool" ? { true: t.yes, false: t.no } : {};
  return (
    <select {...props} onChange={(event) => set(event.currentTarget.value)}>
      <option value="">{field.required ? "" : t.default(label[defaultText(field)] ?? defaultText(field))}</option>
      {choices.map((each) => (
        <option key={each} value={each}>
          {label[each] ?? each}
        </option>
      ))}
    </select>
  );
}

/** Things that have a name, such as tags, can be picked where they are shown. */
function Picker({ mission, field, text }: { mission: string; field: FieldRecord; text: string }) {
  const t = texts.value.control;
  if (field.kind !== "name") return null;
  const picks = picking.value?.mission === mission && picking.value.field === field.name;
  const begin = (): void => {
    startPicking({ mission, field: field.name }, elements(text));
    open("map");
  };
  return (
    <>
      <button type="button" aria-pressed={picks} onClick={picks ? endPicking : begin}>
        {picks ? `${t.picked} (${number(picked.value.length)})` : t.pick}
      </button>
      {text && (
        <button type="button" onClick={() => fill(mission, field.name, "")}>
          {t.clear}
        </button>
      )}
    </>
  );
}

/** While something is picked: the names that the mission would take by itself, in or out by a press. */
function Names({ mission, field }: { mission: string; field: FieldRecord }) {
  const at = picking.value;
  if (at?.mission !== mission || at.field !== field.name || !Array.isArray(field.default)) return null;
  return (
    <div class="row" role="group" aria-label={field.name}>
      {[...new Set([...field.default.map(written), ...picked.value])].map((name) => (
        <button key={name} type="button" class="control-name" aria-pressed={picked.value.includes(name)} onClick={() => toggle(name)}>
          {name}
        </button>
      ))}
    </div>
  );
}

/** What can be said of a field before anything is filled in. */
function about(field: FieldRecord): string {
  const t = texts.value.control;
  const { minimum: low, maximum: high } = field;
  const range =
    low !== undefined && high !== undefined
      ? t.range(`${low}`, `${high}`)
      : low !== undefined
        ? t.atLeast(`${low}`)
        : high !== undefined
          ? t.atMost(`${high}`)
          : "";
  const list = field.fields ? formOf(field) : isList(field) ? t.separated : "";
  const standard = field.required ? "" : t.default(defaultText(field));
  return [field.summary, field.type, range, list, field.example, standard].filter(Boolean).join(" · ");
}

function defaultText(field: FieldRecord): string {
  const t = texts.value.control;
  if (field.default === undefined || field.default === null) return t.defaultNow;
  if (field.fields) return JSON.stringify(field.default);
  if (!Array.isArray(field.default)) return written(field.default);
  const shown = field.default.slice(0, SHOWN_ELEMENTS).map(written).join(", ");
  const rest = field.default.length - SHOWN_ELEMENTS;
  return rest > 0 ? `${shown} ${t.more(number(rest))}` : shown;
}
