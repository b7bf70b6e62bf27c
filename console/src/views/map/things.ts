// What can be pointed at on the map, and what is told of it.
import { shownNow } from "../../model/time/clock";
import { ago, clockTime, dateTime, number } from "../../parts/format";
import { texts } from "../../model/page";
import { measured, sensorName } from "../../model/robot/sensors";
import type { Tag } from "../../model/robot/twin";
import type { Report } from "../../model/robot/map";
import { toScreen, type Camera, type Size } from "./camera";
import type { Scene } from "./scene";

interface Point {
  readonly x: number;
  readonly y: number;
}

/** Pixels from a thing within which it is meant. */
const REACH = { tag: 12, anomaly: 12, robot: 14, bloom: 7 };

/** Seconds within which the time of day alone is clear. */
const SAME_DAY_S = 20 * 3600;

export interface Told {
  readonly title: string;
  readonly lines: readonly string[];
}

export const tagKey = (id: string): string => `tag:${id}`;
export const reportKey = ({ at, x, y }: Report): string => `anomaly:${at}:${x}:${y}`;

/** Things with a place, the first to be tried first. */
function* places(scene: Scene): Generator<readonly [string, keyof typeof REACH, Point]> {
  const shows = (layer: string): boolean => !scene.hidden.has(layer);
  if (shows("anomalies")) for (const report of scene.reports) yield [reportKey(report), "anomaly", report];
  if (shows("tags")) for (const { tag, place } of scene.marks) yield [tagKey(tag.tag_id), "tag", place];
  if (shows("blooms"))
    for (const { tag } of scene.marks)
      for (const [index, { position }] of tag.flowers.entries())
        if (position.x !== null && position.y !== null)
          yield [`bloom:${tag.tag_id}:${index}`, "bloom", { x: position.x, y: position.y }];
  if (scene.robot) yield ["robot", "robot", scene.robot];
}

function isInside(points: readonly Point[], { x, y }: Point): boolean {
  let inside = false;
  points.forEach((one, index) => {
    const other = points.at(index - 1)!;
    const crosses = one.y > y !== other.y > y;
    if (crosses && x < ((other.x - one.x) * (y - one.y)) / (other.y - one.y) + one.x) inside = !inside;
  });
  return inside;
}

/** The corners of a planter box; none where it is not known. */
export function boxOf({ box_footprint }: Tag): readonly Point[] {
  const corners = box_footprint.points.map(({ x, y }) => ({ x: x ?? 0, y: y ?? 0 }));
  return corners.length >= 3 ? corners : [];
}

/** The key of the thing at a place of the screen; "" where there is none. */
export function thingAt(scene: Scene, camera: Camera, size: Size, at: Point, onMap: Point): string {
  let best = "";
  let nearest = Infinity;
  for (const [key, kind, place] of places(scene)) {
    const seen = toScreen(camera, size, place);
    const distance = Math.hypot(seen.x - at.x, seen.y - at.y) / REACH[kind];
    if (distance < nearest && distance <= 1) [best, nearest] = [key, distance];
  }
  if (best || scene.hidden.has("boxes")) return best;
  const box = scene.marks.find(({ tag }) => isInside(boxOf(tag), onMap));
  return box ? `box:${box.tag.tag_id}` : "";
}

function age(at: number | undefined): string {
  const t = texts.value.map;
  if (at === undefined) return t.neverRead;
  const passed = Math.max(0, (shownNow.value - at) / 1000);
  return t.observed(ago(passed), passed < SAME_DAY_S ? clockTime(at) : dateTime(at));
}

const percent = (part: number | null): string => `${number((part ?? 0) * 100, 0)} %`;
const named = (species: string): string => species.replaceAll("_", " ");

/** All that is told of a tag, in lines. */
export function tellTag(tag: Tag): Told {
  const t = texts.value.map;
  const lines = tag.readings.map(({ name, value }) => `${sensorName(name)}: ${measured(name, value)}`);
  if (lines.length === 0) lines.push(t.noReadings);
  lines.push(age(tag.observedAt));
  if (tag.species) lines.push(`${named(tag.species)} (${percent(tag.species_confidence)})`);
  if (tag.flowers.length) lines.push(t.blooms(tag.flowers.length));
  if (tag.anomaly) lines.push(`⚠ ${t.anomaly}`);
  return { title: t.tag(tag.tag_id), lines };
}

/** What is told of a thing; undefined when it is there no longer. */
export function tell(scene: Scene, key: string): Told | undefined {
  const t = texts.value.map;
  const [kind, id, index] = key.split(":");
  if (kind === "robot" && scene.robot) {
    const { x, y, yaw } = scene.robot;
    return { title: t.robot, lines: [t.place(x, y), t.heading(yaw)] };
  }
  const report = kind === "anomaly" && scene.reports.find((each) => reportKey(each) === key);
  if (report) {
    const lines = [report.description || "–", `${t.severity} ${report.severity}`, age(report.at)];
    return { title: `⚠ ${t.anomaly}`, lines };
  }
  const tag = scene.marks.find((mark) => mark.tag.tag_id === id)?.tag;
  if (!tag) return undefined;
  if (kind === "tag") return tellTag(tag);
  if (kind === "box") return { title: t.box(tag.tag_id), lines: [age(tag.observedAt)] };
  const bloom = kind === "bloom" && tag.flowers[Number(index)];
  if (!bloom) return undefined;
  const lines = [`${named(bloom.species) || "–"} (${percent(bloom.confidence)})`];
  if (bloom.anomaly) lines.push(`⚠ ${t.anomaly}`);
  return { title: t.bloomAt(tag.tag_id), lines: [...lines, age(tag.observedAt)] };
}

/** Where a thing is, to bring it into sight. */
export function placeOfThing(scene: Scene, key: string): Point | undefined {
  for (const [each, , place] of places(scene)) if (each === key) return place;
  return undefined;
}
