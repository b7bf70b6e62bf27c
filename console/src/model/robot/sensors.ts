// What is measured in a greenhouse. The wire has names of sensors without units, so this is the one place that knows them.
import { number } from "../../parts/format";
import { texts } from "../page";

interface Quantity {
  readonly unit: string;
  /** Digits after the point that mean something. */
  readonly digits: number;
}

const QUANTITIES: ReadonlyMap<string, Quantity> = new Map([
  ["temperature", { unit: "°C", digits: 1 }],
  ["humidity", { unit: "%", digits: 1 }],
  ["co2", { unit: "ppm", digits: 0 }],
  ["light", { unit: "lx", digits: 0 }],
  ["soil_moisture", { unit: "", digits: 3 }],
]);

/** All sensors that the interface names, in its order. */
export const SENSORS: readonly string[] = [...QUANTITIES.keys()];

export function unitOf(sensor: string): string {
  return QUANTITIES.get(sensor)?.unit ?? "";
}

/** The name of a sensor for people; of one that nobody knows, its own. */
export function sensorName(sensor: string): string {
  const names: Readonly<Record<string, string>> = texts.value.sensors;
  return (Object.hasOwn(names, sensor) && names[sensor]) || sensor.replaceAll("_", " ");
}

/** A value with its unit, all of a sensor with as many digits; `–` where there is none: `21.0 °C`. */
export function measured(sensor: string, value: number | null | undefined): string {
  const { unit, digits } = QUANTITIES.get(sensor) ?? { unit: "", digits: undefined };
  return `${number(value, digits ?? 2, digits)}${unit && ` ${unit}`}`;
}
