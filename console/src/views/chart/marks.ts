// What happens, drawn over the picture: states that are active, the last transition, time that runs down, retries.
import type { Known } from "../../model/time/past";
import { span } from "../../parts/format";
import { around } from "./names";
import { make, type Picture } from "./picture";
import type { StepRecord, View } from "../../records";

/** Radius of a ring, seconds that the trace of a transition takes to fade, and how wide it is at first and at last. */
const RADIUS = 10;
const TRACE_S = 6;
const WIDE = 7;
const NARROW = 2.4;

/** Time that runs down in a state: `left` seconds at the moment of the step, of `whole`; it may stand still. */
export interface Clock {
  readonly state: string;
  readonly what: string;
  readonly left: number;
  readonly whole: number;
  readonly stopped: boolean;
}

interface Ring {
  readonly clock: Clock;
  readonly arc: SVGElement;
  readonly text: SVGElement;
}

/** All clocks of a step, by what was told since each began. `before` are earlier steps, the newest first. */
export function clocks(record: StepRecord, before: readonly StepRecord[]): Clock[] {
  const { view, time } = record;
  const found: Clock[] = [];
  for (const { state, event, deadline, left } of view.countdowns ?? []) {
    const now = left ?? deadline! - time;
    found.push({ state, what: event, left: now, whole: longest(state, event, now, before), stopped: deadline === null });
  }
  for (const { state, operation, deadline, limit } of view.attempts)
    if (deadline !== null)
      found.push({ state, what: operation, left: deadline - time, whole: limit ?? deadline - time, stopped: false });
  for (const { state, question, deadline, left } of view.asking) {
    const now = left ?? deadline! - time;
    found.push({ state, what: question, left: now, whole: longest(state, undefined, now, before), stopped: deadline === null });
  }
  return found;
}

/** The most time that a clock was known to have left, since it has been running without a break. */
function longest(state: string, event: string | undefined, now: number, before: readonly StepRecord[]): number {
  let most = now;
  for (const { view, time } of before) {
    const clock =
      event === undefined
        ? view.asking.find((asked) => asked.state === state)
        : view.countdowns?.find((each) => each.state === state && each.event === event);
    if (!clock) break;
    const left = clock.left ?? clock.deadline! - time;
    // A clock that began anew, such as that of an `every`, had less to go just before.
    if (left < now - 0.5) break;
    most = Math.max(most, left);
  }
  return most;
}

export class Marks {
  private rings: Ring[] = [];
  /** What was taken lately, and when. It fades with the seconds: an animation would paint every frame anew. */
  private readonly traced = new Map<Element, number>();
  private tracedStep = "";
  private shownAt = 0;
  private lit = new Set<string>();
  private innermost = new Set<string>();
  private selected: Element[] = [];
  private cursor: Element | undefined;
  private readonly layer = make("g");

  constructor(private readonly picture: Picture, inner: ReadonlySet<string>, folded: ReadonlySet<string>) {
    for (const name of inner) this.handle(name, folded.has(name));
    picture.over.append(this.layer);
  }

  /** Show a step: what is active, what was just taken, and what runs. */
  show(known: Known<StepRecord> | undefined, before: readonly StepRecord[]): void {
    const record = known?.value;
    const active = (record?.view.configuration ?? []).filter(Boolean);
    const parents = new Set(active.map(around));
    this.light(active, active.filter((name) => !parents.has(name)));
    if (known) this.trace(known);
    this.layer.replaceChildren();
    this.rings = [];
    if (!record) return;
    const taken = new Map<string, number>();
    for (const clock of clocks(record, before)) this.ring(clock, taken);
    this.retries(record.view);
  }

  /** Turn the rings on, and let the traces fade; `passed` seconds since the step. */
  tick(passed: number): void {
    for (const [element, at] of this.traced) {
      const age = passed + (this.shownAt - at) / 1000;
      const isLast = at === this.shownAt || element.classList.contains("last");
      if (age < TRACE_S || isLast) {
        const width = NARROW + (WIDE - NARROW) * Math.max(0, 1 - age / TRACE_S);
        (element as SVGElement).style.setProperty("--trace-width", `${width.toFixed(1)}px`);
      } else this.untrace(element);
    }
    for (const { clock, arc, text } of this.rings) {
      const left = Math.max(0, clock.left - (clock.stopped ? 0 : passed));
      arc.setAttribute("stroke-dashoffset", String(1 - Math.min(1, left / Math.max(clock.whole, 0.001))));
      const told = left < 99.5 ? String(Math.ceil(left)) : left < 5970 ? `${Math.round(left / 60)}m` : `${Math.round(left / 3600)}h`;
      if (text.textContent !== told) text.textContent = told;
    }
  }

  /** Mark the state or the transition that is looked at. */
  select(element: string): void {
    for (const each of this.selected) each.classList.remove("selected");
    const state = this.picture.states.get(element);
    this.selected = state ? [state] : [...(this.picture.transitions.get(element) ?? [])];
    for (const each of this.selected) each.classList.add("selected");
  }

  /** Mark where the keyboard is. */
  point(state: string | undefined): void {
    this.cursor?.classList.remove("cursor");
    this.cursor = state === undefined ? undefined : this.picture.states.get(state);
    this.cursor?.classList.add("cursor");
  }

  private light(active: readonly string[], innermost: readonly string[]): void {
    const shown = (names: readonly string[]): Set<string> =>
      new Set(names.map((name) => this.picture.standsFor(name)).filter((name) => name !== undefined));
    const [lit, inside] = [shown(active), shown(innermost)];
    for (const [now, next, mark] of [[this.lit, lit, "active"], [this.innermost, inside, "innermost"]] as const) {
      for (const name of now) if (!next.has(name)) this.picture.states.get(name)?.classList.remove(mark);
      for (const name of next) if (!now.has(name)) this.picture.states.get(name)?.classList.add(mark);
    }
    this.lit = lit;
    this.innermost = inside;
  }

  private trace({ at, value: { boot, step } }: Known<StepRecord>): void {
    // Back in the past nothing of what is later has happened.
    for (const [element, taken] of this.traced) if (taken > at) this.untrace(element);
    this.shownAt = at;
    const name = `${boot} ${step.sequence}`;
    if (name === this.tracedStep || !step.taken?.length) return;
    this.tracedStep = name;
    for (const element of this.traced.keys()) element.classList.remove("last");
    for (const element of step.taken.flatMap((id) => this.picture.transitions.get(id) ?? [])) {
      element.classList.add("traced", "last");
      this.traced.set(element, at);
    }
  }

  private untrace(element: Element): void {
    element.classList.remove("traced", "last");
    this.traced.delete(element);
  }

  private ring(clock: Clock, taken: Map<string, number>): void {
    const name = this.picture.standsFor(clock.state);
    const box = name === undefined ? undefined : this.picture.box(name);
    if (!box || name === undefined) return;
    const place = taken.get(name) ?? 0;
    taken.set(name, place + 1);
    const at = `translate(${box.x + box.width - 16 - place * 25} ${box.y})`;
    const group = make("g", { transform: at, class: clock.stopped ? "ring stopped" : "ring" });
    const title = make("title");
    title.textContent = `${clock.what}: ${span(clock.whole)}`;
    const arc = make("circle", { r: RADIUS, class: "arc", pathLength: 1, "stroke-dasharray": 1, transform: "rotate(-90)" });
    const text = make("text", { y: 3, "text-anchor": "middle", "font-size": 8.5, "font-weight": 600 });
    group.append(title, make("circle", { r: RADIUS, class: "track" }), arc, text);
    this.layer.append(group);
    this.rings.push({ clock, arc, text });
  }

  private retries(view: View): void {
    for (const { state, tries } of view.attempts) {
      const name = this.picture.standsFor(state);
      const box = tries > 1 && name !== undefined ? this.picture.box(name) : undefined;
      if (!box) continue;
      const group = make("g", { class: "retry", transform: `translate(${box.x + 22} ${box.y + box.height})` });
      const text = make("text", { y: 3.5, "text-anchor": "middle", "font-size": 10, "font-weight": 600 });
      text.textContent = `↻ ${tries}`;
      group.append(make("rect", { x: -18, y: -9, width: 36, height: 18, rx: 9 }), text);
      this.layer.append(group);
    }
  }

  /** Draw what folds a state in place; on a folded one what unfolds it. */
  private handle(name: string, isFolded: boolean): void {
    const place = this.picture.handle(name, isFolded);
    if (!place) return;
    const group = make("g", { class: "fold", transform: `translate(${place[0]} ${place[1]})` });
    group.dataset["fold"] = name;
    const sign = isFolded ? "M-4 0H4M0 -4V4" : "M-4 0H4";
    group.append(make("circle", { r: 12, class: "reach" }), make("circle", { r: 7.5 }), make("path", { d: sign }));
    this.picture.over.append(group);
  }
}
