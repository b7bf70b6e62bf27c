// What was known when: a list in the order of time, from which every view is shown at any moment.
import { computed, signal, type ReadonlySignal } from "@preact/signals";

/** A value and when it was so, in milliseconds since 1970 by the robot's clock. */
export interface Known<T> {
  readonly at: number;
  readonly value: T;
}

export class Past<T> {
  private readonly list: Known<T>[] = [];
  private readonly changes = signal(0);

  /** `most`: the oldest are forgotten beyond so many. */
  constructor(private readonly most: number) {}

  /** Add a value; one that is older than the last is put in its place. */
  add(at: number, value: T): void {
    const place = this.place(at);
    this.list.splice(place, 0, { at, value });
    if (this.list.length > this.most) this.list.splice(0, this.list.length - this.most);
    this.changes.value++;
  }

  /** Add many at once, such as a history. */
  addAll(known: readonly Known<T>[]): void {
    this.list.push(...known);
    this.list.sort((one, other) => one.at - other.at);
    if (this.list.length > this.most) this.list.splice(0, this.list.length - this.most);
    this.changes.value++;
  }

  clear(): void {
    this.list.length = 0;
    this.changes.value++;
  }

  /** What was known last at a moment; the newest for `null`. Reading it in a component follows it. */
  at(moment: number | null): Known<T> | undefined {
    void this.changes.value;
    return moment === null ? this.list.at(-1) : this.list[this.place(moment) - 1];
  }

  /** All that was known from one moment to another, both included. */
  between(from: number, to: number): readonly Known<T>[] {
    void this.changes.value;
    return this.list.slice(this.place(from - 0.001), this.place(to));
  }

  /** All up to a moment; all for `null`. */
  until(moment: number | null): readonly Known<T>[] {
    void this.changes.value;
    return moment === null ? this.list.slice() : this.list.slice(0, this.place(moment));
  }

  /** Where the first value lies that is later than `at`. */
  private place(at: number): number {
    let low = 0;
    let high = this.list.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.list[middle]!.at <= at) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/** The moment that is shown; `null` is now. All views follow it. */
export const moment = signal<number | null>(null);

/** What was known at the moment that is shown. */
export function shown<T>(past: Past<T>): ReadonlySignal<Known<T> | undefined> {
  return computed(() => past.at(moment.value));
}
