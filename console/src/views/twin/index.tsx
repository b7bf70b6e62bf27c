import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function TwinView() {
  return <Panel title={texts.value.twin.title}>…</Panel>;
}
