// Why the arm cannot be commanded now.
import { armAsked, armBusy } from "../../model/robot/arm";
import { texts } from "../../model/page";
import { hindranceFor } from "../../model/mission/permission";

/** Why the arm cannot be commanded by this page now; empty: it can. `moves`: it would move the arm. */
export function whyNot(least: "operator" | "engineer", moves = true): string {
  const t = texts.value.arm;
  return hindranceFor(least) || (moves ? armBusy.value : "") || (armAsked.value && t.asking(armAsked.value));
}

/** Said once for all buttons that are disabled for one reason. */
export function Why({ text }: { text: string }) {
  return text ? <p class="note why">{text}</p> : null;
}
