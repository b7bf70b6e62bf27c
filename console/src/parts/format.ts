// How times, ages and numbers are written.
import { language, texts } from "../model/page";

/** Times of the day have 24 hours, and zones their letters. */
const LOCALES = { en: "en-GB", nl: "nl-NL" } as const;

function locale(): string {
  return LOCALES[language.value];
}

/** Formats by what they are made of: making one takes far longer than using it. */
const times = new Map<string, Intl.DateTimeFormat>();
const numbers = new Map<string, Intl.NumberFormat>();

function kept<T>(all: Map<string, T>, key: string, make: () => T): T {
  const found = all.get(key) ?? make();
  all.set(key, found);
  return found;
}

function time(at: number, timeStyle: "medium" | "long", dateStyle?: "medium"): string {
  const make = (): Intl.DateTimeFormat => new Intl.DateTimeFormat(locale(), { dateStyle, timeStyle });
  return kept(times, `${locale()} ${timeStyle} ${dateStyle}`, make).format(at);
}

/** A time of day with seconds, local: `03:12:07`. */
export function clockTime(at: number): string {
  return time(at, "medium");
}

/** The same with its zone: `03:12:07 CET`. */
export function timeWithZone(at: number): string {
  return time(at, "long");
}

/** A date and time with the zone: `23 Nov 2026, 03:12:07 CET`. */
export function dateTime(at: number): string {
  return time(at, "long", "medium");
}

/** A span of seconds: `4.2 s`, `1 min 05 s`, `2 h 10 min`. */
export function span(seconds: number): string {
  if (seconds < 10) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  const two = (number: number): string => String(Math.floor(number)).padStart(2, "0");
  if (minutes < 60) return `${minutes} min ${two(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min`;
}

export function ago(seconds: number): string {
  return texts.value.time.ago(span(seconds));
}

/** A number with at most so many digits after the point, and at least `least`; `–` where there is none. */
export function number(value: number | null | undefined, digits = 1, least = 0): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const how = { maximumFractionDigits: digits, minimumFractionDigits: least };
  return kept(numbers, `${language.value} ${digits} ${least}`, () => new Intl.NumberFormat(language.value, how)).format(value);
}
