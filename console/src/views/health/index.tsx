import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function HealthView() {
  return <Panel title={texts.value.health.title}>…</Panel>;
}
