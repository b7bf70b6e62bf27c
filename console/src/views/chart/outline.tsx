// What there is of a chart without its picture: its states as a list.
import { view } from "../../model/mission/mission";
import { texts } from "../../model/page";
import { Pill } from "../../parts/panel";
import { choose, shortName } from "./names";
import type { ChartRecord } from "../../records";

export function Outline(props: { chart: ChartRecord }) {
  const t = texts.value.chart;
  const active = new Set(view.value?.configuration ?? []);
  return (
    <ul class="outline">
      {Object.keys(props.chart.states).map((name) => (
        <li style={{ paddingInlineStart: `${name.split(".").length - 1}rem` }}>
          <button class="link" onClick={() => choose(name)}>
            {shortName(name)}
          </button>{" "}
          {active.has(name) && <Pill tone="info">{t.active}</Pill>}
        </li>
      ))}
    </ul>
  );
}
