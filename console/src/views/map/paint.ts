// Painting: everything that is on the map, from the floor up. Lengths of signs are CSS pixels.
import type { FloorPlace, Tag } from "../../model/robot/twin";
import { valueOf } from "../../model/robot/twin";
import type { Grid } from "../../model/robot/map";
import { fieldPicture, floorPicture, wallsPicture } from "./bitmaps";
import { toScreen, type Camera, type Size } from "./camera";
import { bloomColour, css, rampAt, type Palette } from "./colours";
import type { Scene, TagMark } from "./scene";
import { boxOf, reportKey, tagKey } from "./things";

type Context = CanvasRenderingContext2D;
interface Point {
  readonly x: number;
  readonly y: number;
}

/** Half the diagonal of a tag's sign at least and at most, and by how much the ring is wider that tells how fresh it is. */
const SIGNS = [5, 8] as const;
const RING = 4;
const FRESHEST = 20;
/** A robot that is this much farther away and was this fast, in m and m/s, did not drive: it, or the map, was put elsewhere. */
const JUMP = { metres: 1, speed: 5 };
/** Names of tags are shown from so many pixels of a metre on. */
const NAMES_FROM = 35;

class Painter {
  readonly palette: Palette;
  /** Half the diagonal of a tag's sign: smaller where tags stand close. */
  private readonly sign: number;

  constructor(
    private readonly on: Context,
    private readonly scene: Scene,
    private readonly camera: Camera,
    private readonly size: Size,
    private readonly density: number,
  ) {
    this.palette = scene.palette;
    this.sign = Math.min(SIGNS[1], Math.max(SIGNS[0], camera.scale / 14));
  }

  paint(): void {
    const { on, scene, palette } = this;
    const { grid, field, scale } = scene;
    on.setTransform(1, 0, 0, 1, 0, 0);
    on.fillStyle = palette["map-unknown"];
    on.fillRect(0, 0, on.canvas.width, on.canvas.height);
    if (grid) this.picture(floorPicture(grid, palette), grid);
    if (field && scale && field.samples > 0) this.picture(fieldPicture(field, scale), { ...field, yaw: 0 });
    if (grid && field) this.picture(wallsPicture(grid, palette), grid);
    on.setTransform(this.density, 0, 0, this.density, 0, 0);
    this.layer("boxes", () => scene.marks.forEach(({ tag }) => this.box(tag)));
    this.layer("trail", () => this.trail());
    this.layer("plan", () => this.plan());
    this.layer("blooms", () => scene.marks.forEach(({ tag }) => this.blooms(tag)));
    this.layer("tags", () => scene.marks.forEach((mark) => this.tag(mark)));
    this.layer("anomalies", () => scene.reports.forEach((report) => this.warning(this.at(report), reportKey(report), 9)));
    if (scene.robot) this.robot(scene.robot);
    if (scene.aim) this.arrow(scene.aim, palette.warn);
  }

  private layer(name: string, paint: () => void): void {
    if (this.scene.hidden.has(name)) return;
    this.on.save();
    paint();
    this.on.restore();
  }

  private at(place: Point): Point {
    return toScreen(this.camera, this.size, place);
  }

  private isSeen({ x, y }: Point, margin = 40): boolean {
    return x > -margin && y > -margin && x < this.size.width + margin && y < this.size.height + margin;
  }

  /** Paint cells so that their corner (0, 0) is at its place and rows go up. */
  private picture(picture: HTMLCanvasElement, where: Pick<Grid, "x" | "y" | "yaw" | "resolution">): void {
    const { on, density, camera } = this;
    const corner = this.at(where);
    const cell = where.resolution * camera.scale * density;
    const [cos, sin] = [Math.cos(where.yaw) * cell, Math.sin(where.yaw) * cell];
    on.setTransform(cos, -sin, -sin, -cos, corner.x * density, corner.y * density);
    on.imageSmoothingEnabled = cell < 1;
    on.drawImage(picture, 0, 0);
  }

  private line(points: readonly Point[], close = false): void {
    this.on.beginPath();
    points.forEach(({ x, y }, index) => (index ? this.on.lineTo(x, y) : this.on.moveTo(x, y)));
    if (close) this.on.closePath();
  }

  /** Draw what was traced, with an edge in the colour of the floor so that it is seen on every ground. */
  private stroke(colour: string, width: number, dash: readonly number[] = []): void {
    const { on, palette } = this;
    on.setLineDash([]);
    [on.strokeStyle, on.lineWidth] = [palette["map-free"], width + 2];
    on.stroke();
    on.setLineDash([...dash]);
    [on.strokeStyle, on.lineWidth] = [colour, width];
    on.stroke();
    on.setLineDash([]);
  }

  private isMarked(key: string): boolean {
    return key === this.scene.selected || key === this.scene.hovered;
  }

  private box(tag: Tag): void {
    const corners = boxOf(tag).map((corner) => this.at(corner));
    if (!corners.some((corner) => this.isSeen(corner))) return;
    this.line(corners, true);
    this.stroke(this.palette.good, this.isMarked(`box:${tag.tag_id}`) ? 3 : 1.5);
  }

  private trail(): void {
    const { on, scene } = this;
    on.beginPath();
    scene.trail.forEach(({ at, value }, index) => {
      const { x, y } = this.at(value);
      const last = scene.trail[index - 1];
      const reach = last && JUMP.metres + (JUMP.speed * (at - last.at)) / 1000;
      const jumps = !last || Math.hypot(value.x - last.value.x, value.y - last.value.y) > reach!;
      if (jumps) on.moveTo(x, y);
      else on.lineTo(x, y);
    });
    this.stroke(this.palette.soft, 1.5);
  }

  private plan(): void {
    const { plan, palette } = { ...this.scene, palette: this.palette };
    const goal = plan?.at(-1);
    if (!plan || !goal) return;
    this.line(plan.map((place) => this.at(place)));
    this.stroke(palette.accent, 2.5, [7, 5]);
    this.arrow(goal, palette.accent);
  }

  /** A goal: a ring, and an arrow in the direction in which the robot is to stand. */
  private arrow(place: FloorPlace, colour: string): void {
    const { on } = this;
    const { x, y } = this.at(place);
    const [dx, dy] = [Math.cos(place.yaw), -Math.sin(place.yaw)];
    on.beginPath();
    on.arc(x, y, 8, 0, 2 * Math.PI);
    this.stroke(colour, 3);
    const tip = { x: x + 26 * dx, y: y + 26 * dy };
    this.line([{ x, y }, tip]);
    this.stroke(colour, 3);
    this.line([
      { x: tip.x - 8 * dx - 6 * dy, y: tip.y - 8 * dy + 6 * dx },
      tip,
      { x: tip.x - 8 * dx + 6 * dy, y: tip.y - 8 * dy - 6 * dx },
    ]);
    this.stroke(colour, 3);
  }

  private blooms(tag: Tag): void {
    const { on, palette } = this;
    tag.flowers.forEach(({ position, species, anomaly }, index) => {
      const { x, y } = this.at({ x: position.x ?? 0, y: position.y ?? 0 });
      if (!this.isSeen({ x, y })) return;
      on.beginPath();
      on.arc(x, y, this.isMarked(`bloom:${tag.tag_id}:${index}`) ? 6 : 4, 0, 2 * Math.PI);
      on.fillStyle = bloomColour(species);
      on.fill();
      [on.strokeStyle, on.lineWidth] = [palette.text, 1];
      on.stroke();
      if (!anomaly) return;
      on.beginPath();
      on.arc(x, y, 7, 0, 2 * Math.PI);
      this.stroke(palette.bad, 1.5, [3, 2]);
    });
  }

  private tag(mark: TagMark): void {
    const { on, scene, palette, camera } = this;
    const { tag, place, fresh } = mark;
    const { x, y } = this.at(place);
    if (!this.isSeen({ x, y })) return;
    const key = tagKey(tag.tag_id);
    const r = this.sign;
    this.ring(x, y, fresh);
    this.line([{ x, y: y - r }, { x: x + r, y }, { x, y: y + r }, { x: x - r, y }], true);
    const colour = this.tagColour(tag);
    on.fillStyle = colour || palette["map-free"];
    on.fill();
    [on.strokeStyle, on.lineWidth] = [palette.text, this.isMarked(key) ? 3 : 1.5];
    on.setLineDash(colour ? [] : [2, 2]);
    on.stroke();
    on.setLineDash([]);
    if (scene.picked?.includes(tag.tag_id)) this.word("✓", x, y + 4, palette.text, "center");
    if (key === scene.selected || tag.tag_id === scene.target) this.around(x, y, key === scene.selected);
    if (tag.anomaly && !scene.hidden.has("anomalies")) this.warning({ x: x + r + 2, y: y - r - 2 }, "", 6);
    if (camera.scale >= NAMES_FROM && !scene.hidden.has("names")) this.word(tag.tag_id, x + r + RING + 2, y + 4, palette.text);
  }

  /** The colour of a tag's value; "" where it has none. Of a twin that is silent all is grey. */
  private tagColour(tag: Tag): string {
    const { sensor, scale, twinSilent } = this.scene;
    if (twinSilent) return this.palette.line;
    if (!sensor) return this.palette.accent;
    const value = valueOf(tag, sensor);
    return value === undefined || !scale ? "" : css(rampAt(value, scale));
  }

  /** How fresh: a full ring is now, none is old. */
  private ring(x: number, y: number, fresh: number): void {
    if (fresh === 0) return;
    this.on.beginPath();
    this.on.arc(x, y, this.sign + RING, -Math.PI / 2, -Math.PI / 2 + (2 * Math.PI * fresh) / FRESHEST);
    this.stroke(this.scene.twinSilent ? this.palette.line : this.palette.good, 2);
  }

  /** What the mission works on has four corners around it, what is chosen a square. */
  private around(x: number, y: number, whole: boolean): void {
    const r = this.sign + RING + 4;
    this.on.beginPath();
    this.on.rect(x - r, y - r, 2 * r, 2 * r);
    this.stroke(whole ? this.palette.text : this.palette.warn, 2, whole ? [] : [r, r]);
  }

  private warning({ x, y }: Point, key: string, r: number): void {
    if (!this.isSeen({ x, y })) return;
    const { on, palette } = this;
    this.line([{ x, y: y - r }, { x: x + r, y: y + r * 0.8 }, { x: x - r, y: y + r * 0.8 }], true);
    on.fillStyle = palette["map-free"];
    on.fill();
    [on.strokeStyle, on.lineWidth] = [palette.bad, key && this.isMarked(key) ? 3 : 2];
    on.stroke();
    on.fillStyle = palette.bad;
    on.fillRect(x - 1, y - r * 0.4, 2, r * 0.6);
    on.fillRect(x - 1, y + r * 0.4, 2, 2);
  }

  private robot(place: FloorPlace): void {
    const { on, palette, scene } = this;
    const { x, y } = this.at(place);
    const colour = scene.robotSilent ? palette.line : palette.warn;
    const reach = Math.max(10, 0.15 * this.camera.scale);
    const corner = (angle: number, r: number): Point => ({
      x: x + r * Math.cos(place.yaw + angle),
      y: y - r * Math.sin(place.yaw + angle),
    });
    this.line([corner(0, reach), corner(2.5, reach), corner(Math.PI, reach * 0.4), corner(-2.5, reach)], true);
    this.stroke(palette.text, this.isMarked("robot") ? 3 : 1.5);
    on.fillStyle = colour;
    on.fill();
  }

  private word(text: string, x: number, y: number, colour: string, align: CanvasTextAlign = "left"): void {
    const { on, palette } = this;
    on.font = "600 12px system-ui, sans-serif";
    on.textAlign = align;
    [on.strokeStyle, on.lineWidth, on.lineJoin] = [palette["map-free"], 3, "round"];
    on.strokeText(text, x, y);
    on.fillStyle = colour;
    on.fillText(text, x, y);
  }
}

/** Paint a scene. `size` is in CSS pixels, of which each has `density` of the canvas. */
export function paint(on: Context, scene: Scene, camera: Camera, size: Size, density: number): void {
  new Painter(on, scene, camera, size, density).paint();
}

