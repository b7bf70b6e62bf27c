// What an orchestrator and a gateway tell, as they send it, with what a test does not care about filled in.
import type { MissionState } from "../src/ros";
import type { Attempting, BaseRecord, PossibleRecord, Step, StepRecord, StopsRecord, View } from "../src/records";
import { state, steps } from "../src/model/mission/mission";
import type { Topic } from "../src/model/topics";

/** A moment, in milliseconds since 1970 by the robot's clock, from which the tests count. */
export const T0 = Date.UTC(2026, 0, 1, 12);

export function viewOf(given: Partial<View> = {}): View {
  const lists = { configuration: [], asking: [], held: [], attempts: [], cancelling: [], countdowns: [] };
  const texts = { lifecycle: "MISSION", phase: "", mission: "Round", mission_id: "m-1", target: "", code: "", detail: "" };
  return { ...lists, ...texts, started_at: null, total: 0, codes: 0, holds: {}, paused: false, dropped: 0, ...given };
}

export function attemptOf(given: Partial<Attempting> = {}): Attempting {
  const texts = { state: "MISSION.GO", operation: "nav.go_to", phase: "running", detail: "" };
  return { ...texts, tries: 1, deadline: null, limit: null, left: null, ...given };
}

/** A record of a step, so many seconds after `T0`; the clock of the loop shows the same seconds. */
export function recordOf(seconds: number, step: Partial<Step> = {}, view: Partial<View> = {}, more: Partial<StepRecord> = {}): StepRecord {
  return {
    time: seconds,
    stamp: seconds,
    wall_ns: (T0 + seconds * 1000) * 1e6,
    boot: "one",
    chart: "c",
    step: { sequence: seconds + 1, time: seconds, event: "something", configuration: [], ...step },
    view: viewOf(view),
    ...more,
  };
}

/** The stops of pages, by the names of their connections. */
export function stopsOf(...names: string[]): StopsRecord {
  const engaged = names.map((name) => ({ name, left: false, age: 0 }));
  return { stopped: names.length > 0, stops: engaged, operators: 1, link: "up", on_link_lost: "continue" };
}

/** What other sources hold the robot. */
export function baseOf(...stops: string[]): BaseRecord {
  return { taken_by: "", hindrance: stops.length ? "stop" : "", reason: "", stops };
}

export function possibleOf(given: Partial<PossibleRecord> = {}): PossibleRecord {
  return { request: "operator.pause", verb: "pause", mission: "", possible: true, engages: [], releases: [], code: "", reason: "", ...given };
}

/** Tell a record on its topic: JSON in a std_msgs/String, as it is on the wire. */
export function tell<T>(topic: Topic<T>, record: T, at = T0): void {
  topic.take({ data: JSON.stringify(record) }, at);
}

export function tellStep(...given: Parameters<typeof recordOf>): void {
  tell(steps, recordOf(...given), T0 + given[0] * 1000);
}

/** Tell the published state, so many seconds after `T0`. */
export function tellState(seconds: number, given: Partial<MissionState>): void {
  const told = { lifecycle_state: "MISSION", mission_id: "m-1", mission_type: "Round", started_at: { sec: 0, nanosec: 0 } };
  state.take({ header: {}, ...told, ...given }, T0 + seconds * 1000);
}
