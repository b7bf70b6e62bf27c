// What part of the map is seen: pan, zoom, and the way from metres to pixels and back.
import { signal } from "@preact/signals";

/** `x`, `y`: what is in the middle, in metres; `scale`: CSS pixels of a metre. */
export interface Camera {
  readonly x: number;
  readonly y: number;
  readonly scale: number;
}

export interface Size {
  readonly width: number;
  readonly height: number;
}

export interface Bounds {
  readonly left: number;
  readonly right: number;
  readonly bottom: number;
  readonly top: number;
}

/** Pixels of a metre at most and at least. */
const NEAREST = 600;
const FARTHEST = 0.5;
/** Pixels that are left free around what is fitted in. */
const MARGIN = 24;

/** What is seen; undefined: all of it, also when it grows. */
export const camera = signal<Camera | undefined>(undefined);

const limited = (scale: number): number => Math.min(NEAREST, Math.max(FARTHEST, scale));

export function fitted({ left, right, bottom, top }: Bounds, { width, height }: Size): Camera {
  const across = Math.max(1, width - 2 * MARGIN) / Math.max(0.5, right - left);
  const up = Math.max(1, height - 2 * MARGIN) / Math.max(0.5, top - bottom);
  return { x: (left + right) / 2, y: (bottom + top) / 2, scale: limited(Math.min(across, up)) };
}

export function toScreen({ x, y, scale }: Camera, { width, height }: Size, at: { x: number; y: number }) {
  return { x: width / 2 + (at.x - x) * scale, y: height / 2 - (at.y - y) * scale };
}

export function toMap({ x, y, scale }: Camera, { width, height }: Size, at: { x: number; y: number }) {
  return { x: x + (at.x - width / 2) / scale, y: y - (at.y - height / 2) / scale };
}

/** The camera after a drag by so many pixels. */
export function panned({ x, y, scale }: Camera, dx: number, dy: number): Camera {
  return { x: x - dx / scale, y: y + dy / scale, scale };
}

/** The camera after a zoom by a factor about a place of the screen. */
export function zoomed(from: Camera, size: Size, factor: number, about: { x: number; y: number }): Camera {
  const fixed = toMap(from, size, about);
  const scale = limited(from.scale * factor);
  const turn = from.scale / scale;
  return { x: fixed.x + (from.x - fixed.x) * turn, y: fixed.y + (from.y - fixed.y) * turn, scale };
}
