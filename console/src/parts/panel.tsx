// What all views are made of.
import type { ComponentChildren } from "preact";
import { Component } from "preact";
import { texts } from "../model/page";

/** A part of a view with a heading. */
export function Panel(props: { title: string; children: ComponentChildren; tools?: ComponentChildren; class?: string }) {
  return (
    <section class={`panel ${props.class ?? ""}`} aria-label={props.title}>
      <header class="panel-head">
        <h2>{props.title}</h2>
        {props.tools}
      </header>
      {props.children}
    </section>
  );
}

export type Tone = "plain" | "good" | "info" | "warn" | "bad";
/** Colours alone tell nobody anything: each has a sign. */
const SIGNS: Record<Tone, string> = { plain: "", good: "✓ ", info: "● ", warn: "▲ ", bad: "✖ " };

/** A word with a colour and a sign. */
export function Pill(props: { tone?: Tone; children: ComponentChildren; title?: string }) {
  const tone = props.tone ?? "plain";
  return (
    <span class={`pill ${tone}`} title={props.title}>
      <span aria-hidden="true">{SIGNS[tone]}</span>
      {props.children}
    </span>
  );
}

interface CaughtState {
  readonly problem: string | undefined;
}

/** A view that cannot be shown leaves the others alone. */
export class Contained extends Component<{ children: ComponentChildren }, CaughtState> {
  override state: CaughtState = { problem: undefined };

  static override getDerivedStateFromError(problem: unknown): CaughtState {
    return { problem: String(problem) };
  }

  override render() {
    if (this.state.problem === undefined) return this.props.children;
    return (
      <p class="note bad" role="alert">
        {texts.value.shell.broken} {this.state.problem}
      </p>
    );
  }
}
