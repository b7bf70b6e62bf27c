// What the digital twin knows of each tag.
import { MSG_TYPES, type SensorReading, type TwinState, type TwinTagState } from "../../ros";
import { topic } from "../topics";

export interface Tag extends Omit<TwinTagState, "last_observed" | "stale_seconds"> {
  /** When something was observed there last, in the robot's milliseconds; undefined: never. */
  readonly observedAt: number | undefined;
}

/** A place on the floor: metres in frame `map`, and a direction in radians from its x axis. */
export interface FloorPlace {
  readonly x: number;
  readonly y: number;
  readonly yaw: number;
}

/** Seconds of silence after which the twin's state is old. */
export const TWIN_SILENT_S = 3;
/** Seconds: nothing is that old, so it was never observed, or a time is not of a clock that counts since 1970. */
const NEVER_S = 1e9;

/** The last told of each tag, so that what did not change is kept once. */
const known = new Map<string, { readonly key: string; readonly tag: Tag }>();

function tagOf({ last_observed, stale_seconds, ...rest }: TwinTagState, at: number): Tag {
  const key = JSON.stringify([rest, last_observed]);
  const before = known.get(rest.tag_id);
  if (before?.key === key) return before.tag;
  const age = stale_seconds ?? NEVER_S;
  const told = last_observed.sec > NEVER_S ? last_observed.sec * 1000 + last_observed.nanosec / 1e6 : at - age * 1000;
  const tag = { ...rest, observedAt: age < NEVER_S ? told : undefined };
  known.set(rest.tag_id, { key, tag });
  return tag;
}

/** All tags, in the order in which the twin heard of them. */
export const twin = topic<TwinState, readonly Tag[]>("/twin/state", MSG_TYPES.TwinState, {
  keep: 600,
  always: true,
  steady: TWIN_SILENT_S,
  read: ({ tags }, at) => tags.map((tag) => tagOf(tag, at)),
  same: (one, other) => one.length === other.length && one.every((tag, index) => tag === other[index]),
});

/** Where a tag is; undefined while nobody knows. */
export function placeOf({ pose: { position, orientation } }: Tag): FloorPlace | undefined {
  const { x, y } = position;
  if (!orientation.w || x === null || y === null) return undefined;
  return { x, y, yaw: 2 * Math.atan2(orientation.z ?? 0, orientation.w) };
}

/** The newest value of a sensor at a tag; undefined where it has none, or none that is a number. */
export function valueOf(tag: Tag, sensor: string): number | undefined {
  return tag.readings.find(({ name }: SensorReading) => name === sensor)?.value ?? undefined;
}
