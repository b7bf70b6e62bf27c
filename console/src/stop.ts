// The software stop: a button of its own, with a connection of its own, which works when the rest of the page does not.
//
// One press stops, when the button goes down; the button is never anywhere else. Releasing is another button, apart from
// it, which is there only while this page is stopped and has to be held: the finger that stops cannot release.
// The stop is told at once and then steadily; what this page said last is remembered, so that a page that is loaded anew is
// still stopped. Whether the connection lives is asked all the time: one that is dead is found out, and made anew.
import { addressOf, baseOf } from "./wire/address";
import type { StopsRecord } from "./records";

const TOPIC = "/lupin/hmi/estop";
const STOPS = "/lupin/hmi/stops";
const RESET = "/lupin/hmi/reset_stop";
const ASKED = "/rosapi/get_time";
const ALIVE = "alive";
const TELL_EVERY_MS = 500;
const TRY_EVERY_MS = 1000;
/** A connection on which something was asked so long ago, without any answer, is dead. */
const DEAD_AFTER_MS = 3000;
/** One that does not come about for so long is tried anew. */
const CONNECT_WITHIN_MS = 5000;
/** For so long a button is held that releases a stop. */
const HOLD_MS = 1000;
/** Of each robot for itself: a page that goes on to another robot does not stop that one. */
const REMEMBERED = `lupin.stopped${baseOf(location)}`;

type Stops = Pick<StopsRecord, "stopped" | "stops">;

const WORDS = {
  en: {
    stop: "STOP",
    release: "Hold to release my stop",
    here: "Stop pressed: not confirmed yet",
    by: (names: string) => `Stopped by ${names}`,
    reset: (name: string) => `Hold to reset ${name}`,
    unreachable: "Not connected: use the button on the robot",
    recording: "A recording: there is no robot here",
  },
  nl: {
    stop: "STOP",
    release: "Vasthouden: mijn stop opheffen",
    here: "Stop ingedrukt: nog niet bevestigd",
    by: (names: string) => `Gestopt door ${names}`,
    reset: (name: string) => `Vasthouden: ${name} opheffen`,
    unreachable: "Niet verbonden: gebruik de knop op de robot",
    recording: "Een opname: hier is geen robot",
  },
};

const box = document.getElementById("stop-box")!;
const button = document.getElementById("stop") as HTMLButtonElement;
const release = document.getElementById("release") as HTMLButtonElement;
const told = document.getElementById("stop-state")!;
const others = document.getElementById("stop-others")!;

const NONE: Stops = { stopped: false, stops: [] };
let stopped = remembered() === "1";
let socket: WebSocket | undefined;
let triedAt = 0;
/** Whether anything was heard on this connection: only then it counts as one. */
let isHeard = false;
let stops = NONE;
let problem = "";
/** Since when an answer is awaited. */
let askedAt: number | undefined;

/** What this page said last; a browser that keeps nothing keeps nobody from stopping. */
function remembered(now?: string): string | null {
  try {
    if (now !== undefined) sessionStorage.setItem(REMEMBERED, now);
    return sessionStorage.getItem(REMEMBERED);
  } catch {
    return null;
  }
}

const isTried = (): boolean => socket?.readyState === WebSocket.CONNECTING;
const isOpen = (): boolean => socket?.readyState === WebSocket.OPEN;

function send(frame: object): void {
  if (isOpen()) socket!.send(JSON.stringify(frame));
}

function tell(): void {
  send({ op: "publish", topic: TOPIC, type: "std_msgs/msg/Bool", msg: { data: stopped } });
}

function set(to: boolean): void {
  letGo();
  stopped = to;
  problem = "";
  tell(); // before all else
  remembered(to ? "1" : "0");
  show();
}

/** Whose stop this is; nothing where there is no other robot. */
function robot(): string {
  return baseOf(location).split("/")[2] ?? document.documentElement.dataset["robot"] ?? "";
}

function show(): void {
  const words = document.documentElement.lang === "nl" ? WORDS.nl : WORDS.en;
  const isRecording = document.documentElement.dataset["mode"] === "recording";
  const names = stops.stops.map(({ name }) => name);
  button.textContent = `${words.stop} ${robot()}`.trim();
  button.setAttribute("aria-pressed", String(stopped));
  release.textContent = words.release;
  release.hidden = !stopped;
  box.dataset["state"] = !isHeard ? "away" : stopped || stops.stopped ? "stopped" : "free";
  const by = names.length ? words.by(names.join(", ")) : "";
  button.disabled = isRecording;
  const says = isRecording ? words.recording : problem || (isHeard ? by || (stopped ? words.here : "") : words.unreachable);
  told.textContent = robot() && says ? `${robot()}: ${says}` : says;
  showOthers(
    stops.stops.filter((each) => each.left || !stopped).map((each) => each.name),
    words.reset,
  );
}

/** The buttons for the stops of others; one that is there stays, for it may be held just now. */
function showOthers(names: readonly string[], label: (name: string) => string): void {
  const known = new Map([...others.children].map((each) => [(each as HTMLElement).dataset["name"], each as HTMLButtonElement]));
  for (const [name, reset] of known) if (!names.includes(name!)) reset.remove();
  for (const name of names) {
    const reset = known.get(name) ?? others.appendChild(document.createElement("button"));
    if (!known.has(name)) whenHeld(reset, () => send({ op: "call_service", id: `reset ${name}`, service: RESET, args: { name } }));
    reset.dataset["name"] = name;
    reset.textContent = label(name);
  }
}

/** What is held just now, by a finger or a key, until it has been held long enough. */
let held: { readonly button: HTMLButtonElement; readonly timer: number } | undefined;

function letGo(): void {
  if (!held) return;
  clearTimeout(held.timer);
  delete held.button.dataset["held"];
  held = undefined;
}

function hold(button: HTMLButtonElement, act: () => void): void {
  letGo();
  button.dataset["held"] = "";
  held = {
    button,
    timer: setTimeout(() => {
      letGo();
      act();
    }, HOLD_MS),
  };
}

/** A button that acts when it was held by one finger, which stayed on it, or by Enter or Space; a click does nothing. */
function whenHeld(button: HTMLButtonElement, act: () => void): void {
  button.addEventListener("pointerdown", (event) => {
    if (!event.isPrimary || event.button) return;
    button.releasePointerCapture(event.pointerId); // so that a finger that slides off has left
    hold(button, act);
  });
  for (const end of ["pointerup", "pointerleave", "pointercancel", "keyup", "blur"]) button.addEventListener(end, letGo);
  button.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    if (!event.repeat) hold(button, act);
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault()); // that of a finger that rests
}

function receive(data: string): void {
  askedAt = undefined;
  isHeard = true;
  const frame = JSON.parse(data) as { op?: string; id?: string; msg?: unknown; values?: unknown; result?: boolean; level?: string };
  if (frame.id === ALIVE && box.dataset["state"] !== "away") return; // nothing to be shown anew
  if (frame.op === "publish") stops = JSON.parse((frame.msg as { data: string }).data) as Stops;
  else if (frame.op === "service_response") problem = answerOf(frame.result, frame.values);
  else if (frame.op === "status" && frame.level === "error") problem = String(frame.msg);
  show();
}

function answerOf(result: boolean | undefined, values: unknown): string {
  if (!result) return String(values);
  const { success, message } = values as { success: boolean; message: string };
  return success ? "" : message;
}

function connect(): void {
  const own = new WebSocket(addressOf(location));
  socket = own;
  triedAt = performance.now();
  own.onopen = () => {
    if (stopped) tell();
    send({ op: "subscribe", topic: STOPS, type: "std_msgs/msg/String" });
    show();
  };
  own.onmessage = ({ data }) => {
    if (socket === own) receive(data as string);
  };
  own.onclose = () => {
    if (socket !== own) return;
    setTimeout(connect, TRY_EVERY_MS);
    gone();
  };
}

function gone(): void {
  stops = NONE;
  isHeard = false;
  askedAt = undefined;
  show();
}

/** Find out whether the connection lives: after a sleep the browser may not know that it does not. */
function ask(): void {
  const now = performance.now();
  if (isOpen() ? askedAt !== undefined && now - askedAt > DEAD_AFTER_MS : isTried() && now - triedAt > CONNECT_WITHIN_MS) {
    const dead = socket!;
    connect();
    dead.close();
    gone();
  } else if (isOpen() && askedAt === undefined) {
    askedAt = now;
    send({ op: "call_service", id: ALIVE, service: ASKED, args: {} });
  }
}

for (const press of ["pointerdown", "click"]) button.addEventListener(press, () => set(true));
whenHeld(release, () => set(false));
addEventListener("pointerdown", letGo, { capture: true }); // another finger comes: nobody is holding deliberately
addEventListener(
  "keydown",
  (event) => {
    if (event.key !== "Escape" || !event.shiftKey) return;
    event.preventDefault(); // browsers have a use of their own for these keys
    set(true);
  },
  { capture: true },
);
new MutationObserver(show).observe(document.documentElement, { attributeFilter: ["lang", "data-mode", "data-robot"] });
document.addEventListener("visibilitychange", letGo);
setInterval(() => {
  if (stopped) tell();
  ask();
}, TELL_EVERY_MS);
for (const back of ["online", "pageshow"]) addEventListener(back, ask);
for (const back of ["resume", "visibilitychange"]) document.addEventListener(back, ask);
connect();
show();
