// The names of states: those within a state begin with its name and a point.
import { open } from "../../model/page";

/** The state around one, by its full name; "" for those at the top. */
export function around(name: string): string {
  return name.slice(0, Math.max(0, name.lastIndexOf(".")));
}

export const shortName = (name: string): string => name.slice(name.lastIndexOf(".") + 1);

/** Look at a state, by its full name, or at a transition, by its id; at nothing for "". */
export const choose = (element: string): void => open(element ? `chart/${encodeURIComponent(element)}` : "chart");
