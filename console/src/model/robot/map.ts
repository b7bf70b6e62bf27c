// What is on the map: occupancy, the robot and where it was, its plan, and anomalies. Metres, frame `map`.
import { computed, signal } from "@preact/signals";
import { MSG_TYPES, Observation, type OccupancyGrid, type Path, type Pose, type TFMessage } from "../../ros";
import { shownNow } from "../time/clock";
import { observations } from "../mission/mission";
import { moment } from "../time/past";
import { TransformTree } from "../../wire/transforms";
import { topic } from "../topics";
import type { FloorPlace } from "./twin";

export const MAP_FRAME = "map";
/** Names that the frame of a robot's body has; the first that is known counts. */
const BASE_FRAMES = ["base_link", "base_footprint"] as const;
/** Milliseconds between two places of the robot, which is enough for the eye. */
const POSE_EVERY_MS = 100;
/** Seconds of silence after which a place is old. */
export const ROBOT_SILENT_S = 3;
/** Seconds of the way that are shown. */
const TRAIL_S = 120;
/** Seconds: a stamp that is less is of a clock that does not count since 1970. */
const SINCE_1970_S = 1e9;
/** Seconds after which a plan that is not told again is of a drive that has ended. */
const PLAN_S = 6;

/** What a cell is: of what a map tells, 65 and more is occupied, 20 and less is free. */
export const CELLS = ["unknown", "free", "between", "occupied"] as const;
export type CellKind = (typeof CELLS)[number];

/** An occupancy grid. Its origin is the corner of cell (0, 0), from which the rows go along `yaw`, row 0 at the bottom. */
export interface Grid extends FloorPlace {
  readonly width: number;
  readonly height: number;
  readonly resolution: number;
  /** Cells row by row as runs: `length << 2 | index in CELLS`. */
  readonly runs: Uint32Array;
}

function kindOf(told: number): number {
  if (told < 0) return 0;
  return told <= 20 ? 1 : told < 65 ? 2 : 3;
}

function runsOf(data: readonly number[]): Uint32Array {
  const runs: number[] = [];
  let begin = 0;
  for (let index = 1; index <= data.length; index++) {
    const kind = kindOf(data[begin]!);
    if (index < data.length && kindOf(data[index]!) === kind) continue;
    runs.push(((index - begin) << 2) | kind);
    begin = index;
  }
  return Uint32Array.from(runs);
}

function yawOf({ orientation: { x, y, z, w } }: Pose): number {
  const [a, b, c, d] = [x ?? 0, y ?? 0, z ?? 0, w ?? 1];
  return Math.atan2(2 * (d * c + a * b), 1 - 2 * (b * b + c * c));
}

/** Why what came last on /map is no map; "" where it is one. */
export const gridProblem = signal("");

function gridOf({ info, data }: OccupancyGrid): Grid | undefined {
  const { width, height, resolution, origin } = info;
  const { x, y } = origin.position;
  const right = width > 0 && width * height === data.length && resolution !== null && resolution > 0;
  gridProblem.value = right ? "" : `${width} × ${height} × ${resolution} m, ${data.length}`;
  if (!right || x === null || y === null) return undefined;
  return { width, height, resolution, x, y, yaw: yawOf(origin), runs: runsOf(data) };
}

function sameGrid(one: Grid, other: Grid): boolean {
  const keys = ["width", "height", "resolution", "x", "y", "yaw"] as const;
  if (keys.some((key) => one[key] !== other[key]) || one.runs.length !== other.runs.length) return false;
  return one.runs.every((run, index) => run === other.runs[index]);
}

/** A map that grows is told twice a second; of the past, 240 different ones are kept. */
export const grid = topic<OccupancyGrid, Grid>("/map", MSG_TYPES.OccupancyGrid, {
  keep: 240,
  throttle: 1000,
  always: true,
  read: gridOf,
  same: sameGrid,
});

/** The map of the moment that is shown; of a moment before the first, the first. */
export const shownGrid = computed<Grid | undefined>(() => (grid.shown.value ?? grid.past.between(0, Infinity)[0])?.value);

const tree = new TransformTree();
/** When the robot's place was last known, in its milliseconds. */
const placedAt = signal<number | undefined>(undefined);

function placed(at: number): FloorPlace | undefined {
  for (const base of BASE_FRAMES) {
    const found = tree.find(MAP_FRAME, base, at - ROBOT_SILENT_S * 1000);
    if (found) return found;
  }
  return undefined;
}

/** Where the robot is. All of /tf is heard: a throttle passes the last message, which may always be another publisher's. */
export const robot = topic<TFMessage, FloorPlace>("/tf", MSG_TYPES.TFMessage, {
  keep: 5000,
  always: true,
  read: (message, at) => {
    tree.take(message, at);
    if (Math.abs(at - (placedAt.peek() ?? 0)) < POSE_EVERY_MS) return undefined;
    const place = placed(at);
    if (place) placedAt.value = at;
    return place;
  },
  same: (one, other) => Math.hypot(one.x - other.x, one.y - other.y) < 0.002 && Math.abs(one.yaw - other.yaw) < 0.01,
});

/** Transforms that never change; heard only for the tree. */
topic<TFMessage, never>("/tf_static", MSG_TYPES.TFMessage, {
  keep: 1,
  always: true,
  read: (message) => (tree.take(message, Infinity), undefined),
});

/** Since when nobody knows where the robot is; undefined while it is known, and of the past. */
export const robotSilentSince = computed<number | undefined>(() => {
  if (moment.value !== null || placedAt.value === undefined) return undefined;
  return shownNow.value - placedAt.value > ROBOT_SILENT_S * 1000 ? placedAt.value : undefined;
});

/** The frame from which no transform leads on to the map. */
export function transformGap(): string {
  return tree.gap(MAP_FRAME, BASE_FRAMES[0], shownNow.value - ROBOT_SILENT_S * 1000);
}

/** The part of a list that was lately; the list before when nothing came and nothing went. */
function lasting<T>(make: () => readonly T[]): () => readonly T[] {
  let before: readonly T[] = [];
  return () => {
    const now = make();
    const same = now.length === before.length && now[0] === before[0] && now.at(-1) === before.at(-1);
    return same ? before : (before = now);
  };
}

/** Where the robot was in the last two minutes of the moment that is shown. */
export const trail = computed(lasting(() => robot.past.between(shownNow.value - TRAIL_S * 1000, shownNow.value)));

export const plan = topic<Path, readonly FloorPlace[]>("/plan", MSG_TYPES.Path, {
  keep: 2000,
  throttle: 250,
  always: true,
  when: ({ header: { stamp } }) => (stamp.sec > SINCE_1970_S ? stamp.sec * 1000 + stamp.nanosec / 1e6 : undefined),
  read: ({ poses }) =>
    poses.map(({ pose }) => ({ x: pose.position.x ?? 0, y: pose.position.y ?? 0, yaw: yawOf(pose) })),
});

/** The plan of a drive that is under way. */
export const shownPlan = computed<readonly FloorPlace[] | undefined>(() => {
  const known = plan.shown.value;
  return known && shownNow.value - known.at < PLAN_S * 1000 ? known.value : undefined;
});

/** Something out of the ordinary that somebody reported, at a place. */
export interface Report {
  readonly at: number;
  readonly x: number;
  readonly y: number;
  readonly description: string;
  readonly severity: number;
}

/** Reports nearer to each other than so many metres, in the same words, are of one thing: the last counts. */
const SAME_THING_M = 0.2;

/** What was reported until the moment that is shown. */
export const reports = computed<readonly Report[]>(() => {
  const found: Report[] = [];
  for (const { at, value } of observations.past.until(moment.value).toReversed()) {
    const { pose, description, severity } = value.anomaly;
    const { x, y } = pose.pose.position;
    if (value.kind !== Observation.KIND_ANOMALY || value.status !== Observation.STATUS_OK) continue;
    if (x === null || y === null) continue;
    const again = (one: Report): boolean =>
      one.description === description && Math.hypot(one.x - x, one.y - y) < SAME_THING_M;
    if (!found.some(again)) found.push({ at, x, y, description, severity });
  }
  return found;
});
