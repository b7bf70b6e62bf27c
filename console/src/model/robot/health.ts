// How nodes and machines are, as every node tells it of itself on /diagnostics, and the battery.
import { MSG_TYPES, type BatteryState, type DiagnosticArray } from "../../ros";
import { link } from "../../wire/link";
import { topic } from "../topics";

export interface NodeHealth {
  readonly name: string;
  readonly machine: string;
  readonly level: number;
  readonly message: string;
  /** When it told this, in the robot's milliseconds. */
  readonly at: number;
  /** What it told, by name and unit: `memory (MB)`. */
  readonly values: Readonly<Record<string, string>>;
  /** Messages a second, by topic. */
  readonly rates: readonly (readonly [topic: string, rate: number])[];
}

export type Nodes = ReadonlyMap<string, NodeHealth>;

/** The level of a node that has ended as it should, and of one that wants something. */
export const ENDED = 3;
export const WARNED = 1;
/** Seconds of silence after which a node, which tells something once a second, is not heard any more. */
export const NODE_SILENT_S = 3;
/** Milliseconds between two states that are kept. */
const KEPT_EVERY_MS = 5000;
const RATE = / \(Hz\)$/;
/** The name of a trouble of a node, `/NODE: SUBJECT`: the node's own message has it, too. */
const TROUBLE = /^\/.*: /;

const nodes = new Map<string, NodeHealth>();
let keptAt = 0;
/** All nodes as they are now; nobody is told of a change, because it is shown once a second. */
export const nodesNow: Nodes = nodes;

function take({ status }: DiagnosticArray, at: number): Nodes | undefined {
  for (const { level, name, message, hardware_id: machine, values } of status) {
    if (TROUBLE.test(name)) continue;
    const told = values.filter(({ key }) => !key.startsWith("/"));
    const rates = values.filter(({ key }) => key.startsWith("/") && RATE.test(key));
    nodes.set(name, {
      name,
      machine,
      level,
      message,
      at,
      values: Object.fromEntries(told.map(({ key, value }) => [key, value])),
      rates: rates.map(({ key, value }) => [key.replace(RATE, ""), Number(value)] as const),
    });
  }
  if (Math.abs(at - keptAt) < KEPT_EVERY_MS) return undefined;
  keptAt = at;
  return new Map(nodes);
}

/** All nodes at a moment of the past. */
export const diagnostics = topic<DiagnosticArray, Nodes>("/diagnostics", MSG_TYPES.DiagnosticArray, {
  keep: 360,
  always: true,
  read: take,
});

export interface Battery {
  /** From 0 to 1; undefined where it is not told. */
  readonly charge: number | undefined;
  readonly voltage: number | undefined;
}

export const battery = topic<BatteryState, Battery>("/io/power/power_watcher", MSG_TYPES.BatteryState, {
  keep: 2000,
  throttle: 1000,
  always: true,
  read: ({ percentage, voltage }) => ({
    // Some drivers tell percent.
    charge: percentage === null ? undefined : percentage > 1 ? percentage / 100 : percentage,
    voltage: voltage ?? undefined,
  }),
  same: (one, other) => one.charge === other.charge && one.voltage === other.voltage,
});

/** Names of all nodes on the network, also of those that tell nothing of themselves. */
export async function nodesOnNetwork(): Promise<readonly string[]> {
  return (await link.call<{ nodes: readonly string[] }>("/rosapi/nodes")).nodes;
}
