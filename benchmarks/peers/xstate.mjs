// XState v5: an actor and its `send`, the event made once; a simulated clock for the timed chart.
// Answers the driver as worker.py does. Run: node --expose-gc xstate.mjs FOLDER_WITH_NODE_MODULES
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { createInterface } from "node:readline";

const FIRST_EVENTS = 6;
const BOUND = 1_000_000_000;
const GO = { type: "go" };

class Unsupported extends Error {}

let xstate;
let version;
try {
  // The package stands in the environment of the peers, not beside this file.
  const require = createRequire(join(process.argv[2], "package.json"));
  xstate = require("xstate");
  version = require("xstate/package.json").version;
} catch (problem) {
  console.log(JSON.stringify({ missing: problem.message.split("\n")[0] }));
  process.exit(0);
}
const { assign, createActor, createMachine, setup, SimulatedClock } = xstate;

const counting = {
  guards: { below: ({ context }) => context.count < BOUND, patient: ({ context }) => context.count >= 3 },
  actions: { add: assign({ count: ({ context }) => context.count + 1 }) },
};

function cycle(states, rule = (target) => ({ on: { go: target } })) {
  const following = (index) => states[(index + 1) % states.length];
  return {
    initial: states[0],
    states: Object.fromEntries(states.map((name, index) => [name, rule(following(index))])),
  };
}

const charts = {
  cycle: () => createMachine({ initial: "work", states: { work: cycle(["a", "b", "c"]) } }),
  guarded: () => {
    const rule = (target) => ({ on: { go: { target, guard: "below", actions: "add" } } });
    const work = cycle(["a", "b", "c"], rule);
    return setup(counting).createMachine({ initial: "work", context: { count: 0 }, states: { work } });
  },
  parallel: () => {
    const states = { left: cycle(["l1", "l2"]), right: cycle(["r1", "r2"]) };
    return createMachine({ initial: "both", states: { both: { type: "parallel", states } } });
  },
  timed: () => {
    const rule = (target) => ({ after: { 1000: target } });
    return createMachine({ initial: "work", states: { work: cycle(["ping", "pong"], rule) } });
  },
};

function leaves(value) {
  return typeof value === "string" ? [value.toLowerCase()] : Object.values(value).flatMap(leaves);
}

function reached(actor, count = null) {
  return { active: leaves(actor.getSnapshot().value).sort(), count };
}

function running(chart) {
  if (chart.startsWith("load-")) return load(chart);
  const clock = new SimulatedClock();
  const actor = createActor(charts[chart](), chart === "timed" ? { clock } : {}).start();
  if (chart === "timed") {
    const run = (number) => {
      for (let index = 0; index < number; index++) clock.increment(1000);
    };
    return { run, reached: () => reached(actor, Math.round(clock.now() / 1000)) };
  }
  const run = (number) => {
    for (let index = 0; index < number; index++) actor.send(GO);
  };
  return { run, reached: () => reached(actor, actor.getSnapshot().context?.count ?? null) };
}

// -- loading: the text of its JSON configuration, to an actor that runs ------------------------------------

function stateOf(state) {
  const rules = state.on.map((rule) => [
    rule.event,
    {
      target: `#${rule.target}`,
      ...(rule.guarded ? { guard: "patient" } : {}),
      ...(rule.counts ? { actions: "add" } : {}),
    },
  ]);
  return {
    id: state.name,
    ...(state.states.length ? { initial: state.states[0].name, states: statesOf(state.states) } : {}),
    ...(state.counts ? { entry: "add" } : {}),
    ...(rules.length ? { on: Object.fromEntries(rules) } : {}),
  };
}

function statesOf(states) {
  return Object.fromEntries(states.map((state) => [state.name, stateOf(state)]));
}

function countOf(states) {
  return states.reduce((sum, state) => sum + 1 + countOf(state.states), 0);
}

function load(chart) {
  const file = join(process.env.BENCHMARK_FOLDER, `tree-${chart.slice("load-".length)}.json`);
  const tree = JSON.parse(readFileSync(file, "utf-8"));
  const config = { id: "generated", initial: tree[0].name, context: { count: 0 }, states: statesOf(tree) };
  const text = JSON.stringify(config);
  let actor;
  const run = (number) => {
    for (let index = 0; index < number; index++) {
      actor = createActor(createMachine(JSON.parse(text), counting)).start();
    }
  };
  const look = () => {
    actor.send(GO);
    return reached(actor, countOf(tree));
  };
  return { run, reached: look };
}

// -- the requests -----------------------------------------------------------------------------------------

let bench;

const requests = {
  prepare({ chart }) {
    bench = running(chart);
    return {};
  },
  run({ number }) {
    const begun = process.hrtime.bigint();
    bench.run(number);
    return { seconds: Number(process.hrtime.bigint() - begun) / 1e9 };
  },
  reached() {
    return bench.reached();
  },
  weigh({ chart, number }) {
    if (!globalThis.gc) throw new Unsupported("needs --expose-gc");
    const machine = charts[chart]();
    const further = () => {
      const actor = createActor(machine).start();
      for (let index = 0; index < FIRST_EVENTS; index++) actor.send(GO);
      return actor;
    };
    const kept = new Array(number + 10);
    for (let index = 0; index < 10; index++) kept[index] = further();
    globalThis.gc();
    const before = process.memoryUsage().heapUsed;
    for (let index = 0; index < number; index++) kept[index + 10] = further();
    globalThis.gc();
    const grown = process.memoryUsage().heapUsed - before;
    return { bytes: Math.round(grown / number), kept: kept.length };
  },
};

function answer(request) {
  try {
    return requests[request.do](request);
  } catch (problem) {
    if (problem instanceof Unsupported) return { unsupported: problem.message };
    return { error: String(problem.message).split("\n")[0] };
  }
}

console.log(JSON.stringify({ version: `XState ${version} (actor.send), Node ${process.version}` }));
for await (const line of createInterface({ input: process.stdin })) {
  console.log(JSON.stringify(answer(JSON.parse(line))));
}
