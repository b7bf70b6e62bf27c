// Colours of the map: a scale that people read who see few colours (dark blue over green to yellow), and the theme's.
import { computed } from "@preact/signals";
import { colourOf } from "../../parts/colours";

type Rgb = readonly [number, number, number];

/** From the lowest value to the highest; each is lighter than the one before. */
const STOPS: readonly Rgb[] = [
  [68, 1, 84],
  [62, 74, 137],
  [38, 130, 142],
  [53, 183, 121],
  [160, 218, 57],
  [253, 231, 37],
];
const STEPS = 256;

/** The colour of each of 256 equal parts of a scale. */
export const RAMP: readonly Rgb[] = Array.from({ length: STEPS }, (_, index) => {
  const place = (index / (STEPS - 1)) * (STOPS.length - 1);
  const begin = Math.min(Math.floor(place), STOPS.length - 2);
  const mix = (channel: 0 | 1 | 2): number => {
    const [a, b] = [STOPS[begin]![channel], STOPS[begin + 1]![channel]];
    return Math.round(a + (b - a) * (place - begin));
  };
  return [mix(0), mix(1), mix(2)];
});

/** What the ends of a colour scale stand for. */
export interface Scale {
  readonly low: number;
  readonly high: number;
}

/** A scale from the lowest value to the highest; it spans 1 % at least, so that noise is not painted as a difference. */
export function scaleOf(lowest: number, highest: number): Scale {
  const middle = (lowest + highest) / 2;
  const half = Math.max(highest - lowest, Math.abs(middle) * 0.01, 1e-9) / 2;
  return { low: middle - half, high: middle + half };
}

/** The colour of a value; one beyond an end has the colour of that end. */
export function rampAt(value: number, { low, high }: Scale): Rgb {
  const index = Math.floor(((value - low) / (high - low)) * STEPS);
  return RAMP[Math.min(STEPS - 1, Math.max(0, index))]!;
}

export function css([red, green, blue]: Rgb): string {
  return `rgb(${red} ${green} ${blue})`;
}

/** The scale as a picture for a legend. */
export const GRADIENT = `linear-gradient(to right, ${STOPS.map(css).join(", ")})`;

const SPECIES: readonly (readonly [string, string])[] = [
  ["red", "#c1121f"],
  ["white", "#ffffff"],
  ["pink", "#f28cb8"],
];

/** A bloom has the colour that its species is named after, else grey. */
export function bloomColour(species: string): string {
  return SPECIES.find(([word]) => species.includes(word))?.[1] ?? "#8a949c";
}

const NAMES = ["back", "card", "line", "text", "soft", "accent", "good", "warn", "bad"] as const;
const CELL_NAMES = ["map-unknown", "map-free", "map-between", "map-occupied"] as const;
export type Palette = Readonly<Record<(typeof NAMES)[number] | (typeof CELL_NAMES)[number], string>>;

/** The colours of the theme, as CSS writes them. */
export const palette = computed<Palette>(() => {
  const entries = [...NAMES, ...CELL_NAMES].map((name) => [name, colourOf(name)]);
  return Object.fromEntries(entries) as Palette;
});

/** A colour of the theme as numbers. */
export function rgbOf(colour: string): Rgb {
  const digits = Number.parseInt(colour.slice(1), 16);
  return [digits >> 16, (digits >> 8) & 255, digits & 255];
}
