// Pictures that are made once and painted often: the floor, the walls over it, and the field between both.
import { CELLS, type Grid } from "../../model/robot/map";
import { rampAt, rgbOf, type Palette, type Scale } from "./colours";
import type { Field } from "./field";

interface Bitmap {
  readonly made: readonly unknown[];
  readonly picture: HTMLCanvasElement;
}

/** One picture for each place of use; it is made anew when what it is made of is another thing. */
const bitmaps = new Map<string, Bitmap>();

function bitmap(name: string, from: readonly unknown[], width: number, height: number, fill: (pixels: Uint32Array) => void) {
  const before = bitmaps.get(name);
  if (before && before.made.every((each, index) => each === from[index])) return before.picture;
  const picture = before?.picture ?? document.createElement("canvas");
  [picture.width, picture.height] = [width, height];
  const context = picture.getContext("2d")!;
  const image = context.createImageData(width, height);
  fill(new Uint32Array(image.data.buffer));
  context.putImageData(image, 0, 0);
  bitmaps.set(name, { made: from, picture });
  return picture;
}

/** Four bytes of a pixel as a number; all machines with browsers have the lowest byte first. */
function pixel([red, green, blue]: readonly [number, number, number]): number {
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

function fillRuns(pixels: Uint32Array, runs: Uint32Array, colours: readonly number[]): void {
  let at = 0;
  for (const run of runs) {
    const end = at + (run >>> 2);
    pixels.fill(colours[run & 3]!, at, end);
    at = end;
  }
}

/** The cells of a map; row 0 of the picture is row 0 of the map. */
export function floorPicture(grid: Grid, palette: Palette): HTMLCanvasElement {
  const colours = CELLS.map((kind) => pixel(rgbOf(palette[`map-${kind}`])));
  return bitmap("floor", [grid, palette], grid.width, grid.height, (pixels) => fillRuns(pixels, grid.runs, colours));
}

/** The occupied cells alone, to be painted over a field. */
export function wallsPicture(grid: Grid, palette: Palette): HTMLCanvasElement {
  const colours = CELLS.map((kind) => (kind === "occupied" ? pixel(rgbOf(palette["map-occupied"])) : 0));
  return bitmap("walls", [grid, palette], grid.width, grid.height, (pixels) => fillRuns(pixels, grid.runs, colours));
}

/** A field; where nothing is known it is transparent. */
export function fieldPicture(field: Field, scale: Scale): HTMLCanvasElement {
  return bitmap("field", [field], field.width, field.height, (pixels) =>
    field.values.forEach((value, index) => {
      if (!Number.isNaN(value)) pixels[index] = pixel(rampAt(value, scale));
    }),
  );
}
