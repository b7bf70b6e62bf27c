// The field of a sensor between the tags, asked from the twin while somebody looks at it.
import { computed, effect, signal } from "@preact/signals";
import type { GetFieldRequest, GetFieldResponse } from "../../ros";
import { link } from "../../wire/link";
import { robotNow, shownNow } from "../../model/time/clock";
import { cornersOf } from "./grid";
import { grid } from "../../model/robot/map";
import { moment, Past, type Known } from "../../model/time/past";
import { twin } from "../../model/robot/twin";

/** A sensor's values on a grid without a turn: cell (0, 0) has its corner at `x`, `y`, row 0 is at the bottom. */
export interface Field {
  readonly sensor: string;
  readonly x: number;
  readonly y: number;
  readonly resolution: number;
  readonly width: number;
  readonly height: number;
  /** NaN where nothing is known. */
  readonly values: Float32Array;
  readonly lowest: number;
  readonly highest: number;
  readonly samples: number;
}

/** Metres of a cell at least, and cells at most. */
const FINEST_M = 0.1;
const MOST_CELLS = 20_000;
/** Milliseconds from one question to the next: when something has changed, and when nothing has. */
const SOON_MS = 2000;
const AGAIN_MS = 30_000;
const KEPT = 300;

const REMEMBERED = "lupin.field";
/** The sensor whose field is shown; "": none. */
export const sensor = signal(localStorage.getItem(REMEMBERED) ?? "");
sensor.subscribe((chosen) => localStorage.setItem(REMEMBERED, chosen));

/** Why there is no newer field; "" where there is. */
export const fieldProblem = signal("");

const pasts = new Map<string, Past<Field>>();

function pastOf(name: string): Past<Field> {
  const past = pasts.get(name) ?? new Past<Field>(KEPT);
  pasts.set(name, past);
  return past;
}

/** The field of the chosen sensor as it was told last, at the moment that is shown. */
export const field = computed<Known<Field> | undefined>(() =>
  sensor.value ? pastOf(sensor.value).at(moment.value) : undefined,
);

function requestFor(name: string): GetFieldRequest | undefined {
  const known = grid.past.at(null)?.value;
  if (!known) return undefined;
  const corners = cornersOf(known);
  const [xs, ys] = [corners.map(({ x }) => x), corners.map(({ y }) => y)];
  const [left, right, bottom, top] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const resolution = Math.max(FINEST_M, Math.sqrt(((right - left) * (top - bottom)) / MOST_CELLS));
  return { sensor_type: name, resolution, bbox_min_x: left, bbox_min_y: bottom, bbox_max_x: right, bbox_max_y: top };
}

async function ask(request: GetFieldRequest): Promise<void> {
  const name = request.sensor_type!;
  try {
    const told = await link.call<GetFieldResponse>("/twin/get_field", request);
    fieldProblem.value = told.error_message;
    if (!told.ok) return;
    const values = Float32Array.from(told.values, (value) => value ?? NaN);
    const { width, height, sample_count: samples } = told;
    const place = { x: told.origin_x!, y: told.origin_y!, resolution: told.resolution_used! };
    const range = { lowest: told.value_min!, highest: told.value_max! };
    pastOf(name).add(robotNow(), { sensor: name, ...place, width, height, values, ...range, samples });
  } catch (problem) {
    fieldProblem.value = problem instanceof Error ? problem.message : String(problem);
  }
}

/** Ask for the field of the chosen sensor until the function that is returned is called: soon after something changed. */
export function followField(): () => void {
  let asked: readonly unknown[] = [];
  let askedAt = -Infinity;
  let busy = false;
  return effect(() => {
    void shownNow.value;
    const wanted = [sensor.value, grid.past.at(null)?.value, twin.past.at(null)?.value];
    const request = sensor.value && moment.value === null && link.state.value === "open" && requestFor(sensor.value);
    const passed = performance.now() - askedAt;
    const isNew = wanted.some((each, index) => each !== asked[index]);
    const due = wanted[0] !== asked[0] || passed > (isNew ? SOON_MS : AGAIN_MS);
    if (!request || busy || !due) return;
    [asked, askedAt, busy] = [wanted, performance.now(), true];
    void ask(request).then(() => (busy = false));
  });
}

/** The value of a field at a place; undefined outside and where nothing is known. */
export function fieldAt(known: Field, x: number, y: number): number | undefined {
  const column = Math.floor((x - known.x) / known.resolution);
  const row = Math.floor((y - known.y) / known.resolution);
  if (column < 0 || row < 0 || column >= known.width || row >= known.height) return undefined;
  const value = known.values[row * known.width + column]!;
  return Number.isNaN(value) ? undefined : value;
}
