// The clock of the orchestrator's loop, by which deadlines and the start of a mission are told.
//
// A record of a step has it beside the robot's clock. How fast it goes is seen from two records: in simulated time it
// may be faster, slower, or stand still.
import { computed } from "@preact/signals";
import { missionNow } from "../mission/permission";
import { steps } from "../mission/mission";

/** Milliseconds of the robot's clock that two records must be apart to say how fast the loop's clock goes. */
const APART_MS = 1000;

const rate = computed(() => {
  const newest = steps.shown.value;
  if (!newest) return 1;
  const earlier = steps.past.at(newest.at - APART_MS);
  if (!earlier || earlier.value.boot !== newest.value.boot) return 1;
  return ((newest.value.time - earlier.value.time) * 1000) / (newest.at - earlier.at);
});

/** What the loop's clock shows at the moment that is shown, in seconds; undefined before the first step. */
export const loopNow = computed(() => {
  const newest = steps.shown.value;
  if (!newest) return undefined;
  return newest.value.time + Math.max(0, (missionNow.value - newest.at) / 1000) * rate.value;
});

/** The seconds that are left until a deadline, or on a clock that a hold has stopped; null where there is none. */
export function secondsLeft({ deadline, left }: { deadline: number | null; left: number | null }): number | null {
  if (deadline === null) return left;
  return loopNow.value === undefined ? null : Math.max(0, deadline - loopNow.value);
}
