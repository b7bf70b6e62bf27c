// Poses and sequences that people have made: play, save, record, rename, delete.
import { signal } from "@preact/signals";
import { armState, askArm, library } from "../../model/robot/arm";
import { texts } from "../../model/page";
import { ConfirmButton } from "../../parts/confirm";
import { span } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { whyNot } from "./why";

type Kind = "pose" | "sequence";

const newName = signal("");
const overwrite = signal(false);
const speed = signal(1);
const SPEEDS = [0.25, 0.5, 1, 1.5, 2];

function Rename({ kind, name, why }: { kind: Kind; name: string; why: string }) {
  const t = texts.value.arm;
  const to = newName.value.trim();
  const reason = why || (to ? "" : t.needsName);
  return (
    <button
      disabled={!!reason}
      title={reason}
      aria-label={t.renameNamed(name)}
      onClick={() => void askArm("library/delete", { kind, name, new_name: to })}
    >
      {t.rename}
    </button>
  );
}

function Entry(props: { kind: Kind; name: string; about: string; onPlay: () => void; play: string }) {
  const t = texts.value.arm;
  const { kind, name } = props;
  const [moving, editing] = [whyNot("operator"), whyNot("engineer", false)];
  return (
    <tr>
      <th scope="row">{name}</th>
      <td class="soft">{props.about}</td>
      <td>
        <div class="row">
          <button disabled={!!moving} title={moving} aria-label={`${props.play} ${name}`} onClick={props.onPlay}>
            {props.play}
          </button>
          <Rename kind={kind} name={name} why={editing} />
          <ConfirmButton
            why={editing}
            label={t.deleteNamed(name)}
            question={t.deleteQuestion(name)}
            onConfirm={() => void askArm("library/delete", { kind, name, new_name: "" })}
          >
            {t.delete}
          </ConfirmButton>
        </div>
      </td>
    </tr>
  );
}

function Save() {
  const t = texts.value.arm;
  const now = armState.shown.value?.value;
  const name = newName.value.trim();
  const busy = whyNot("engineer");
  const saving = busy || (name ? "" : t.needsName);
  const record = (action: string, mode = ""): void =>
    void askArm("library/record", { action, name, mode, include_gripper: true, overwrite: overwrite.value });
  return (
    <div class="row save">
      <label>
        {t.name}{" "}
        <input value={newName.value} maxLength={32} onInput={(event) => (newName.value = event.currentTarget.value)} />
      </label>
      <label>
        <input type="checkbox" checked={overwrite.value} onChange={(event) => (overwrite.value = event.currentTarget.checked)} /> {t.overwrite}
      </label>
      <button
        disabled={!!saving}
        title={saving}
        onClick={() => void askArm("library/save_pose", { name, from_current: true, overwrite: overwrite.value })}
      >
        {t.savePose}
      </button>
      {now?.recording || now?.unsaved ? (
        <>
          <button class="main" disabled={!!saving} title={saving} onClick={() => record("save")}>
            {t.saveRecording}
          </button>
          <ConfirmButton question={t.discardQuestion} why={whyNot("engineer", false)} onConfirm={() => record("cancel")}>
            {t.discard}
          </ConfirmButton>
        </>
      ) : (
        <>
          <button disabled={!!busy} title={busy} onClick={() => record("start", "teleop")}>
            {t.recordSteered}
          </button>
          <ConfirmButton why={busy} question={t.supportArm} onConfirm={() => record("start", "kinesthetic")}>
            {t.recordByHand}
          </ConfirmButton>
        </>
      )}
    </div>
  );
}

export function LibraryPanel() {
  const t = texts.value.arm;
  const found = library.value;
  // Stopping is always possible for who may move the arm, also while a mission runs.
  const stopping = whyNot("operator", false);
  const playing = armState.shown.value?.value.playing ?? false;
  const tools = (
    <div class="row">
      <label>
        {t.speed}{" "}
        <select value={speed.value} onChange={(event) => (speed.value = Number(event.currentTarget.value))}>
          {SPEEDS.map((each) => (
            <option value={each}>{each} ×</option>
          ))}
        </select>
      </label>
      <button disabled={!!stopping || !playing} title={stopping || (playing ? "" : t.nothingPlays)} onClick={() => void askArm("library/stop")}>
        {t.stopPlaying}
      </button>
    </div>
  );
  return (
    <Panel title={t.library} tools={tools}>
      {found && found.poses.length + found.sequences.length === 0 && <p class="soft">{t.empty}</p>}
      <table>
        <tbody>
          {found?.poses.map(({ name, note, has_gripper }) => (
            <Entry
              key={`pose ${name}`}
              kind="pose"
              name={name}
              about={[t.pose, has_gripper ? t.withJaw : "", note].filter(Boolean).join(" · ")}
              play={t.goTo}
              onPlay={() => void askArm("library/goto_pose", { name })}
            />
          ))}
          {found?.sequences.map(({ name, mode, duration_s, n_waypoints }) => (
            <Entry
              key={`sequence ${name}`}
              kind="sequence"
              name={name}
              about={[t.sequence, t.modes[mode as keyof typeof t.modes] ?? mode, span(duration_s), t.points(n_waypoints)].join(" · ")}
              play={t.play}
              onPlay={() => void askArm("library/play", { name, speed: speed.value })}
            />
          ))}
        </tbody>
      </table>
      <Save />
    </Panel>
  );
}
