import { texts } from "../../model/page";
import { Panel } from "../../parts/panel";

export function ChartView() {
  return <Panel title={texts.value.chart.title}>…</Panel>;
}
