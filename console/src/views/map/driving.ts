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
import { MSG_TYPES, type PoseStamped } from "../../ros";
import { link } from "../../wire/link";

const GOAL = "/goal_pose";
const TAKE_BASE = "/lupin/hmi/take_base";

/** Whether the next press on the map chooses a place to drive to. */
export const choosing = signal(false);
/** The place that is chosen and waits for a confirmation, with the heading. */
export const aim = signal<FloorPlace | undefined>(undefined);
/** What came of the last order. */
export const driven = signal("");

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
  const t = texts.value.map.drive;
  const at = robotNow();
  const order: PoseStamped = {
    header: { stamp: { sec: Math.floor(at / 1000), nanosec: Math.floor(at % 1000) * 1_000_000 }, frame_id: MAP_FRAME },
    pose: {
      position: { x: to.x, y: to.y, z: 0 },
      orientation: { x: 0, y: 0, z: Math.sin(to.yaw / 2), w: Math.cos(to.yaw / 2) },
    },
  };
  driven.value = refusal || (link.publish(GOAL, MSG_TYPES.PoseStamped, order) ? t.sent(to.x, to.y) : t.failed);
  if (!refusal) endChoosing();
}

/** Take the base of the mission that is held, or give it back, which ends what this page drives. */
export async function takeBase(take: boolean): Promise<void> {
  if (!take) endChoosing();
  const call = link.call<{ success: boolean; message: string }>(TAKE_BASE, { take });
  const { success, message } = await call.catch(({ message }: Error) => ({ success: false, message }));
  driven.value = success ? "" : message;
}
