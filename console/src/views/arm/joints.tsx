// A slider for each joint: where it is, where it was sent, and how far it may go.
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { ARM_SILENT_S, joints, library, moveJoint } from "../../model/robot/arm";
import { texts } from "../../model/page";
import { isStale } from "../../model/topics";
import { number } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { whyNot } from "./why";

interface Slider {
  readonly name: string;
  /** Degrees. */
  readonly low: number;
  readonly high: number;
  readonly measured: number | undefined;
}

/** Degrees: a joint that is that near has arrived. */
const ARRIVED = 1.5;
/** Where joints were sent by this page, in degrees, until they are there. */
const sent = signal<Readonly<Record<string, number>>>({});

function send(name: string, angle: number | undefined): void {
  const { [name]: _, ...others } = sent.value;
  sent.value = angle === undefined ? others : { ...others, [name]: angle };
}

async function move(name: string, angle: number): Promise<void> {
  send(name, angle);
  const answer = await moveJoint(name, angle);
  if (!answer?.status) send(name, undefined);
}

function JointSlider({ name, low, high, measured, why }: Slider & { why: string }) {
  const t = texts.value.arm;
  const target = sent.value[name];
  const arrived = target !== undefined && measured !== undefined && Math.abs(measured - target) < ARRIVED;
  useEffect(() => {
    if (arrived) send(name, undefined);
  }, [arrived]);
  const label = t.joints[name as keyof typeof t.joints] ?? name;
  return (
    <div class="joint">
      <label for={`joint-${name}`}>{label}</label>
      <input
        id={`joint-${name}`}
        type="range"
        min={low}
        max={high}
        step={1}
        disabled={!!why}
        title={why}
        value={target ?? measured ?? 0}
        aria-valuetext={measured === undefined ? t.unknown : `${number(measured)}°`}
        onChange={(event) => void move(name, Number(event.currentTarget.value))}
      />
      <output for={`joint-${name}`}>
        {number(measured)}° {target !== undefined && <span class="info">→ {number(target, 0)}°</span>}
      </output>
      <span class="soft limits">
        {number(low, 0)}° … {number(high, 0)}°
      </span>
    </div>
  );
}

export function JointSliders() {
  const t = texts.value.arm;
  const known = library.value;
  const now = joints.shown.value?.value;
  const why = whyNot("operator") || (!now || isStale(joints, ARM_SILENT_S) ? t.silent : "");
  const degrees = (radians: number | undefined): number | undefined => (radians === undefined ? undefined : (radians * 180) / Math.PI);
  const jaw = known?.jaw;
  const atJaw = jaw && now?.[jaw.state];
  const share = jaw && atJaw !== undefined ? (atJaw - jaw.state_low) / (jaw.state_high - jaw.state_low) : undefined;
  return (
    <Panel title={t.jointsTitle}>
      {known?.joints.map(({ name, state, low, high }) => (
        <JointSlider key={name} name={name} low={low} high={high} measured={degrees(now?.[state])} why={why} />
      ))}
      {jaw && (
        <>
          <JointSlider
            name="gripper"
            low={jaw.low}
            high={jaw.high}
            measured={share === undefined ? undefined : jaw.low + share * (jaw.high - jaw.low)}
            why={why}
          />
          <div class="row">
            <button disabled={!!why} title={why} onClick={() => void move("gripper", jaw.low)}>
              {t.open}
            </button>
            <button disabled={!!why} title={why} onClick={() => void move("gripper", jaw.high)}>
              {t.close}
            </button>
          </div>
        </>
      )}
    </Panel>
  );
}
