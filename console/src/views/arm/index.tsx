// The arm: where it is, and what moves it.
import { useEffect } from "preact/hooks";
import { ARM_SILENT_S, armAnswer, armBusy, armState, askArm, joints, library, loadLibrary } from "../../model/robot/arm";
import { texts } from "../../model/page";
import { hindrance } from "../../model/mission/permission";
import { isStale, useTopic } from "../../model/topics";
import { link } from "../../wire/link";
import { clockTime } from "../../parts/format";
import { Panel, Pill } from "../../parts/panel";
import "./arm.css";
import { JointSliders } from "./joints";
import { LibraryPanel } from "./library";
import { SetupPanel } from "./setup";
import { Why, whyNot } from "./why";

function State() {
  const t = texts.value.arm;
  const now = armState.shown.value?.value;
  const silent = !joints.shown.value || isStale(joints, ARM_SILENT_S);
  const heard = silent && joints.heardAt.value;
  return (
    <Panel title={t.state} class="arm-state">
      <div class="row" role="status">
        {silent ? <Pill tone="warn">{heard ? t.silentSince(clockTime(heard)) : t.silent}</Pill> : <Pill tone="good">{t.heard}</Pill>}
        {now && <Pill tone={now.torque ? "good" : "warn"}>{now.torque ? t.torqueOn : t.torqueOff}</Pill>}
        {now?.playing && <Pill tone="info">{t.playing(now.name)}</Pill>}
        {now?.recording && <Pill tone="info">{t.recordingNow(now.mode, now.n_waypoints)}</Pill>}
        {now?.unsaved && <Pill tone="warn">{t.unsaved}</Pill>}
        {now?.playing && <progress max={1} value={now.progress} aria-label={t.playing(now.name)} />}
      </div>
      <Why text={hindrance.value || armBusy.value} />
      {now?.notices?.map((notice) => (
        <p key={notice} class="note warn">
          {notice}
        </p>
      ))}
      {armAnswer.value && (
        <p role="status" class={`note ${armAnswer.value.accepted ? "good" : "bad"}`}>
          {armAnswer.value.accepted ? "✓ " : "✖ "}
          {armAnswer.value.text}
        </p>
      )}
    </Panel>
  );
}

function Presets() {
  const t = texts.value.arm;
  const why = whyNot("operator");
  return (
    <Panel title={t.presets}>
      <div class="row">
        {library.value?.presets.map((name) => (
          <button key={name} disabled={!!why} title={why} onClick={() => void askArm("preset", { name })}>
            {name}
          </button>
        ))}
        {library.value === undefined && <span class="soft">{t.noAnswer}</span>}
      </div>
    </Panel>
  );
}

export function ArmView() {
  useTopic(armState);
  useTopic(joints);
  useEffect(() => {
    // The arm's node may come later than this page.
    const look = (): void => void (link.state.peek() === "open" && (library.peek()?.joints.length || loadLibrary()));
    void loadLibrary();
    const timer = setInterval(look, 3000);
    return () => clearInterval(timer);
  }, []);
  return (
    <div class="arm">
      <State />
      <Presets />
      <JointSliders />
      <LibraryPanel />
      <SetupPanel />
    </div>
  );
}
