// One connection to the gateway by the rosbridge protocol: subscriptions come back after a break, calls end in time.
import { batch, signal } from "@preact/signals";
import { addressOf, baseOf } from "./address";

/** Whether the gateway is heard. `lost`: it was, and is being looked for. */
export type LinkState = "connecting" | "open" | "lost";

/** What a call came to that has no answer; the text says of what and why. */
export class CallFailed extends Error {}

/** How a goal of an action ended: a status of `GoalStatus`, and the result of its server. */
export interface GoalEnd<Result> {
  readonly status: number;
  readonly result: Result;
}

/** A goal that this page has sent. The gateway cancels it when the page goes. */
export interface SentGoal<Result> {
  /** Fails with `CallFailed` when the goal was refused, or when its end is unknown. */
  readonly end: Promise<GoalEnd<Result>>;
  /** Ask the server to end it; nothing happens where it has ended. */
  readonly cancel: () => void;
}

interface Subscription {
  readonly topic: string;
  readonly type: string;
  readonly throttle: number;
  readonly heard: (message: unknown, at?: number) => void;
}

interface Waiting {
  readonly done: (values: unknown) => void;
  readonly failed: (problem: CallFailed) => void;
  /** A goal has none: it may take as long as it likes. */
  readonly timer?: number;
}

interface Frame {
  op?: string;
  id?: string;
  topic?: string;
  msg?: unknown;
  /** When the message was, in milliseconds since 1970, where the clock is not a real one. */
  at?: number;
  values?: unknown;
  result?: boolean;
  status?: number;
  level?: string;
}

/** Milliseconds between two tries to connect: the first, and the longest. */
const FIRST_TRY_MS = 250;
const LONGEST_TRY_MS = 5000;
/** Seconds that a call may take unless it says otherwise; the gateway has limits of its own. */
const CALL_S = 6;
/** How often it is looked at whether the gateway is heard, and after how much silence it is asked for a sign of life. */
const LOOK_EVERY_MS = 500;
const ASK_AFTER_MS = 500;
/** When no answer has come after so long the connection is dead: 3 s without news, as STOP's own connection has it. */
const DEAD_AFTER_MS = 2500;
/** A connection that does not come about for so long is tried anew. */
const CONNECT_WITHIN_MS = 5000;

let asks = false;

/** Go and log in where the gateway answers and lets this page in no more. It takes its time with who is not let in. */
async function logInAnew(): Promise<void> {
  if (asks) return;
  asks = true;
  const asked = { headers: { accept: "text/html" }, redirect: "manual", cache: "no-store" } as const;
  const answer = await fetch(`${baseOf(location)}/`, asked).catch(() => undefined);
  asks = false;
  if (answer?.type === "opaqueredirect") location.assign(`${baseOf(location)}/login`);
}

export class Link {
  readonly state = signal<LinkState>("connecting");
  /** What the gateway had to say about something that it did not do, newest last. */
  readonly complaints = signal<readonly string[]>([]);
  /** What is called each time that the gateway is heard on a connection for the first time. */
  readonly opened: (() => void)[] = [];
  /** When something was heard last before the link was lost, by this page's steady clock; undefined while it is not. */
  readonly silentSince = signal<number | undefined>(undefined);

  /** When something was heard last; since when a connection is tried, and since when a sign of life is asked for. */
  private heardAt = 0;
  private triedAt = 0;
  private askedAt: number | undefined;
  private socket: WebSocket | undefined;
  private isLetIn = false;
  private tryAfter = FIRST_TRY_MS;
  private count = 0;
  private readonly subscriptions = new Map<string, Subscription>();
  private readonly waiting = new Map<string, Waiting>();

  constructor(private readonly address: string) {}

  /** Connect, and go on connecting for ever. */
  start(): void {
    this.connect();
    setInterval(() => this.look(), LOOK_EVERY_MS);
    addEventListener("online", () => this.look());
    document.addEventListener("visibilitychange", () => this.look());
  }

  /** Hear a topic; returns what ends that. `throttle`: at least so many milliseconds lie between two messages. */
  subscribe<T>(topic: string, type: string, heard: (message: T, at?: number) => void, throttle = 0): () => void {
    const id = `s${++this.count}`;
    const subscription: Subscription = { topic, type, throttle, heard: heard as Subscription["heard"] };
    this.subscriptions.set(id, subscription);
    this.sendSubscription(id, subscription);
    return () => {
      if (this.subscriptions.delete(id)) this.send({ op: "unsubscribe", id, topic });
    };
  }

  /** Call a service; fails with `CallFailed` when there is no link, no answer in time, or a refusal of the gateway. */
  call<Answer>(service: string, args: object = {}, seconds = CALL_S): Promise<Answer> {
    return new Promise((done, failed) => {
      const id = `c${++this.count}`;
      if (!this.send({ op: "call_service", id, service, args, timeout: seconds })) {
        failed(new CallFailed(`${service}: there is no connection to the gateway`));
        return;
      }
      const late = (): void => {
        this.waiting.delete(id);
        failed(new CallFailed(`${service}: no answer within ${seconds} s`));
      };
      const timer = window.setTimeout(late, seconds * 1000 + 500);
      this.waiting.set(id, { done: done as (values: unknown) => void, failed, timer });
    });
  }

  /** Send a goal to an action server; undefined where there is no link. */
  sendGoal<Result>(action: string, type: string, args: object): SentGoal<Result> | undefined {
    const id = `g${++this.count}`;
    if (!this.send({ op: "send_action_goal", id, action, action_type: type, args })) return undefined;
    const end = new Promise<GoalEnd<Result>>((done, failed) => {
      this.waiting.set(id, { done: done as (values: unknown) => void, failed });
    });
    const cancel = (): void => {
      if (this.waiting.has(id)) this.send({ op: "cancel_action_goal", id, action });
    };
    return { end, cancel };
  }

  private connect(): void {
    const socket = new WebSocket(this.address);
    this.socket = socket;
    this.triedAt = performance.now();
    this.isLetIn = false;
    socket.onopen = () => {
      if (this.socket !== socket) return;
      this.isLetIn = true;
      for (const [id, subscription] of this.subscriptions) this.sendSubscription(id, subscription);
      this.ask();
    };
    socket.onmessage = ({ data }) => {
      if (this.socket !== socket) return;
      this.heard();
      this.receive(JSON.parse(data as string) as Frame);
    };
    socket.onclose = () => {
      if (this.socket === socket) this.lose();
    };
  }

  /** Leave the connection at once, whether or not the other side agrees, and look for another one. */
  private lose(): void {
    const left = this.socket;
    this.socket = undefined;
    if (!this.isLetIn) void logInAnew();
    left?.close();
    if (this.state.value === "open")
      batch(() => {
        this.state.value = "lost";
        this.silentSince.value = this.heardAt;
      });
    this.failAll();
    setTimeout(() => this.socket ?? this.connect(), this.tryAfter);
    this.tryAfter = Math.min(2 * this.tryAfter, LONGEST_TRY_MS);
  }

  private heard(): void {
    this.heardAt = performance.now();
    this.askedAt = undefined;
    if (this.state.peek() === "open") return;
    this.tryAfter = FIRST_TRY_MS;
    batch(() => {
      this.state.value = "open";
      this.silentSince.value = undefined;
    });
    for (const tell of this.opened) tell();
  }

  private ask(): void {
    this.askedAt = performance.now();
    this.call("/rosapi/get_time").catch(() => undefined);
  }

  /** Find out whether the connection lives: the browser may not know for minutes that it does not. */
  private look(): void {
    const now = performance.now();
    if (this.socket?.readyState === WebSocket.CONNECTING) {
      if (now - this.triedAt > CONNECT_WITHIN_MS) this.lose();
    } else if (this.socket?.readyState !== WebSocket.OPEN) return;
    else if (this.askedAt !== undefined) {
      if (now - this.askedAt > DEAD_AFTER_MS) this.lose();
    } else if (now - this.heardAt > ASK_AFTER_MS) this.ask();
  }

  private receive(frame: Frame): void {
    if (frame.op === "publish") {
      for (const subscription of [...this.subscriptions.values()])
        if (subscription.topic === frame.topic) subscription.heard(frame.msg, frame.at);
    } else if (frame.op === "service_response") {
      this.settle(frame, frame.values);
    } else if (frame.op === "action_result") {
      this.settle(frame, { status: frame.status, result: frame.values });
    } else if (frame.op === "status" && typeof frame.msg === "string") {
      this.complaints.value = [...this.complaints.value.slice(-49), frame.msg];
    }
  }

  /** Give what came of a call or a goal to who waits for it. */
  private settle({ id = "", result, values }: Frame, found: unknown): void {
    const waiting = this.waiting.get(id);
    if (!waiting) return;
    this.waiting.delete(id);
    clearTimeout(waiting.timer);
    if (result) waiting.done(found);
    else waiting.failed(new CallFailed(String(values)));
  }

  private failAll(): void {
    for (const { failed, timer } of this.waiting.values()) {
      clearTimeout(timer);
      failed(new CallFailed("the connection to the gateway was lost; whether it was done is not known"));
    }
    this.waiting.clear();
  }

  private sendSubscription(id: string, { topic, type, throttle }: Subscription): void {
    this.send({ op: "subscribe", id, topic, type, throttle_rate: throttle });
  }

  private send(frame: object): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(frame));
    return true;
  }
}

export const link = new Link(addressOf(location));
