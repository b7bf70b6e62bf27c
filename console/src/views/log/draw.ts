// Draws the timeline on a canvas: rows of spans, marks, gaps, and the moment that is shown.
import { computed } from "@preact/signals";
import type { Severity, Span } from "../../model/story/story";
import { colourOf } from "../../parts/colours";

/** A row of the timeline. */
export interface TimelineRow {
  readonly title: string;
  readonly spans: readonly Span[];
  readonly marks: readonly { readonly at: number; readonly severity: Severity }[];
}

/** What is drawn: rows from one time to another, in milliseconds since 1970. */
export interface Scene {
  readonly rows: readonly TimelineRow[];
  readonly gaps: readonly Span[];
  readonly from: number;
  readonly to: number;
  readonly now: number;
  readonly moment: number | null;
  /** How a time is written below the axis. */
  readonly label: (at: number) => string;
}

export const ROW_PX = 22;
export const AXIS_PX = 22;
/** Pixels between two labels of the axis, and those below which a span has no text. */
const LABEL_PX = 90;
const TEXT_PX = 26;
const STEPS_S = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400];
const MARKS = ["●", "▲", "✖"] as const;

interface Colours {
  readonly text: string;
  readonly line: string;
  readonly soft: string;
  readonly accent: string;
  readonly back: string;
  readonly tones: readonly { readonly fill: string; readonly text: string }[];
  readonly other: string;
  readonly otherText: string;
}

const colours = computed<Colours>(() => {
  const of = colourOf;
  const tones = ["info", "warn", "bad"].map((name) => ({ fill: of(`${name}-back`), text: of(name) }));
  return { text: of("text"), line: of("line"), soft: of("soft"), accent: of("accent"), back: of("back"), tones, other: of("line"), otherText: of("soft") };
});

/** The index of the first span that ends after a time. */
function firstAfter(spans: readonly Span[], from: number): number {
  let low = 0;
  let high = spans.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((spans[middle]!.to ?? Infinity) <= from) low = middle + 1;
    else high = middle;
  }
  return low;
}

class Painter {
  private readonly context: CanvasRenderingContext2D;
  private readonly width: number;
  private readonly height: number;
  private readonly colours: Colours;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly scene: Scene,
  ) {
    const ratio = devicePixelRatio || 1;
    this.width = canvas.clientWidth;
    this.height = canvas.clientHeight;
    const [width, height] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    this.context = canvas.getContext("2d")!;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.clearRect(0, 0, this.width, this.height);
    this.context.textBaseline = "middle";
    this.context.font = "12px system-ui, sans-serif";
    this.colours = colours.value;
  }

  paint(): void {
    const { rows, moment, now } = this.scene;
    this.axis();
    rows.forEach((row, index) => this.row(row, index * ROW_PX));
    for (const gap of this.scene.gaps) this.gap(gap);
    this.line(this.x(now), this.colours.soft, 1);
    if (moment !== null) this.line(this.x(moment), this.colours.accent, 3);
  }

  private x(at: number): number {
    const { from, to } = this.scene;
    return ((at - from) / (to - from)) * this.width;
  }

  private axis(): void {
    const { context, colours } = this;
    const { from, to, label } = this.scene;
    const wanted = ((to - from) / 1000 / this.width) * LABEL_PX;
    const step = 1000 * (STEPS_S.find((each) => each >= wanted) ?? 86400 * Math.ceil(wanted / 86400));
    const zone = new Date(from).getTimezoneOffset() * 60_000;
    const bottom = this.height - AXIS_PX;
    context.fillStyle = colours.soft;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.textAlign = "center";
    for (let at = Math.ceil((from - zone) / step) * step + zone; at <= to; at += step) {
      const x = Math.round(this.x(at)) + 0.5;
      context.beginPath();
      context.moveTo(x, 0);
      context.lineTo(x, bottom + 4);
      context.stroke();
      if (x > LABEL_PX / 3 && x < this.width - LABEL_PX / 3) context.fillText(label(at), x, bottom + 13);
    }
  }

  private row({ spans, marks }: TimelineRow, top: number): void {
    const { from, to, now } = this.scene;
    const { context } = this;
    context.textAlign = "left";
    let right = -1;
    for (let index = firstAfter(spans, from); index < spans.length; index++) {
      const span = spans[index]!;
      if (span.from > to) break;
      const left = Math.max(0, this.x(span.from));
      const end = Math.min(this.width, this.x(span.to ?? now));
      if (end - right < 1) continue;
      right = Math.max(end, left + 1);
      this.span(span, index, Math.round(left), Math.max(1, Math.round(right) - Math.round(left) - 1), top);
    }
    this.marks(marks, top);
  }

  private span({ severity, text }: Span, index: number, left: number, width: number, top: number): void {
    const { context, colours } = this;
    const tone = colours.tones[severity]!;
    context.fillStyle = severity === 0 && index % 2 ? colours.other : tone.fill;
    context.fillRect(left, top + 2, width, ROW_PX - 4);
    const bar = severity > 0 ? 4 : 2;
    context.fillStyle = severity === 0 && index % 2 ? colours.otherText : tone.text;
    context.fillRect(left, top + ROW_PX - 2 - bar, width, bar);
    if (width < TEXT_PX) return;
    context.save();
    context.beginPath();
    context.rect(left, top, width - 2, ROW_PX);
    context.clip();
    context.fillStyle = colours.text;
    context.fillText(severity > 0 ? `${MARKS[severity]} ${text}` : text, left + 4, top + ROW_PX / 2 + 1);
    context.restore();
  }

  /** The worst of those that fall together is drawn. */
  private marks(marks: TimelineRow["marks"], top: number): void {
    const { from, to } = this.scene;
    const worst = new Map<number, Severity>();
    for (const { at, severity } of marks) {
      if (at < from || at > to) continue;
      const place = Math.round(this.x(at) / 8) * 8;
      if (severity >= (worst.get(place) ?? 0)) worst.set(place, severity);
    }
    this.context.textAlign = "center";
    for (const [x, severity] of worst) {
      this.context.fillStyle = this.colours.tones[severity]!.text;
      this.context.fillText(MARKS[severity], x, top + ROW_PX / 2 + 1);
    }
  }

  /** A gap is hatched, whatever stands there. */
  private gap({ from, to }: Span): void {
    const { context, colours } = this;
    const left = Math.max(0, this.x(from));
    const right = Math.min(this.width, Math.max(this.x(to ?? this.scene.now), left + 2));
    if (right <= 0 || left >= this.width) return;
    const bottom = this.height - AXIS_PX;
    context.save();
    context.beginPath();
    context.rect(left, 0, right - left, bottom);
    context.clip();
    context.fillStyle = colours.back;
    context.fillRect(left, 0, right - left, bottom);
    context.strokeStyle = colours.soft;
    context.lineWidth = 1;
    for (let x = left - bottom; x < right; x += 8) {
      context.beginPath();
      context.moveTo(x, bottom);
      context.lineTo(x + bottom, 0);
      context.stroke();
    }
    context.restore();
  }

  private line(x: number, colour: string, width: number): void {
    if (x < 0 || x > this.width) return;
    this.context.fillStyle = colour;
    this.context.fillRect(x - width / 2, 0, width, this.height - AXIS_PX);
  }
}

export function drawTimeline(canvas: HTMLCanvasElement, scene: Scene): void {
  new Painter(canvas, scene).paint();
}
