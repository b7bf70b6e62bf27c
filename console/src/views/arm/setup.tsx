// What only engineers do: the servos' power, the zero pose, the calibration.
import { signal } from "@preact/signals";
import { armState, askArm } from "../../model/robot/arm";
import { texts } from "../../model/page";
import { hindrance, hindranceFor } from "../../model/mission/permission";
import { ConfirmButton } from "../../parts/confirm";
import { number } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { Why, whyNot } from "./why";

interface Calibration {
  readonly state: string;
  readonly joint_names: readonly string[];
  readonly offsets_applied: readonly number[];
  readonly diffs_observed: readonly number[];
}

/** What the last answer about the calibration said. */
const calibration = signal<Calibration | undefined>(undefined);

async function calibrate(action: string): Promise<void> {
  const answer = await askArm("calibrate", { action });
  if (answer && "state" in answer) calibration.value = answer as unknown as Calibration;
}

function Offsets({ found }: { found: Calibration }) {
  const t = texts.value.arm;
  if (!found.joint_names.length) return null;
  return (
    <table>
      <thead>
        <tr>
          <th scope="col">{t.servo}</th>
          <th scope="col">{t.off}</th>
          <th scope="col">{t.written}</th>
        </tr>
      </thead>
      <tbody>
        {found.joint_names.map((name, index) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            <td>{number((found.diffs_observed[index] ?? 0) / 100, 2)}°</td>
            <td>{number((found.offsets_applied[index] ?? 0) / 100, 2)}°</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

export function SetupPanel() {
  const t = texts.value.arm;
  const role = whyNot("engineer", false);
  const moving = whyNot("engineer");
  const torque = armState.shown.value?.value.torque;
  return (
    <Panel title={t.setup}>
      <Why text={hindrance.value ? "" : hindranceFor("engineer")} />
      <div class="row">
        <button disabled={!!moving || torque === true} title={moving} onClick={() => void askArm("set_torque", { data: true })}>
          {t.switchOn}
        </button>
        <ConfirmButton why={role || (torque === false ? t.torqueOff : "")} question={t.supportArm} onConfirm={() => void askArm("set_torque", { data: false })}>
          {t.switchOff}
        </ConfirmButton>
        <ConfirmButton why={moving} question={t.zeroQuestion} onConfirm={() => void askArm("init")}>
          {t.zero}
        </ConfirmButton>
      </div>
      <h3>{t.calibration}</h3>
      <p class="soft">{t.calibrationSteps}</p>
      <div class="row">
        <ConfirmButton why={moving} question={t.calibrateQuestion} onConfirm={() => void calibrate("start")}>
          {t.calibrate.start}
        </ConfirmButton>
        <ConfirmButton why={moving} question={t.commitQuestion} onConfirm={() => void calibrate("commit")}>
          {t.calibrate.commit}
        </ConfirmButton>
        {(["cancel", "status"] as const).map((action) => (
          <button key={action} disabled={!!role} title={role} onClick={() => void calibrate(action)}>
            {t.calibrate[action]}
          </button>
        ))}
        {calibration.value && <span class="soft">{calibration.value.state}</span>}
      </div>
      {calibration.value && <Offsets found={calibration.value} />}
    </Panel>
  );
}
