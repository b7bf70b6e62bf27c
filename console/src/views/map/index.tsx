import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function MapView() {
  return <Panel title={texts.value.map.title}>…</Panel>;
}
