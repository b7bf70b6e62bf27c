// A button that acts with its second press: the first one asks.
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { texts } from "../model/page";

/** `why`: why it is disabled, which is shown; `question`: what the second press agrees to. */
export function ConfirmButton(props: {
  children: ComponentChildren;
  question: string;
  why?: string;
  onConfirm: () => void;
  label?: string;
}) {
  const [asks, setAsks] = useState(false);
  const yes = useRef<HTMLButtonElement>(null);
  useEffect(() => {
    if (asks) yes.current?.focus();
  }, [asks]);
  const t = texts.value.confirm;
  if (!asks || props.why)
    return (
      <button disabled={!!props.why} title={props.why} aria-label={props.label} onClick={() => setAsks(true)}>
        {props.children}
      </button>
    );
  return (
    <span class="confirm" role="group" aria-label={props.question} onKeyDown={(event) => event.key === "Escape" && setAsks(false)}>
      <span>{props.question}</span>{" "}
      <button ref={yes} class="main" onClick={() => (setAsks(false), props.onConfirm())}>
        {t.yes}
      </button>{" "}
      <button onClick={() => setAsks(false)}>{t.no}</button>
    </span>
  );
}
