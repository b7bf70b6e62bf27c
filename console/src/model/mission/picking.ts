// Picking things elsewhere for a field of a form: the form says which field is filled, the map and the table of
// tags show that and toggle. Ids are those of /twin/state, such as "12".
import { signal } from "@preact/signals";

/** The field that is filled by picking. */
export interface Picking {
  readonly mission: string;
  readonly field: string;
}

/** The field that is being picked for; undefined: nothing is. */
export const picking = signal<Picking | undefined>(undefined);
/** What is picked, in the order in which it was. */
export const picked = signal<readonly string[]>([]);

/** Pick for a field from now on, beginning with what it has already. */
export function startPicking(field: Picking, already: readonly string[]): void {
  picked.value = already;
  picking.value = field;
}

/** Take a thing in or out; nothing happens while nothing is being picked. */
export function toggle(id: string): void {
  if (!picking.value) return;
  picked.value = picked.value.includes(id) ? picked.value.filter((each) => each !== id) : [...picked.value, id];
}

export function endPicking(): void {
  picking.value = undefined;
}
