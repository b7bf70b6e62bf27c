// Driving to a place of the map: when it may be, where to, and the order itself.
import { computed, signal } from "@preact/signals";
import { robotNow } from "../../model/time/clock";
import { MAP_FRAME, robot } from "../../model/robot/map";
import { possible, state } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { hindrance, silent } from "../../model/mission/permission";
import { ownPage } from "../../model/people";
import { base } from "../../model/story/log";
import type { FloorPlace } from "../../model/robot/twin";
import { ACTION_TYPES, GoalStatus, type NavigateToPoseGoal, type NavigateToPoseResult } from "../../ros";
import { link, type GoalEnd, type SentGoal } from "../../wire/link";

const DRIVE = "/navigate_to_pose";
const TAKE_BASE = "/lupin/hmi/take_base";

/** Whether the next press on the map chooses a place to drive to. */
export const choosing = signal(false);
/** The place that is chosen and waits for a confirmation, with the heading. */
export const aim = signal<FloorPlace | undefined>(undefined);
/** What came of the last order. */
export const driven = signal("");
/** Whether this page ends what it drives, and gives the base back then. */
const giving = signal(false);
/** How long that end is waited for, in milliseconds. */
const ENDS_WITHIN_MS = 10_000;

type Drive = SentGoal<NavigateToPoseResult>;
/** What this page drives: a new drive takes the place of the one before, which ends soon after. */
const underWay = new Set<Drive>();
/** The drive that was sent last. */
let latest: Drive | undefined;

/** Who has the base of a mission that is held: this page, another one, or none; undefined: no mission is held. */
const taken = computed<string | undefined>(() => {
  const now = base.past.at(null)?.value;
  return now?.hindrance === "held" ? (now.taken_by ?? "") : undefined;
});
/** Whether this page has taken the base. */
export const isTaken = computed(() => !!taken.value && taken.value === ownPage.value);
/** Whether this page may take the base now. */
export const mayTake = computed(() => taken.value === "" && !hindrance.value);

/** Why nobody may drive by the map now, in words; "" when it is allowed. A mission drives by itself: none may run. */
export const driveRefusal = computed<string>(() => {
  const t = texts.value.map.drive;
  if (hindrance.value) return hindrance.value;
  if (!robot.shown.value) return t.lost;
  if (silent.value) return t.unknown;
  if (state.shown.value?.value.estop_engaged) return t.stopped;
  if (giving.value) return t.giving;
  if (isTaken.value) return "";
  if (taken.value !== undefined) return taken.value ? t.others(taken.value) : t.held;
  const starts = possible.shown.value?.value.requests.filter(({ request }) => request === "mission.start") ?? [];
  if (starts.length === 0) return t.unknown;
  return starts.some((each) => each.possible) ? "" : t.mission(starts[0]!.reason);
});

export function endChoosing(): void {
  choosing.value = false;
  aim.value = undefined;
}

/** Aim at a place; without a heading the robot keeps its own. */
export function aimAt(x: number, y: number, yaw = robot.shown.value?.value.yaw ?? 0): void {
  aim.value = { x, y, yaw };
}

/** Send the robot to the place that is chosen, if that is still allowed. */
export function drive(): void {
  const to = aim.value;
  const refusal = driveRefusal.value;
  if (!to) return;
  if (refusal) {
    driven.value = refusal;
    return;
  }
  void follow(to, link.sendGoal<NavigateToPoseResult>(DRIVE, ACTION_TYPES.NavigateToPose, goalOf(to)));
  endChoosing();
}

function goalOf({ x, y, yaw }: FloorPlace): NavigateToPoseGoal {
  const at = robotNow();
  return {
    pose: {
      header: { stamp: { sec: Math.floor(at / 1000), nanosec: Math.floor(at % 1000) * 1_000_000 }, frame_id: MAP_FRAME },
      pose: { position: { x, y, z: 0 }, orientation: { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) } },
    },
  };
}

/** Report how a drive ends, unless another one was sent after it. */
async function follow(to: FloorPlace, drive: Drive | undefined): Promise<void> {
  const t = texts.value.map.drive;
  driven.value = drive ? t.sent(to.x, to.y) : t.failed;
  if (!drive) return;
  latest = drive;
  underWay.add(drive);
  const outcome = await drive.end.then((end) => endOf(to, end), ({ message }: Error) => message);
  underWay.delete(drive);
  if (latest === drive) driven.value = outcome;
}

/** How a drive ended, in words. */
function endOf(to: FloorPlace, { status, result }: GoalEnd<NavigateToPoseResult>): string {
  const t = texts.value.map.drive;
  if (status === GoalStatus.STATUS_SUCCEEDED) return t.arrived(to.x, to.y);
  return status === GoalStatus.STATUS_CANCELED ? t.ended : t.gaveUp(result.error_msg);
}

/** End what this page drives; returns whether it has ended in time. */
async function endDrives(): Promise<boolean> {
  for (const drive of underWay) drive.cancel();
  const ends = Promise.allSettled([...underWay].map(({ end }) => end)).then(() => true);
  const late = new Promise<boolean>((done) => setTimeout(() => done(false), ENDS_WITHIN_MS));
  return Promise.race([ends, late]);
}

/** Give the base of the mission back, once what this page drives has ended. */
export async function giveBack(): Promise<void> {
  if (giving.value) return;
  endChoosing();
  giving.value = true;
  const hasEnded = await endDrives();
  giving.value = false;
  if (hasEnded) await takeBase(false);
  else driven.value = texts.value.map.drive.goesOn;
}

/** Take the base of the mission that is held, or give it back. */
export async function takeBase(take: boolean): Promise<void> {
  const call = link.call<{ success: boolean; message: string }>(TAKE_BASE, { take });
  const { success, message } = await call.catch(({ message }: Error) => ({ success: false, message }));
  driven.value = success ? "" : message;
}
