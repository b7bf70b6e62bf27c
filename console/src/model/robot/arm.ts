// The arm: where it is, what its library says, and its services.
import { computed, signal } from "@preact/signals";
import { MSG_TYPES, type JointState } from "../../ros";
import { CallFailed, link } from "../../wire/link";
import { robotNow } from "../time/clock";
import { stops } from "../story/log";
import { state as mission } from "../mission/mission";
import { texts } from "../page";
import { rosout } from "./rosout";
import { alike, recordTopic, topic } from "../topics";

const ARM = "/lupin/arm";
/** Seconds of silence after which nobody knows where the arm is. */
export const ARM_SILENT_S = 2;
/** Published states in which no mission is under way; a mission's own are never listed. */
const WITHOUT_MISSION = ["", "BOOT", "READY", "DONE", "FAULT"];
/** Degrees a second at which sliders move joints. */
const RATE = 45;

export interface LibraryState {
  readonly recording: boolean;
  readonly playing: boolean;
  readonly name: string;
  readonly mode: string;
  readonly progress: number;
  readonly elapsed_s: number;
  readonly n_waypoints: number;
  readonly torque: boolean;
  readonly unsaved: boolean;
  readonly notices?: readonly string[];
}

export interface ArmJoint {
  readonly name: string;
  readonly state: string;
  /** Degrees. */
  readonly low: number;
  readonly high: number;
}

export interface ArmLibrary {
  readonly poses: readonly { readonly name: string; readonly note: string; readonly has_gripper: boolean }[];
  readonly sequences: readonly { readonly name: string; readonly mode: string; readonly duration_s: number; readonly n_waypoints: number }[];
  readonly presets: readonly string[];
  readonly joints: readonly ArmJoint[];
  readonly jaw?: { readonly state: string; readonly low: number; readonly high: number; readonly state_low: number; readonly state_high: number };
}

export const armState = recordTopic<LibraryState>(`${ARM}/library/state`, {
  keep: 2000,
  throttle: 200,
  same: alike,
});

/** Angles in radians by the names of joints. */
export const joints = topic<JointState, Readonly<Record<string, number>>>("/joint_states", MSG_TYPES.JointState, {
  keep: 3000,
  throttle: 200,
  read: ({ name, position }) =>
    Object.fromEntries(name.flatMap((each, index) => (position[index] == null ? [] : [[each, position[index]]]))),
  same: alike,
});

/** What the library has; undefined until the arm has answered. */
export const library = signal<ArmLibrary | undefined>(undefined);
/** What the arm answered last. */
export const armAnswer = signal<{ readonly accepted: boolean; readonly text: string } | undefined>(undefined);
/** What is being asked; one thing at a time. */
export const armAsked = signal("");

/** Why the arm is not to be moved now, beside what the page itself may; empty: it may be. */
export const armBusy = computed(() => {
  const t = texts.value.arm;
  const now = mission.shown.value?.value;
  if (stops.shown.value?.value.stopped || now?.estop_engaged) return t.stopped;
  return WITHOUT_MISSION.includes(now?.lifecycle_state ?? "") ? "" : t.missionRuns(now!.lifecycle_state);
});

export async function loadLibrary(): Promise<void> {
  try {
    const { json: text } = await link.call<{ json: string }>(`${ARM}/library/list`);
    library.value = { presets: [], joints: [], ...(JSON.parse(text) as Partial<ArmLibrary>) } as ArmLibrary;
  } catch (problem) {
    armAnswer.value = { accepted: false, text: problem instanceof Error ? problem.message : String(problem) };
  }
}

interface ArmResponse {
  readonly success?: boolean;
  readonly status?: boolean;
  readonly message?: string;
  readonly [more: string]: unknown;
}

/** Ask the arm for something; its answer is shown in its words. Never fails. */
export async function askArm(what: string, args: object = {}, seconds = 14): Promise<ArmResponse | undefined> {
  armAsked.value = what;
  const began = robotNow();
  let answer: ArmResponse | undefined;
  try {
    answer = await link.call<ArmResponse>(what.startsWith("/") ? what : `${ARM}/${what}`, args, seconds);
    const accepted = answer.success ?? answer.status ?? false;
    armAnswer.value = { accepted, text: answer.message ?? (accepted ? texts.value.arm.sent : reasonSince(began)) };
  } catch (problem) {
    if (!(problem instanceof CallFailed)) throw problem;
    armAnswer.value = { accepted: false, text: problem.message };
  }
  armAsked.value = "";
  if (what.startsWith("library/")) await loadLibrary();
  return answer;
}

/** A slider can only be answered yes or no; why not is in the log of the arm. */
function reasonSince(began: number): string {
  const told = rosout.past.between(began - 500, Infinity).filter(({ value }) => value.node.includes("lupin_arm"));
  return told.at(-1)?.value.text ?? texts.value.arm.refused;
}

export function moveJoint(name: string, angle: number): Promise<ArmResponse | undefined> {
  const service = name === "gripper" ? "/lupin/gripper/set_angle_with_speed" : `${name}/set_angle_with_speed`;
  return askArm(service, { angle, rate: RATE, degrees: true });
}
