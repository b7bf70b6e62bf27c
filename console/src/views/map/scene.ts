// What is to be painted at the moment that is shown, apart from what part of it is seen.
import { computed, signal, type Signal } from "@preact/signals";
import { shownNow } from "../../model/time/clock";
import { state } from "../../model/mission/mission";
import { reports, robot, robotSilentSince, shownGrid, shownPlan, trail, type Grid, type Report } from "../../model/robot/map";
import { moment, type Known } from "../../model/time/past";
import { picked, picking } from "../../model/mission/picking";
import { placeOf, twin, TWIN_SILENT_S, valueOf, type FloorPlace, type Tag } from "../../model/robot/twin";
import { palette, scaleOf, type Palette, type Scale } from "./colours";
import { aim } from "./driving";
import { field, sensor, type Field } from "./field";
import { cornersOf } from "./grid";
import type { Bounds } from "./camera";

export const LAYERS = ["trail", "plan", "tags", "names", "blooms", "boxes", "anomalies"] as const;
export type Layer = (typeof LAYERS)[number];

const REMEMBERED = "lupin.map.hidden";
/** The layers that are switched off. */
export const hidden: Signal<ReadonlySet<string>> = signal(new Set(localStorage.getItem(REMEMBERED)?.split(" ") ?? []));

export function switchLayer(layer: Layer): void {
  const now = new Set(hidden.value);
  if (!now.delete(layer)) now.add(layer);
  hidden.value = now;
  localStorage.setItem(REMEMBERED, [...now].join(" "));
}

/** What the pointer is over, and what was tapped or chosen: keys of things. */
export const hovered = signal("");
export const selected = signal("");

/** Seconds in which a tag goes from fresh to old, and the steps in which its ring is drawn. */
export const FRESH_S = 600;
const STEPS = 20;

/** Since when the twin is silent, in the robot's milliseconds; undefined while it is not, and before it spoke. */
export const twinSilentSince = computed<number | undefined>(() => {
  const at = moment.value;
  const silence = at === null ? undefined : twin.silences.at(at);
  const heard = at === null ? twin.heardAt.value : silence && at < silence.value ? silence.at : undefined;
  return heard !== undefined && shownNow.value - heard > TWIN_SILENT_S * 1000 ? heard : undefined;
});

export interface TagMark {
  readonly tag: Tag;
  readonly place: FloorPlace;
  /** How fresh it is, from 20 (now) to 0 (old). */
  readonly fresh: number;
}

function freshness({ observedAt }: Tag): number {
  if (observedAt === undefined) return 0;
  const age = Math.max(0, (shownNow.value - observedAt) / 1000);
  return Math.max(0, Math.ceil(STEPS * (1 - age / FRESH_S)));
}

const tags = computed<readonly Tag[]>(() => twin.shown.value?.value ?? []);

let marksBefore: readonly TagMark[] = [];
/** The tags that have a place; the list is another one only when something on it changed. */
export const marks = computed<readonly TagMark[]>(() => {
  const now = tags.value.flatMap((tag) => {
    const place = placeOf(tag);
    return place ? [{ tag, place, fresh: freshness(tag) }] : [];
  });
  const same = ({ tag, fresh }: TagMark, index: number): boolean =>
    tag === marksBefore[index]?.tag && fresh === marksBefore[index].fresh;
  if (now.length !== marksBefore.length || !now.every(same)) marksBefore = now;
  return marksBefore;
});

/** The ends of the colours: of the field, and while there is none, of the tags. */
export const scale = computed<Scale | undefined>(() => {
  if (!sensor.value) return undefined;
  const known = field.value?.value;
  if (known && known.samples > 0) return scaleOf(known.lowest, known.highest);
  const values = tags.value.map((tag) => valueOf(tag, sensor.value)).filter((value) => value !== undefined);
  return values.length ? scaleOf(Math.min(...values), Math.max(...values)) : undefined;
});

export interface Scene {
  readonly palette: Palette;
  readonly grid: Grid | undefined;
  readonly field: Field | undefined;
  readonly sensor: string;
  readonly scale: Scale | undefined;
  readonly marks: readonly TagMark[];
  readonly twinSilent: boolean;
  readonly reports: readonly Report[];
  readonly robot: FloorPlace | undefined;
  readonly robotSilent: boolean;
  readonly trail: readonly Known<FloorPlace>[];
  readonly plan: readonly FloorPlace[] | undefined;
  readonly target: string;
  readonly aim: FloorPlace | undefined;
  readonly hidden: ReadonlySet<string>;
  readonly hovered: string;
  readonly selected: string;
  readonly picked: readonly string[] | undefined;
}

const target = computed(() => state.shown.value?.value.current_target ?? "");
const isTwinSilent = computed(() => twinSilentSince.value !== undefined);
const isRobotSilent = computed(() => robotSilentSince.value !== undefined);
export const scene = computed<Scene>(() => ({
  palette: palette.value,
  grid: shownGrid.value,
  field: field.value?.value,
  sensor: sensor.value,
  scale: scale.value,
  marks: marks.value,
  twinSilent: isTwinSilent.value,
  reports: reports.value,
  robot: robot.shown.value?.value,
  robotSilent: isRobotSilent.value,
  trail: trail.value,
  plan: shownPlan.value,
  target: target.value,
  aim: aim.value,
  hidden: hidden.value,
  hovered: hovered.value,
  selected: selected.value,
  picked: picking.value && picked.value,
}));

/** What is to be seen of all: the map, and without one the tags and the robot. */
export const bounds = computed<Bounds>(() => {
  const known = shownGrid.value;
  const points = known ? cornersOf(known) : [...marks.value.map(({ place }) => place), robot.shown.value?.value ?? { x: 0, y: 0 }];
  const [xs, ys] = [points.map(({ x }) => x), points.map(({ y }) => y)];
  return { left: Math.min(...xs), right: Math.max(...xs), bottom: Math.min(...ys), top: Math.max(...ys) };
});
