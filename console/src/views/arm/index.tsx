import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function ArmView() {
  return <Panel title={texts.value.arm.title}>…</Panel>;
}
