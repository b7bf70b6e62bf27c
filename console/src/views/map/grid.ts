// Geometry of an occupancy grid.
import { CELLS, type CellKind, type Grid } from "../../model/robot/map";

interface Point {
  readonly x: number;
  readonly y: number;
}

/** The corners of a grid in the frame of the map, from its origin on. */
export function cornersOf({ x, y, yaw, width, height, resolution }: Grid): readonly Point[] {
  const [across, up] = [width * resolution, height * resolution];
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const at = (a: number, b: number): Point => ({ x: x + a * cos - b * sin, y: y + a * sin + b * cos });
  return [at(0, 0), at(across, 0), at(across, up), at(0, up)];
}

/** What the cell at a place is; undefined outside. */
export function cellAt(grid: Grid, x: number, y: number): CellKind | undefined {
  const [dx, dy] = [x - grid.x, y - grid.y];
  const [cos, sin] = [Math.cos(grid.yaw), Math.sin(grid.yaw)];
  const column = Math.floor((dx * cos + dy * sin) / grid.resolution);
  const row = Math.floor((dy * cos - dx * sin) / grid.resolution);
  if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return undefined;
  let left = row * grid.width + column;
  for (const run of grid.runs) {
    left -= run >>> 2;
    if (left < 0) return CELLS[run & 3];
  }
  return undefined;
}
