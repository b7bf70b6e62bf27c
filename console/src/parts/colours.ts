// Colours of the style sheets, for what is drawn by hand.
import { signal } from "@preact/signals";
import { theme } from "../model/page";

const dark = matchMedia("(prefers-color-scheme: dark)");
const isDarkHere = signal(dark.matches);
dark.addEventListener("change", () => (isDarkHere.value = dark.matches));

/** A colour of the theme that is shown: of `light-dark(…, …)` the one that counts. Reading it in a component follows it. */
export function colourOf(name: string): string {
  const isDark = theme.value === "dark" || (theme.value === "auto" && isDarkHere.value);
  const told = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const both = /^light-dark\((.+),\s*(.+)\)$/.exec(told);
  return both ? both[isDark ? 2 : 1]! : told;
}
