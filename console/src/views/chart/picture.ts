// The SVG of the engine as elements of this page: only what a drawing needs is taken over, whatever was sent.
import { around } from "./names";

const SVG = "http://www.w3.org/2000/svg";

/** What a drawing is made of. Nothing else comes into the page: no script, no link, no style, no event. */
const ELEMENTS = new Set(["g", "rect", "path", "circle", "text"]);
const ATTRIBUTES = new Set([
  ...["data-state", "data-transition", "x", "y", "width", "height", "rx", "cx", "cy", "r", "d", "transform", "opacity"],
  ...["fill", "stroke", "stroke-width", "stroke-dasharray", "font-size", "font-weight", "textLength", "lengthAdjust"],
]);
/** Numbers, colours, paths and words; no address. */
const HARMLESS = /^[\w\s#.,%()+-]*$/;

export interface Box {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** A drawing in the page, and where in it everything is. */
export class Picture {
  readonly states = new Map<string, SVGGElement>();
  readonly transitions = new Map<string, SVGElement[]>();
  /** What this page draws over it. */
  readonly over: SVGGElement;
  readonly width: number;
  readonly height: number;

  private constructor(readonly svg: SVGSVGElement, scene: SVGElement) {
    this.width = svg.viewBox.baseVal.width;
    this.height = svg.viewBox.baseVal.height;
    this.over = make("g", { class: "over" });
    scene.append(this.over);
    for (const group of svg.querySelectorAll<SVGGElement>("g[data-state]"))
      this.states.set(group.dataset["state"]!, group);
    for (const found of svg.querySelectorAll<SVGElement>("[data-transition]")) {
      for (const id of found.dataset["transition"]!.split(" "))
        this.transitions.set(id, [...(this.transitions.get(id) ?? []), found]);
      widen(found);
    }
  }

  /** Read a drawing; fails with what is wrong with it. */
  static read(text: string): Picture {
    const root = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    const [, , width, height] = (root.getAttribute("viewBox") ?? "").split(" ").map(Number);
    if (root.localName !== "svg" || !width || !height) throw new Error("it is no SVG with a size");
    const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
    svg.append(...cleaned(root));
    const scene = [...svg.children].find((each): each is SVGElement => each.localName === "g");
    return new Picture(svg, scene ?? svg);
  }

  /** The state that stands for one in this picture: itself, or the innermost folded one around it. */
  standsFor(name: string): string | undefined {
    for (let found = name; found; found = around(found)) if (this.states.has(found)) return found;
    return undefined;
  }

  /** Where the box of a state is, in units of the drawing's scene. */
  box(name: string): Box | undefined {
    const group = this.states.get(name);
    const shape = group?.querySelector(":scope > g > rect");
    if (!shape) return group?.getBBox();
    const [x, y, width, height] = ["x", "y", "width", "height"].map((each) => Number(shape.getAttribute(each)));
    return { x: x!, y: y!, width: width!, height: height! };
  }

  /** Where what folds a state is drawn: in the corner of its box; a region has none, so behind its name.
   *  What unfolds it lies on the lower edge, because a folded box has just room for its name. */
  handle(name: string, isFolded: boolean): readonly [number, number] | undefined {
    const parts = this.states.get(name)?.firstElementChild;
    const rect = parts?.querySelector(":scope > rect");
    const text = parts?.querySelector(":scope > text");
    const number = (from: Element, key: string): number => Number(from.getAttribute(key));
    if (rect && isFolded) return [number(rect, "x") + number(rect, "width") - 14, number(rect, "y") + number(rect, "height")];
    if (rect) return [number(rect, "x") + number(rect, "width") - 14, number(rect, "y") + 17];
    if (text) return [number(text, "x") + number(text, "textLength") + 16, number(text, "y") - 4];
    return undefined;
  }
}

export function make<K extends keyof SVGElementTagNameMap>(
  name: K,
  attributes: Readonly<Record<string, string | number>> = {},
): SVGElementTagNameMap[K] {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}

function cleaned(from: Element): SVGElement[] {
  return [...from.children].flatMap((element) => {
    if (element.namespaceURI !== SVG || !ELEMENTS.has(element.localName)) return [];
    const made = make(element.localName as "g");
    for (const { name, value } of element.attributes)
      if (ATTRIBUTES.has(name) && (name.startsWith("data-") || HARMLESS.test(value))) made.setAttribute(name, value);
    if (element.localName === "text") made.textContent = element.textContent;
    else made.append(...cleaned(element));
    return [made];
  });
}

/** Give an arrow a wide invisible line, so that a finger meets it. */
function widen(group: SVGElement): void {
  const line = group.querySelector(":scope > path[fill=none]");
  if (line) group.append(make("path", { d: line.getAttribute("d")!, class: "reach" }));
}
