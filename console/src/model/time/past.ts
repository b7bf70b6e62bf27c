// What was known when: a list in the order of time, from which every view is shown at any moment.
import { computed, signal, type ReadonlySignal } from "@preact/signals";

/** A value and when it was so, in milliseconds since 1970 by the robot's clock. */
export interface Known<T> {
  readonly at: number;
  readonly value: T;
}

/** How a past is kept. */
interface Keeping<T> {
  /** Whether two values are one: the later of two neighbours is not kept, nor one of the same time. */
  same?(one: T, other: T): boolean;
  /** What may be forgotten before all else. */
  minor?(value: T): boolean;
}

/** A past as it stands: `list` goes on growing at its end as long as `edition` is the same. */
export interface Standing<T> {
  readonly list: readonly Known<T>[];
  readonly edition: number;
}

/** Whether a page keeps so much more than it needs to show what is now: while somebody looks at what was. */
export const wholePast = signal(true);
const WHOLE = 10;

export class Past<T> {
  /** Whether something was forgotten that the gateway may still have. */
  readonly forgot = signal(false);
  private list: Known<T>[] = [];
  private edition = 0;
  private readonly changes = signal(0);

  /** `most`: the oldest are forgotten beyond so many, and some more at once; ten times as many while the whole past is kept. */
  constructor(
    private readonly most: number,
    private readonly keeping: Keeping<T> = {},
  ) {}

  /** Add a value; one that is older than the last is put in its place. */
  add(at: number, value: T): void {
    this.addAll([{ at, value }]);
  }

  /** Add many at once, such as a history. */
  addAll(known: readonly Known<T>[]): void {
    const sorted = known.every(({ at }, index) => !index || known[index - 1]!.at <= at);
    const added = sorted ? known : [...known].sort((one, other) => one.at - other.at);
    const before = this.list.length;
    if (!added.length) return;
    if (before && this.list[before - 1]!.at > added[0]!.at) this.merge(added);
    else for (const each of added) this.append(each);
    this.forget();
    this.changes.value = this.changes.peek() + 1;
  }

  clear(): void {
    this.list = [];
    this.edition++;
    this.forgot.value = false;
    this.changes.value = this.changes.peek() + 1;
  }

  /** What was known last at a moment; the newest for `null`. Reading it in a component follows it. */
  at(moment: number | null): Known<T> | undefined {
    void this.changes.value;
    return moment === null ? this.list.at(-1) : this.list[this.place(moment) - 1];
  }

  /** What comes first after a moment. */
  after(moment: number): Known<T> | undefined {
    void this.changes.value;
    return this.list[this.place(moment)];
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

  /** All of it, not copied: for who reads on where he stopped. */
  standing(): Standing<T> {
    void this.changes.value;
    return { list: this.list, edition: this.edition };
  }

  /** Forget at once what is beyond the bound as it is now. */
  trim(): void {
    const { edition } = this;
    this.forget();
    if (this.edition !== edition) this.changes.value = this.changes.peek() + 1;
  }

  /** Put values between those that are there; both are in the order of time. */
  private merge(added: readonly Known<T>[]): void {
    const kept = this.list;
    const first = this.place(added[0]!.at);
    const rest = kept.splice(first);
    this.edition++;
    let next = 0;
    for (const each of added) {
      while (next < rest.length && rest[next]!.at <= each.at) this.append(rest[next++]!);
      this.append(each);
    }
    while (next < rest.length) this.append(rest[next++]!);
  }

  private append(known: Known<T>): void {
    const { keeping } = this;
    for (let index = this.list.length - 1; keeping.same && index >= 0; index--) {
      const before = this.list[index]!;
      if (keeping.same(before.value, known.value)) return;
      if (before.at < known.at) break;
    }
    this.list.push(known);
  }

  /** Forget so much at once that it is seldom done: of the older half what is minor, then the oldest. */
  private forget(): void {
    const { keeping } = this;
    const most = this.most * (wholePast.peek() ? WHOLE : 1);
    if (this.list.length <= most * 1.1) return;
    this.edition++;
    this.forgot.value ||= !wholePast.peek();
    if (keeping.minor) {
      const half = this.list.length / 2;
      this.list = this.list.filter(({ value }, index) => index >= half || !keeping.minor!(value));
    }
    if (this.list.length > most) this.list = this.list.slice(-most);
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

/** What was known at the moment that is shown; `lag`: so many milliseconds after something it was told. */
export function shown<T>(past: Past<T>, lag = 0): ReadonlySignal<Known<T> | undefined> {
  return computed(() => past.at(moment.value === null ? null : moment.value + lag));
}
