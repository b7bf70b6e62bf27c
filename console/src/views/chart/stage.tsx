// The drawing and what lies over it: one can move around in it, fold states, and choose one or an arrow.
import { computed, effect, untracked, useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { robotNow, shownNow } from "../../model/time/clock";
import { isFault, steps, view } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { moment } from "../../model/time/past";
import { Camera } from "./camera";
import { drawing, folded, inner, reveal, toggle } from "./folds";
import { Marks } from "./marks";
import { around, choose } from "./names";
import { Outline } from "./outline";
import { Picture } from "./picture";
import type { ChartRecord } from "../../records";

/** Earlier steps that are looked through for how long a clock has been running. */
const LOOK_BACK = 500;
/** Pixels that a key moves the drawing by, and how much it changes its scale. */
const STEP_PX = 60;
const ZOOM = 1.25;

export function Stage(props: { chart: ChartRecord; chosen: string }) {
  const t = texts.value.chart;
  const stage = useRef<HTMLDivElement>(null);
  const paper = useRef<HTMLDivElement>(null);
  const camera = useRef<Camera>();
  const drawn = useSignal<{ picture: Picture; marks: Marks; names: ReadonlySet<string> } | undefined>(undefined);
  const reverted = useRef(false);
  const anchor = useRef<string>();
  const cursor = useSignal("");
  const problem = useSignal("");
  const unusable = useSignal("");
  const drawingNow = useSignal(false);
  const following = useSignal(true);
  const element = useSignal(props.chosen);
  const isFirst = useRef(true);
  element.value = props.chosen;

  useEffect(() => {
    camera.current = new Camera(stage.current!, paper.current!, () => (following.value = false));
  }, []);

  // Another drawing when something is folded or unfolded; the last one is seen until it is there.
  useSignalEffect(() => {
    const names = folded.value;
    const whole = props.chart;
    let outdated = false;
    drawingNow.value = true;
    drawing(whole, names)
      .then((svg) => {
        if (outdated) return;
        const picture = Picture.read(svg);
        camera.current!.show(picture, anchor.current);
        drawn.value = { picture, names, marks: new Marks(picture, inner(whole), names) };
        if (!reverted.current) problem.value = "";
        reverted.current = false;
      })
      .catch((wrong: unknown) => {
        const told = wrong instanceof Error ? wrong.message : String(wrong);
        if (outdated) return;
        const last = drawn.peek();
        if (last) {
          problem.value = told;
          reverted.current = true;
          folded.value = last.names;
        } else if (names.size) folded.value = new Set();
        else unusable.value = told;
      })
      .finally(() => {
        if (!outdated) drawingNow.value = false;
      });
    return () => (outdated = true);
  });

  // What happens, drawn as it comes: nothing of the page is rendered for it.
  useSignalEffect(() => {
    const { picture, marks } = drawn.value ?? {};
    if (!picture || !marks) return;
    return effect(() => {
      const known = steps.shown.value;
      const earlier = untracked(() => steps.past.until(known?.at ?? 0).slice(-LOOK_BACK - 1, -1).reverse());
      marks.show(known, earlier.map(({ value }) => value).filter(({ boot }) => boot === known?.value.boot));
      marks.tick(known ? passedSince(known.at) : 0);
      if (!following.peek() || element.peek()) return;
      const active = known?.value.view.configuration.at(-1);
      const name = active && picture.standsFor(active);
      const box = name && picture.box(name);
      if (box && isFirst.current) camera.current!.centre(box);
      else if (box) camera.current!.follow(box);
      isFirst.current &&= !box;
    });
  });
  useSignalEffect(() => {
    const at = steps.shown.peek()?.at;
    void shownNow.value;
    if (at !== undefined) drawn.value?.marks.tick(passedSince(at));
  });

  // What was chosen is unfolded, marked and brought into the middle.
  useSignalEffect(() => {
    const { picture, marks } = drawn.value ?? {};
    const name = element.value;
    const state = props.chart.transitions[name]?.state ?? name;
    untracked(() => reveal(state));
    if (!picture || !marks) return;
    marks.select(name);
    const arrow = picture.transitions.get(name)?.[0] as SVGGraphicsElement | undefined;
    const box = arrow?.getBBox() ?? (state ? picture.box(picture.standsFor(state) ?? "") : undefined);
    if (box && name && !isSeen.has(name)) camera.current!.centre(box);
    isSeen.clear();
  });
  useSignalEffect(() => drawn.value?.marks.point(cursor.value || undefined));

  const fold = (name: string): void => {
    anchor.current = name;
    toggle(name);
  };

  const click = (event: MouseEvent): void => {
    const found = (event.target as Element).closest<SVGElement>("[data-fold], [data-transition], [data-state]");
    const { fold: folds, transition, state } = found?.dataset ?? {};
    if (folds) fold(folds);
    else if (transition) choose(nextOf(transition.split(" "), element.peek()));
    else if (state) {
      isSeen.add(state);
      choose(state);
    }
  };

  const key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== stage.current) return;
    const look = camera.current!;
    const names = [...(drawn.peek()?.picture.states.keys() ?? [])];
    const moves: Record<string, () => unknown> = {
      "+": () => look.zoom(ZOOM),
      "-": () => look.zoom(1 / ZOOM),
      "0": () => look.fit(0),
      Enter: () => cursor.value && choose(cursor.value),
      " ": () => cursor.value && inner(props.chart).has(cursor.value) && fold(cursor.value),
      Escape: () => choose(""),
      ArrowLeft: () => (event.shiftKey ? look.pan(STEP_PX, 0) : go(beside(names, cursor.value, -1))),
      ArrowRight: () => (event.shiftKey ? look.pan(-STEP_PX, 0) : go(beside(names, cursor.value, 1))),
      ArrowUp: () => (event.shiftKey ? look.pan(0, STEP_PX) : go(around(cursor.value) || cursor.value)),
      ArrowDown: () => (event.shiftKey ? look.pan(0, -STEP_PX) : go(names.find((name) => around(name) === cursor.value))),
    };
    const move = moves[event.key];
    if (!move) return;
    event.preventDefault();
    move();
  };
  const go = (name: string | undefined): void => {
    if (!name) return;
    cursor.value = name;
    const box = drawn.peek()?.picture.box(name);
    if (box) camera.current!.follow(box);
  };

  if (unusable.value) {
    return (
      <>
        <p class="note warn" role="alert">
          {t.notDrawn} {unusable.value}
        </p>
        <Outline chart={props.chart} />
      </>
    );
  }
  return (
    <>
      {problem.value && (
        <p class="note warn" role="alert">
          {problem.value}
        </p>
      )}
      <div class="stage-frame">
        <div
          class={`stage ${moment.value === null ? "" : "past"} ${isFault(view.value?.lifecycle ?? "") ? "fault" : ""}`}
          ref={stage}
          tabIndex={0}
          role="application"
          aria-label={t.drawing}
          aria-describedby="chart-keys"
          onClick={click}
          onKeyDown={key}
        >
          <div class="paper" ref={paper} />
        </div>
        {!drawn.value && (
          <div class="undrawn">
            <p class="soft">{t.notDrawnYet}</p>
            <Outline chart={props.chart} />
          </div>
        )}
        <Veil />
        <div class="row stage-tools" role="toolbar" aria-label={t.tools}>
          <button aria-label={t.closer} onClick={() => camera.current!.zoom(ZOOM)}>+</button>
          <button aria-label={t.farther} onClick={() => camera.current!.zoom(1 / ZOOM)}>−</button>
          <button onClick={() => camera.current!.fit(0)}>{t.fit}</button>
          <button aria-pressed={following.value} onClick={() => (following.value = !following.value)}>
            {t.follow}
          </button>
        </div>
      </div>
      <p id="chart-keys" class="soft keys">{t.keys}</p>
      <p class="hidden" role="status">
        {drawingNow.value ? t.drawingNow : cursor.value}
      </p>
    </>
  );
}

/** Seconds from a step to the moment that is shown. */
function passedSince(at: number): number {
  return Math.max(0, ((moment.peek() ?? robotNow()) - at) / 1000);
}

/** States that were chosen by a click on them: they are in view already. */
const isSeen = new Set<string>();

/** Of several transitions that share an arrow the one after that which is chosen. */
function nextOf(ids: readonly string[], now: string): string {
  return ids[(ids.indexOf(now) + 1) % ids.length] ?? "";
}

/** The next state within the same one, in the order of the file; the first one where there is no cursor yet. */
function beside(names: readonly string[], now: string, by: number): string | undefined {
  if (!now) return names[0];
  const row = names.filter((name) => around(name) === around(now));
  return row[(row.indexOf(now) + by + row.length) % row.length];
}

/** Why everything stands still; '' while it does not. */
const heldFor = computed(() => view.value?.held.map((name) => view.value?.holds[name] || name).join(", ") ?? "");

/** A hold stops everything: it lies over the drawing, and says why. */
function Veil() {
  const t = texts.value.chart;
  if (!heldFor.value) return null;
  return (
    <div class="veil" role="status">
      <p>
        <span aria-hidden="true">❚❚ </span>
        {t.held} {heldFor.value}
      </p>
    </div>
  );
}
