import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function LogView() {
  return <Panel title={texts.value.log.title}>…</Panel>;
}
