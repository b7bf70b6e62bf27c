// The canvas: it is painted when something changed, and takes pointers, the wheel and keys.
import { computed, effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { texts } from "../../model/page";
import { picking, toggle } from "../../model/mission/picking";
import { robot } from "../../model/robot/map";
import { camera, fitted, panned, toMap, zoomed, type Camera, type Size } from "./camera";
import { aim, aimAt, choosing, endChoosing } from "./driving";
import { paint } from "./paint";
import { bounds, hovered, scene, selected } from "./scene";
import { thingAt } from "./things";

interface Point {
  readonly x: number;
  readonly y: number;
}

/** Pixels that a press may move and still be a tap, and from which a drag says a heading. */
const TAP = 6;
const HEADING = 12;
/** What one press of a key does. */
const KEY_PAN = 60;
const KEY_ZOOM = 1.3;
const KEY_STEP_M = 0.05;
const KEY_TURN = Math.PI / 12;

/** The canvas in CSS pixels. */
export const size = signal<Size>({ width: 1, height: 1 });
/** What is seen just now, in metres and pixels. */
export const seen = computed<Camera>(() => camera.value ?? fitted(bounds.value, size.value));
/** Where the pointer is: on the canvas, and on the map; undefined when it is elsewhere. */
export const pointer = signal<(Point & { readonly map: Point }) | undefined>(undefined);

export function zoom(factor: number, about: Point = { x: size.value.width / 2, y: size.value.height / 2 }): void {
  camera.value = zoomed(seen.value, size.value, factor, about);
}

export function fit(): void {
  camera.value = undefined;
}

/** Bring a place into sight, if it is not. */
export function bringIn({ x, y }: Point): void {
  const { width, height } = size.value;
  const { x: cx, y: cy, scale } = seen.value;
  if (Math.abs(x - cx) * scale > width / 2 - 20 || Math.abs(y - cy) * scale > height / 2 - 20) camera.value = { x, y, scale };
}

/** Choose a thing: a tag is taken for the field of a form while one is being filled. */
export function choose(key: string): void {
  selected.value = key;
  if (picking.value && key.startsWith("tag:")) toggle(key.slice(4));
}

/** Fingers and the mouse on the canvas. */
class Hand {
  private readonly down = new Map<number, Point>();
  private began: Point = { x: 0, y: 0 };
  private moved = false;

  press(id: number, at: Point): void {
    this.down.set(id, at);
    this.moved = this.down.size > 1;
    this.began = at;
    if (choosing.value && this.down.size === 1) this.place(at);
  }

  move(id: number, at: Point): void {
    const before = this.down.get(id);
    if (!before) return this.hover(at);
    const others = [...this.down].filter(([other]) => other !== id).map(([, place]) => place);
    this.down.set(id, at);
    if (Math.hypot(at.x - this.began.x, at.y - this.began.y) > TAP) this.moved = true;
    if (others[0]) return this.pinch(before, at, others[0]);
    if (choosing.value) return this.head(at);
    if (this.moved) camera.value = panned(seen.value, at.x - before.x, at.y - before.y);
  }

  lift(id: number, at: Point): void {
    if (!this.down.delete(id) || this.down.size) return;
    if (choosing.value || this.moved) return;
    choose(thingAt(scene.value, seen.value, size.value, at, toMap(seen.value, size.value, at)));
  }

  drop(id: number): void {
    this.down.delete(id);
  }

  hover(at: Point): void {
    const map = toMap(seen.value, size.value, at);
    pointer.value = { ...at, map };
    hovered.value = thingAt(scene.value, seen.value, size.value, at, map);
  }

  private place(at: Point): void {
    const { x, y } = toMap(seen.value, size.value, at);
    aimAt(x, y);
  }

  /** A drag from the place on says where the robot is to look. */
  private head(at: Point): void {
    const [dx, dy] = [at.x - this.began.x, at.y - this.began.y];
    if (aim.value && Math.hypot(dx, dy) > HEADING) aimAt(aim.value.x, aim.value.y, Math.atan2(-dy, dx));
  }

  private pinch(before: Point, now: Point, other: Point): void {
    const apart = (one: Point): number => Math.max(1, Math.hypot(one.x - other.x, one.y - other.y));
    const middle = { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 };
    const shifted = panned(seen.value, (now.x - before.x) / 2, (now.y - before.y) / 2);
    camera.value = zoomed(shifted, size.value, apart(now) / apart(before), middle);
  }
}

const ARROWS: Readonly<Record<string, readonly [number, number]>> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** Keys on the canvas: they move what is seen, or the place to drive to. Returns whether the key was one of them. */
function pressed({ key, shiftKey }: KeyboardEvent): boolean {
  const arrow = ARROWS[key];
  const to = choosing.value ? (aim.value ?? robot.shown.value?.value ?? { ...seen.value, yaw: 0 }) : undefined;
  if (key === "Escape" && choosing.value) endChoosing();
  else if (key === "+" || key === "=") zoom(KEY_ZOOM);
  else if (key === "-") zoom(1 / KEY_ZOOM);
  else if (key === "0" || key === "Home") fit();
  else if (arrow && to) {
    const step = KEY_STEP_M * (shiftKey ? 10 : 1);
    aimAt(to.x + arrow[0] * step, to.y + arrow[1] * step, to.yaw);
  } else if (to && (key === "[" || key === "]")) aimAt(to.x, to.y, to.yaw + (key === "[" ? KEY_TURN : -KEY_TURN));
  else if (arrow) camera.value = panned(seen.value, -arrow[0] * KEY_PAN, arrow[1] * KEY_PAN);
  else return false;
  return true;
}

/** Paint on a canvas whenever something changed, at most once a frame, until the function that is returned is called. */
function keepPainted(canvas: HTMLCanvasElement): () => void {
  const on = canvas.getContext("2d")!;
  let frame = 0;
  const draw = (): void => {
    frame = 0;
    const { width, height } = size.peek();
    const density = devicePixelRatio || 1;
    const [across, down] = [Math.round(width * density), Math.round(height * density)];
    if (canvas.width !== across || canvas.height !== down) [canvas.width, canvas.height] = [across, down];
    const { x, y, scale } = seen.peek();
    paint(on, scene.peek(), seen.peek(), size.peek(), density);
    Object.assign(canvas.dataset, { x: x.toFixed(4), y: y.toFixed(4), scale: scale.toFixed(3) });
  };
  const end = effect(() => {
    void [scene.value, seen.value, size.value];
    frame ||= requestAnimationFrame(draw);
  });
  const observer = new ResizeObserver(([entry]) => {
    const { width, height } = entry!.contentRect;
    size.value = { width: Math.max(1, width), height: Math.max(1, height) };
  });
  observer.observe(canvas);
  return () => {
    end();
    observer.disconnect();
    cancelAnimationFrame(frame);
  };
}

const placeOf = ({ offsetX, offsetY }: MouseEvent): Point => ({ x: offsetX, y: offsetY });

/** The wheel zooms; with nothing to scroll it must be told that it does not scroll the page. */
function wheelZooms(canvas: HTMLCanvasElement): () => void {
  const turned = (event: WheelEvent): void => {
    event.preventDefault();
    zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) / 400), placeOf(event));
  };
  canvas.addEventListener("wheel", turned, { passive: false });
  return () => canvas.removeEventListener("wheel", turned);
}

export function Surface({ summary }: { summary: string }) {
  const t = texts.value.map;
  const found = useRef<HTMLCanvasElement>(null);
  const hand = useRef(new Hand()).current;
  useEffect(() => {
    const ends = [keepPainted(found.current!), wheelZooms(found.current!)];
    return () => ends.forEach((end) => end());
  }, []);
  return (
    <canvas
      ref={found}
      class={`map-canvas ${choosing.value ? "choosing" : ""}`}
      tabIndex={0}
      role="application"
      aria-label={summary}
      aria-roledescription={t.title}
      aria-describedby="map-keys"
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        hand.press(event.pointerId, placeOf(event));
      }}
      onPointerMove={(event) => hand.move(event.pointerId, placeOf(event))}
      onPointerUp={(event) => hand.lift(event.pointerId, placeOf(event))}
      onPointerCancel={(event) => hand.drop(event.pointerId)}
      onPointerLeave={() => ((hovered.value = ""), (pointer.value = undefined))}
      onKeyDown={(event) => pressed(event) && event.preventDefault()}
    />
  );
}
