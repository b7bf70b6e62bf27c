// Made by tools/records.py from the classes of the engine. Do not edit it: make it anew.
//
// Records as they are published in JSON. A field with `?` may be left out: it is empty then, or the record is
// of an earlier version, because recordings are kept for long.

/**
 * A step with its times, the orchestrator's session id (`boot`), the chart's hash, and the view after it.
 *
 * `time` is of the clock of the deadlines in `view`, `stamp` of the network's, `wall_ns` of the wall's.
 */
export interface StepRecord {
  readonly time: number;
  readonly stamp: number;
  readonly wall_ns: number;
  readonly boot: string;
  readonly chart: string;
  readonly step: Step;
  readonly view: View;
  readonly command?: CommandOrigin;
}

/** The dry run of each request after step `sequence` of an orchestrator's session (`boot`). */
export interface PublishedPossible {
  readonly boot: string;
  readonly chart: string;
  readonly sequence: number;
  readonly requests: readonly PossibleRecord[];
}

/**
 * The mission catalogue.
 *
 * `codes` are all, `holds` the code of each hold, also of the engine's own, `outcomes` the ends of a visit,
 * `stages` the meaning of published states, `ends` the verb that ends a mission. `problems` are the errors
 * in files that were not loaded.
 */
export interface MissionsRecord {
  readonly missions: readonly OfferedMission[];
  readonly problems: readonly string[];
  readonly codes: Readonly<Record<string, CodeRecord>>;
  readonly holds: Readonly<Record<string, string>>;
  readonly outcomes: readonly OutcomeRecord[];
  readonly stages: Stages;
  readonly ends: string;
}

/** A chart as an orchestrator publishes it; `boot` names its start. */
export interface ChartRecord {
  readonly svg: string;
  readonly problem?: string;
  readonly hash: string;
  readonly missions: readonly string[];
  readonly states: Readonly<Record<string, StateRecord>>;
  readonly transitions: Readonly<Record<string, TransitionRecord>>;
  readonly files: Readonly<Record<string, string>>;
  readonly boot: string;
}

/** A dry run of a state's transitions, or of one transition: then `active` is always false. */
export interface ExplanationRecord {
  readonly element: string;
  readonly sequence: number;
  readonly active: boolean;
  readonly rules: readonly RuleRecord[];
}

/**
 * The state of a simulation, and the available controls and faults.
 *
 * `at` is in milliseconds since 1970, `time` in seconds since its beginning, `clock` the robot's wall clock
 * as text. `speed` is a factor of real time, None: as fast as possible; `next` the time of the next event.
 */
export interface SimulationRecord {
  readonly boot: string;
  readonly running: boolean;
  readonly speed: number | null;
  readonly until: string;
  readonly note: string;
  readonly next: number | null;
  readonly operations: readonly OperationRecord[];
  readonly silent: readonly string[];
  readonly values: readonly InputRecord[];
  readonly events: readonly EventRecord[];
  readonly at: number;
  readonly time: number;
  readonly clock: string;
}

/** The engaged stops of pages, and the operators' link: `lost` once the reaction to it was decided. */
export interface StopsRecord {
  readonly stopped: boolean;
  readonly stops: readonly StopRecord[];
  readonly operators: number;
  readonly link: "up" | "lost" | "none";
  readonly on_link_lost: "continue" | "pause" | "stop";
}

/**
 * Who may move the robot: the page that has taken the base, and why no page may.
 *
 * `stops` are the sources that hold it: `robot`, `pages`, `hmi`.
 */
export interface BaseRecord {
  readonly taken_by: string;
  readonly hindrance: "" | "stop" | "mission" | "held";
  readonly reason: string;
  readonly stops: readonly string[];
}

/** Who is connected, and how often they commanded something. */
export interface PeopleRecord {
  readonly people: readonly PersonRecord[];
  readonly commands: number;
}

/** All that people are to know of, the oldest first. */
export interface NotificationsRecord {
  readonly notifications: readonly Notification[];
}

/**
 * What a robot does, for a list of them: the mission's state, what stops it, and its open questions.
 *
 * `stops` are names of pages, and sources of other stops. Not `heard`: its orchestrator is silent.
 */
export interface RobotRecord {
  readonly robot: string;
  readonly heard: boolean;
  readonly lifecycle: string;
  readonly mission: string;
  readonly target: string;
  readonly paused: boolean;
  readonly stops: readonly string[];
  readonly questions: readonly string[];
}

/**
 * One macrostep, as it is logged.
 *
 * `sequence` counts from 1, `time` is the caller's. `taken` are the ids of the transitions, `exited` and
 * `entered` full names of states, all in their order; `configuration` are the active states afterwards, in
 * document order. `accepted` is the answer to a request (None for every other event), `refusal` the reason
 * against it. `notes` name dropped, deferred and blocked events with the reason. `why` are the transitions
 * that listen to the event, when none was taken. `trail` is the published state after each microstep, the
 * last one being now. `codes` are those that were reported, in their order, `broken` the invariants that
 * broke in this step, also those that hold again after it.
 */
export interface Step {
  readonly sequence: number;
  readonly time: number;
  readonly event: string;
  readonly configuration: readonly string[];
  readonly taken?: readonly string[];
  readonly exited?: readonly string[];
  readonly entered?: readonly string[];
  readonly commands?: readonly (Start | Cancel | Act | Publish | Report)[];
  readonly notes?: readonly string[];
  readonly accepted?: boolean;
  readonly refusal?: Refusal;
  readonly why?: readonly string[];
  readonly codes?: readonly CodeEvent[];
  readonly broken?: readonly string[];
  readonly data?: Readonly<Record<string, unknown>>;
}

/**
 * The machine at one moment. `lifecycle` is the published top state, `phase` the innermost phase.
 *
 * `total` and `counts` are about all itineraries of the mission: the number of targets, and the number of
 * visits that ended in each of the profile's outcomes, over all sweeps. `cancelling` are abandoned
 * operations whose end the server has not confirmed. `code` and `detail` are the newest of the worst
 * reported codes, `codes` counts all reports. `paused`: held, or in a state that waits for the operator.
 */
export interface View {
  readonly configuration: readonly string[];
  readonly lifecycle: string;
  readonly phase: string;
  readonly mission: string;
  readonly mission_id: string;
  readonly started_at: number | null;
  readonly target: string;
  readonly total: number;
  readonly code: string;
  readonly detail: string;
  readonly codes: number;
  readonly asking: readonly Question[];
  readonly held: readonly string[];
  readonly paused: boolean;
  readonly attempts: readonly Attempting[];
  readonly cancelling: readonly string[];
  readonly dropped: number;
  readonly countdowns?: readonly Countdown[];
  readonly holds: Readonly<Record<string, string>>;
  /** How many visits ended in each outcome, under the names that the profile has. */
  readonly [other: string]: unknown;
}

/** Who commanded a step and by which id, if known. */
export interface CommandOrigin {
  readonly by?: string;
  readonly command_id?: string;
}

/**
 * The dry run of one request: the holds that it engages and releases, or why it is refused.
 *
 * `code` and `reason` of a possible one say that its effect waits until a state is left.
 *
 * `fields`: a start is refused only because of its request's defaults, so other fields may be accepted.
 */
export interface PossibleRecord {
  readonly request: string;
  readonly verb: string;
  readonly mission: string;
  readonly possible: boolean;
  readonly engages: readonly string[];
  readonly releases: readonly string[];
  readonly code: string;
  readonly reason: string;
  readonly fields?: boolean;
}

/** A mission that can be started, its file's name, and the fields of its request. */
export interface OfferedMission {
  readonly mission: string;
  readonly file: string;
  readonly summary: string;
  readonly request: readonly FieldRecord[];
}

/** The declaration of a code; severity 0 is information, 1 a warning, 2 an error. */
export interface CodeRecord {
  readonly label: string;
  readonly severity: number;
  readonly advice: string;
}

/** A way in which a visit can end; views have how many did under the name `counter`. */
export interface OutcomeRecord {
  readonly name: string;
  readonly counter: string;
  readonly word: string;
  readonly rating: "good" | "bad" | "left out";
}

/** The meaning of published lifecycle states: the labels of the lifecycles of this profile. */
export interface Stages {
  readonly starting: readonly string[];
  readonly ready: readonly string[];
  readonly returning: readonly string[];
  readonly ended: readonly string[];
  readonly faulted: readonly string[];
}

/** A state; `id` is its name in the picture (`data-state`). */
export interface StateRecord {
  readonly file: string;
  readonly line: number;
  readonly id: string;
  readonly summary: string;
}

/**
 * A transition; its id is in the picture as well (`data-transition`).
 *
 * One that refuses is not drawn: `refuse` is the code that it refuses a request with.
 */
export interface TransitionRecord {
  readonly file: string;
  readonly line: number;
  readonly state: string;
  readonly target: string;
  readonly label: string;
  readonly refuse: string;
}

/**
 * Whether a transition would be taken if its event came now (`possible`), else the reason against it.
 *
 * Of a pattern (`nav.*`) and a `resume_at` only its state, holds and guard count; no request's fields do.
 */
export interface RuleRecord {
  readonly id: string;
  readonly state: string;
  readonly event: string;
  readonly possible: boolean;
  readonly reason: string;
}

/** An operation that could end now: its codes, and the types of its result. */
export interface OperationRecord {
  readonly operation: string;
  readonly codes: readonly FailureRecord[];
  readonly result: Readonly<Record<string, string>>;
}

/** A live value of the chart; `choices` where it is one of a few words. */
export interface InputRecord {
  readonly name: string;
  readonly type: string;
  readonly unit: string;
  readonly choices: readonly string[];
  readonly now: unknown;
}

/** An event that can be sent, and the types of its fields. */
export interface EventRecord {
  readonly name: string;
  readonly fields: Readonly<Record<string, string>>;
}

/** A stop that is engaged for `age` seconds; `left`: its page is gone. */
export interface StopRecord {
  readonly name: string;
  readonly left: boolean;
  readonly age: number;
}

/** Who is connected, since so many seconds since 1970; `view` is open there, '' where it is no console. */
export interface PersonRecord {
  readonly page: string;
  readonly name: string;
  readonly role: string;
  readonly since: number;
  readonly view: string;
}

/**
 * A notification: its kind (`code`, `stop`, `node`, ...), subject (`about`) and text.
 *
 * `first` and `last` are when it occurred first and last, of so many `times`; `over` is when it ended, None
 * while it lasts, or where an end is never reported. `by` is who acknowledged it, `acknowledged` when.
 */
export interface Notification {
  readonly id: number;
  readonly kind: string;
  readonly about: string;
  readonly severity: number;
  readonly text: string;
  readonly first: number;
  readonly last: number;
  readonly times: number;
  readonly over: number | null;
  readonly by: string;
  readonly acknowledged: number | null;
}

/**
 * Begin an attempt of an operation: the `tries`th of the activation of `state` that it serves.
 *
 * One that `updates` an earlier attempt is sent while that runs; the server takes it in place of that one.
 */
export interface Start {
  readonly attempt: string;
  readonly operation: string;
  readonly arguments: Readonly<Record<string, unknown>>;
  readonly state: string;
  readonly tries: number;
  readonly updates: string;
  readonly command: "start";
}

/** Ask that an attempt ends. */
export interface Cancel {
  readonly attempt: string;
  readonly operation: string;
  readonly command: "cancel";
}

/** Carry out a plugin's action and don't wait. */
export interface Act {
  readonly action: string;
  readonly arguments: Readonly<Record<string, unknown>>;
  readonly command: "act";
}

/** The outcome of a target, to be published. `status` is the name of an outcome. */
export interface Publish {
  readonly source: string;
  readonly mission_id: string;
  readonly target: string;
  readonly status: string;
  readonly code: string;
  readonly detail: string;
  readonly reading: Readonly<Record<string, unknown>> | null;
  readonly command: "publish";
}

/** The mission's last word: every visit with its outcome. */
export interface Report {
  readonly mission: string;
  readonly mission_id: string;
  readonly visits: readonly Readonly<Record<string, unknown>>[];
  readonly command: "report";
}

/** Why a request changed nothing: a declared code and a sentence for the operator. */
export interface Refusal {
  readonly code: string;
  readonly text: string;
}

/** A reported code with its declaration; `target` was the current one then. */
export interface CodeEvent {
  readonly code: string;
  readonly label: string;
  readonly severity: number;
  readonly detail: string;
  readonly target: string;
}

/**
 * An open question: its choices, and the default that counts after `deadline`.
 *
 * During a hold its clock stands still: there is no deadline, and `left` seconds remain after it.
 */
export interface Question {
  readonly state: string;
  readonly question: string;
  readonly choices: readonly Code[];
  readonly default: string;
  readonly deadline: number | null;
  readonly left: number | null;
}

/**
 * An operation under way: which try, how far, and when it times out (None: never, or frozen).
 *
 * `limit` is how long it may take in all, in seconds; None: as long as it likes. While a hold stops its
 * clock `left` seconds remain.
 */
export interface Attempting {
  readonly state: string;
  readonly operation: string;
  readonly tries: number;
  readonly phase: string;
  readonly detail: string;
  readonly deadline: number | null;
  readonly limit: number | null;
  readonly left: number | null;
}

/**
 * A pending timer of a state: `event` is `after.0`, `every.0`, `at.0`, `budget`, or `retry`.
 *
 * While a hold stops its clock there is no deadline, and `left` seconds remain after it.
 */
export interface Countdown {
  readonly state: string;
  readonly event: string;
  readonly deadline: number | null;
  readonly left: number | null;
}

/** A field of a request: a computed default is as it would be now, and its expression (`computed`). */
export interface FieldRecord {
  readonly type: string;
  readonly kind: "bool" | "integer" | "number" | "text" | "name" | "list" | "record" | "any";
  readonly unit?: string;
  readonly allowed?: readonly string[];
  readonly pattern?: string;
  readonly example?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly at_most?: number;
  readonly distinct?: boolean;
  readonly fields?: Readonly<Record<string, TypeRecord>>;
  readonly name: string;
  readonly required: boolean;
  readonly summary?: string;
  readonly default?: unknown;
  readonly computed?: string;
  readonly may_be_empty?: boolean;
}

/** A code in which an operation can end. */
export interface FailureRecord {
  readonly code: string;
  readonly label: string;
  readonly severity: number;
}

/**
 * A reason that can reach the published state: raw name, label for people, severity.
 *
 * `advice` is one sentence for the operator of the robot. A second declaration of the code need not repeat
 * it.
 */
export interface Code {
  readonly name: string;
  readonly label: string;
  readonly severity: number;
  readonly advice: string;
}

/**
 * A type with its base unit.
 *
 * `kind` and the fields that follow from it describe the elements of a list: `name` is looked up by a
 * plugin, and a record has `fields`. `at_most` limits the number of elements of a list.
 */
export interface TypeRecord {
  readonly type: string;
  readonly kind: "bool" | "integer" | "number" | "text" | "name" | "list" | "record" | "any";
  readonly unit?: string;
  readonly allowed?: readonly string[];
  readonly pattern?: string;
  readonly example?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly at_most?: number;
  readonly distinct?: boolean;
  readonly fields?: Readonly<Record<string, TypeRecord>>;
}
