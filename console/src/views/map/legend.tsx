// Which colour is which value, and what the signs on the map are.
import { clockTime } from "../../parts/format";
import { texts } from "../../model/page";
import { measured, SENSORS, sensorName, unitOf } from "../../model/robot/sensors";
import { twin } from "../../model/robot/twin";
import { GRADIENT } from "./colours";
import { field, fieldProblem, sensor } from "./field";
import { hidden, LAYERS, scale, switchLayer } from "./scene";

/** The sensors that the interface names, and others that some tag has. */
function offered(): readonly string[] {
  const told = twin.shown.value?.value.flatMap(({ readings }) => readings.map(({ name }) => name)) ?? [];
  return [...new Set([...SENSORS, ...told])];
}

export function FieldChoice() {
  const t = texts.value.map;
  return (
    <label>
      {t.field}{" "}
      <select class="map-field" value={sensor.value} onChange={(event) => (sensor.value = event.currentTarget.value)}>
        <option value="">{t.noField}</option>
        {offered().map((name) => (
          <option value={name}>
            {sensorName(name)} {unitOf(name) && `[${unitOf(name)}]`}
          </option>
        ))}
      </select>
    </label>
  );
}

/** The scale of the field's colours. */
export function Legend() {
  const t = texts.value.map;
  const ends = scale.value;
  const name = sensor.value;
  if (!name) return null;
  const known = field.value;
  const from = known ? t.fieldFrom(known.value.samples, clockTime(known.at)) : t.noFieldYet;
  return (
    <div class="map-legend" role="group" aria-label={`${t.legend}: ${sensorName(name)}`}>
      {ends && (
        <>
          <div class="map-ramp" style={{ backgroundImage: GRADIENT }} aria-hidden="true" />
          <div class="map-ends">
            <span>{measured(name, ends.low)}</span>
            <span>{measured(name, (ends.low + ends.high) / 2)}</span>
            <span>{measured(name, ends.high)}</span>
          </div>
        </>
      )}
      <p class="soft">
        {from} {known && known.value.lowest === known.value.highest && known.value.samples > 0 && t.constant}
      </p>
      {fieldProblem.value && <p class="warn">▲ {t.fieldProblem(fieldProblem.value)}</p>}
    </div>
  );
}

export function Layers() {
  const t = texts.value.map;
  return (
    <details class="map-layers">
      <summary>{t.layers.title}</summary>
      <fieldset>
        <legend class="soft">{t.layers.title}</legend>
        {LAYERS.map((layer) => (
          <label>
            <input type="checkbox" checked={!hidden.value.has(layer)} onChange={() => switchLayer(layer)} />{" "}
            {t.layers[layer]}
          </label>
        ))}
      </fieldset>
      <p class="soft">{t.signs}</p>
    </details>
  );
}
