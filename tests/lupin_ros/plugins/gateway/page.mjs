// A page under test: real roslib, told what to do by lines of JSON. Usage: node page.mjs 1|2 ws://...
import { createInterface } from "node:readline";

const [version, url] = process.argv.slice(2);
const ROSLIB = version === "1" ? (await import("roslib-1")).default : await import("roslib");
const number = (value) => (typeof value === "bigint" ? String(value) : value);
const plain = (_, value) =>
  ArrayBuffer.isView(value) ? { typed: value.constructor.name, values: Array.from(value, number) } : value;
const say = (line) => process.stdout.write(JSON.stringify(line, plain) + "\n");

const ros = new ROSLIB.Ros({ url });
ros.on("error", (problem) => say({ event: "error", text: String(problem.message ?? problem) }));
ros.on("close", () => say({ event: "close" }));
ros.on("connection", () => {
  const socket = ros.socket ?? ros.transport.socket;
  socket.addEventListener("message", ({ data }) => {
    const frame = typeof data === "string" ? JSON.parse(data) : {};
    if (frame.op === "status") say({ event: "status", ...frame });
  });
  say({ event: "connection" });
});

const topics = new Map();
const topic = ({ name, type, options }) => {
  if (!topics.has(name)) topics.set(name, new ROSLIB.Topic({ ros, name, messageType: type, ...options }));
  return topics.get(name);
};
const goals = new Map();

const commands = {
  call: ({ n, name, type, args, timeout }) => {
    const answer = (ok) => (value) => say({ event: "answer", n, ok, value });
    new ROSLIB.Service({ ros, name, serviceType: type }).callService(args, answer(true), answer(false), timeout);
  },
  subscribe: (wanted) => topic(wanted).subscribe((msg) => say({ event: "message", topic: wanted.name, msg })),
  unsubscribe: (wanted) => topic(wanted).unsubscribe(),
  publish: (wanted) => topic(wanted).publish(wanted.msg),
  unadvertise: (wanted) => topic(wanted).unadvertise(),
  goal: ({ n, name, type, args }) => {
    const action = new ROSLIB.Action({ ros, name, actionType: type });
    const answer = (ok) => (value) => say({ event: "answer", n, ok, value });
    goals.set(n, [action, action.sendGoal(args, answer(true), (msg) => say({ event: "feedback", n, msg }), answer(false))]);
  },
  cancel: ({ n }) => goals.get(n)[0].cancelGoal(goals.get(n)[1]),
  raw: ({ frame }) => (ros.socket ?? ros.transport.socket).send(frame),
};
for await (const line of createInterface({ input: process.stdin })) {
  const wanted = JSON.parse(line);
  commands[wanted.do](wanted);
}
process.exit(0);
