import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function ControlView() {
  return <Panel title={texts.value.control.title}>…</Panel>;
}
