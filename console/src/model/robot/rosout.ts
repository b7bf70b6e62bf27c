// What nodes log, from /rosout: warnings and worse.
import type { Time } from "../../ros";
import { gateway } from "../page";
import { topic } from "../topics";

interface LogMessage {
  readonly stamp: Time;
  readonly level: number;
  readonly name: string;
  readonly msg: string;
}

export interface LogLine {
  readonly node: string;
  readonly text: string;
  readonly severity: "warn" | "error";
}

/** Levels of rcl_interfaces/msg/Log. */
const WARN = 30;
const ERROR = 40;

/** Whether a logger is of this page's robot: all robots of a domain share the topic. */
function isOurs(logger: string): boolean {
  const robot = gateway.peek()?.robot;
  return !robot || logger.startsWith(`${robot.replaceAll("/", ".")}.`);
}

export const rosout = topic<LogMessage, LogLine>("/rosout", "rcl_interfaces/msg/Log", {
  keep: 500,
  always: true,
  when: ({ stamp }) => stamp.sec * 1000 + stamp.nanosec / 1e6 || undefined,
  read: ({ level, name, msg }) =>
    level < WARN || !isOurs(name) ? undefined : { node: name, text: msg, severity: level < ERROR ? "warn" : "error" },
});
