// Where one looks at a drawing from: pan by hand, wheel, two fingers and keys, without drawing anything anew.
import type { Box, Picture } from "./picture";

const LEAST = 0.05;
/** What one looks at is never smaller, however large it is. */
const READABLE = 0.4;
const MOST = 4;
/** A press that moves less, in pixels, is a click. */
const CLICK = 5;
/** Milliseconds after the last change of scale until the drawing is made sharp again. */
const SETTLE_MS = 160;

export class Camera {
  private x = 0;
  private y = 0;
  private scale = 1;
  /** The scale that the drawing was laid out at; what is more is done by the compositor, and blurred. */
  private sharp = 1;
  private frame = 0;
  private timer = 0;
  private picture: Picture | undefined;
  /** Where the drawing's scene begins, from which boxes are told, and how large the stage is. */
  private scene: readonly [number, number] = [0, 0];
  private width = 0;
  private height = 0;
  private readonly pointers = new Map<number, PointerEvent>();
  private dragged = false;

  /** `moved` is told when somebody moved the drawing by hand. */
  constructor(private readonly stage: HTMLElement, private readonly paper: HTMLElement, private readonly moved: () => void) {
    stage.addEventListener("pointerdown", this.down);
    stage.addEventListener("pointermove", this.move);
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      stage.addEventListener(end, this.up);
    stage.addEventListener("wheel", this.wheel, { passive: false });
    this.measure();
    new ResizeObserver(() => this.measure()).observe(stage);
    // What ends a drag is no click on what lies there.
    stage.addEventListener("click", (event) => this.dragged && event.stopPropagation(), { capture: true });
  }

  /** Show another drawing from where the last one was seen from; `anchor` is a state that stays where it is. */
  show(picture: Picture, anchor?: string): void {
    const before = anchor === undefined ? undefined : this.picture?.box(anchor);
    const first = this.picture === undefined;
    this.picture = picture;
    this.paper.replaceChildren(picture.svg);
    const matrix = (picture.over.parentElement as unknown as SVGGElement).transform?.baseVal.consolidate()?.matrix;
    this.scene = matrix ? [matrix.e, matrix.f] : [0, 0];
    this.settle();
    const after = anchor === undefined ? undefined : picture.box(anchor);
    if (first) this.fit();
    else if (before && after) {
      this.x += (before.x - after.x) * this.scale;
      this.y += (before.y - after.y) * this.scale;
    }
    this.apply();
  }

  /** See all of it, or as much as can be read, from its beginning. */
  fit(least = 0.35): void {
    if (!this.picture) return;
    const whole = Math.min(this.width / this.picture.width, this.height / this.picture.height, 1.2);
    this.scale = Math.max(whole, least);
    this.x = within(0, this.width - this.picture.width * this.scale);
    this.y = within(0, this.height - this.picture.height * this.scale);
    this.settle();
  }

  /** Look at a box: in the middle, and large enough to be read. */
  centre(box: Box): void {
    const fits = Math.min(this.width / (box.width + 80), this.height / (box.height + 80));
    this.scale = Math.min(Math.max(this.scale, Math.min(0.8, fits)), Math.max(fits, READABLE), MOST);
    const [left, top] = this.scene;
    this.x = this.width / 2 - (left + box.x + box.width / 2) * this.scale;
    this.y = this.height / 2 - (top + box.y + box.height / 2) * this.scale;
    this.x = within(this.x, this.width - (this.picture?.width ?? 0) * this.scale);
    this.y = within(this.y, this.height - (this.picture?.height ?? 0) * this.scale);
    this.settle();
  }

  /** Move as little as needed so that a box is seen. */
  follow(box: Box): void {
    const [left, top] = this.scene;
    const x = this.x + (left + box.x) * this.scale;
    const y = this.y + (top + box.y) * this.scale;
    const inside = x >= 0 && y >= 0 && x + box.width * this.scale <= this.width && y + box.height * this.scale <= this.height;
    if (!inside) this.centre(box);
  }

  pan(dx: number, dy: number): void {
    this.x += dx;
    this.y += dy;
    this.later();
  }

  /** Change the scale around a point of the stage, in its pixels; without one around its middle. */
  zoom(factor: number, x = this.width / 2, y = this.height / 2): void {
    const scale = Math.min(Math.max(this.scale * factor, LEAST), MOST);
    this.x = x - ((x - this.x) * scale) / this.scale;
    this.y = y - ((y - this.y) * scale) / this.scale;
    this.scale = scale;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.settle(), SETTLE_MS);
    this.later();
  }

  private measure(): void {
    this.width = this.stage.clientWidth;
    this.height = this.stage.clientHeight;
  }

  private readonly down = (event: PointerEvent): void => {
    if (event.pointerType === "mouse" && event.button !== 0) return;
    if (!this.pointers.size) this.dragged = false;
    this.pointers.set(event.pointerId, event);
  };

  private readonly move = (event: PointerEvent): void => {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    if (!this.dragged && Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY) < CLICK) return;
    if (!this.dragged) {
      this.dragged = true;
      this.stage.setPointerCapture(event.pointerId);
      this.moved();
    }
    const other = [...this.pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (!other) {
      this.pan(event.clientX - before.clientX, event.clientY - before.clientY);
      return;
    }
    const apart = (one: PointerEvent): number => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
    const { left, top } = this.stage.getBoundingClientRect();
    const middle = [(event.clientX + other.clientX) / 2 - left, (event.clientY + other.clientY) / 2 - top] as const;
    this.pan((event.clientX - before.clientX) / 2, (event.clientY - before.clientY) / 2);
    this.zoom(apart(event) / Math.max(apart(before), 1), ...middle);
  };

  private readonly up = (event: PointerEvent): void => void this.pointers.delete(event.pointerId);

  private readonly wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const { left, top } = this.stage.getBoundingClientRect();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1);
    this.moved();
    this.zoom(Math.exp(-pixels / 400), event.clientX - left, event.clientY - top);
  };

  private later(): void {
    this.frame ||= requestAnimationFrame(() => this.apply());
  }

  /** Lay the drawing out at the scale that it is seen at. */
  private settle(): void {
    if (!this.picture) return;
    if (this.sharp === this.scale && this.picture.svg.hasAttribute("width")) {
      this.later();
      return;
    }
    this.sharp = this.scale;
    this.picture.svg.setAttribute("width", String(this.picture.width * this.sharp));
    this.picture.svg.setAttribute("height", String(this.picture.height * this.sharp));
    this.apply();
  }

  private apply(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    const rest = this.scale / this.sharp;
    this.paper.style.transform = `translate(${this.x}px, ${this.y}px)${rest === 1 ? "" : ` scale(${rest})`}`;
  }
}

/** Where a side of the drawing begins so that no room is empty that need not be; `rest` is what it leaves free. */
function within(begin: number, rest: number): number {
  return rest >= 0 ? rest / 2 : Math.min(0, Math.max(rest, begin));
}
