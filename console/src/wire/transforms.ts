// Where frames are in each other, from /tf and /tf_static: the part of tf2 that a page needs.
import type { Quaternion, TFMessage, Vector3 } from "../ros";

/** Metres, and a direction in radians from the x axis. */
interface FloorPose {
  readonly x: number;
  readonly y: number;
  readonly yaw: number;
}

interface Placed {
  readonly parent: string;
  readonly shift: Vector3;
  readonly turn: Quaternion;
  /** When it was told, in the robot's milliseconds; static ones are always true. */
  readonly heard: number;
}

/** Frames that are remembered, and hops from one to the frame that is asked for. */
const MOST_FRAMES = 2000;
const MOST_HOPS = 32;

const plain = (frame: string): string => frame.replace(/^\/+/, "");

export class TransformTree {
  private readonly frames = new Map<string, Placed>();

  take({ transforms }: TFMessage, heard: number): void {
    for (const { header, child_frame_id, transform } of transforms) {
      const child = plain(child_frame_id);
      if (!this.frames.has(child) && this.frames.size >= MOST_FRAMES) continue;
      const { translation: shift, rotation: turn } = transform;
      this.frames.set(child, { parent: plain(header.frame_id), shift, turn, heard });
    }
  }

  /** Where a frame is in another; undefined where no way leads there, or a part of it was not told since a time. */
  find(target: string, frame: string, since: number): FloorPose | undefined {
    let [x, y, z] = [0, 0, 0];
    let ahead: Triple = [1, 0, 0];
    let at = frame;
    for (let hop = 0; at !== target; hop++) {
      const placed = this.frames.get(at);
      if (!placed || placed.heard < since || hop === MOST_HOPS) return undefined;
      ahead = turned(placed.turn, ahead);
      [x, y, z] = turned(placed.turn, [x, y, z]);
      const { shift } = placed;
      [x, y, z] = [x + (shift.x ?? 0), y + (shift.y ?? 0), z + (shift.z ?? 0)];
      at = placed.parent;
    }
    return { x, y, yaw: Math.atan2(ahead[1], ahead[0]) };
  }

  /** The frame on the way up from which nothing leads on, or which was not told since a time; "" where none is. */
  gap(target: string, frame: string, since: number): string {
    let at = frame;
    for (let hop = 0; at !== target && hop < MOST_HOPS; hop++) {
      const placed = this.frames.get(at);
      if (!placed || placed.heard < since) return at;
      at = placed.parent;
    }
    return at === target ? "" : at;
  }
}

type Triple = readonly [number, number, number];

/** A vector turned by a unit quaternion: v + 2w(q × v) + 2q × (q × v). */
function turned({ x, y, z, w }: Quaternion, v: Triple): Triple {
  const q: Triple = [x ?? 0, y ?? 0, z ?? 0];
  const once = cross(q, v);
  const twice = cross(q, once);
  const by = (index: 0 | 1 | 2): number => v[index] + 2 * ((w ?? 1) * once[index] + twice[index]);
  return [by(0), by(1), by(2)];
}

function cross(a: Triple, b: Triple): Triple {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
