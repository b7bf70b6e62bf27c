// The past of a value as a small line.
import type { Known } from "../model/time/past";

const WIDTH = 96;
const HEIGHT = 22;
/** Points that are drawn at most: the newest. */
const MOST = 60;

/** The values in the order of time; `label` says in words what the line shows. */
export function Sparkline(props: { values: readonly Known<number>[]; label: string }) {
  const values = props.values.slice(-MOST);
  if (values.length < 2) return <svg class="spark" width={WIDTH} height={HEIGHT} role="img" aria-label={props.label} />;
  const numbers = values.map(({ value }) => value);
  const low = Math.min(...numbers);
  const range = Math.max(...numbers) - low || 1;
  const begin = values[0]!.at;
  const time = values.at(-1)!.at - begin || 1;
  const points = values.map(({ at, value }) => {
    const x = 2 + ((WIDTH - 4) * (at - begin)) / time;
    const y = HEIGHT - 3 - ((HEIGHT - 6) * (value - low)) / range;
    return `${x.toFixed(1)},${y.toFixed(1)}`;
  });
  const [x, y] = points.at(-1)!.split(",");
  return (
    <svg class="spark" width={WIDTH} height={HEIGHT} role="img" aria-label={props.label}>
      <polyline points={points.join(" ")} />
      <circle cx={x} cy={y} r="2" />
    </svg>
  );
}
