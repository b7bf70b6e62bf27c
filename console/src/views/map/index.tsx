// The map: where everything is, what was measured there, and driving to a place.
import { useEffect } from "preact/hooks";
import { link } from "../../wire/link";
import { grid, gridProblem, robot, robotSilentSince, transformGap, type Grid } from "../../model/robot/map";
import { open, texts } from "../../model/page";
import { moment } from "../../model/time/past";
import { endPicking, picked, picking } from "../../model/mission/picking";
import { measured, sensorName } from "../../model/robot/sensors";
import { twin } from "../../model/robot/twin";
import { clockTime } from "../../parts/format";
import { Panel } from "../../parts/panel";
import { aim, choosing, driven, drive, driveRefusal, endChoosing, giveBack, isTaken, mayTake, takeBase } from "./driving";
import { field, fieldAt, followField, sensor } from "./field";
import { cellAt } from "./grid";
import { FieldChoice, Layers, Legend } from "./legend";
import { hovered, scene, selected, twinSilentSince } from "./scene";
import { fit, pointer, size, Surface, zoom } from "./surface";
import { TagList } from "./tags";
import { tell, type Told } from "./things";
import "./map.css";

/** What the gateway said of a topic that it does not pass on. */
function complaintOf(topic: string): string {
  return link.complaints.value.findLast((each) => each.startsWith(`${topic}:`)) ?? "";
}

/** What is missing or silent, in words. */
function notes(): readonly string[] {
  const t = texts.value.map.missing;
  if (moment.value !== null) return [];
  const found: string[] = [];
  const add = (isMissing: boolean, text: string): number => (isMissing ? found.push(text) : 0);
  add(grid.heardAt.value === undefined, complaintOf("/map") || t.map);
  add(gridProblem.value !== "", t.badMap(gridProblem.value));
  add(robot.heardAt.value === undefined, t.transforms);
  if (robot.heardAt.value !== undefined && (!robot.shown.value || robotSilentSince.value)) {
    const gap = transformGap();
    add(true, robotSilentSince.value ? t.robotSilent(clockTime(robotSilentSince.value), gap) : t.robot(gap));
  }
  add(twin.heardAt.value === undefined, t.twin);
  if (twinSilentSince.value) add(true, t.twinSilent(clockTime(twinSilentSince.value)));
  return found;
}

function Notes() {
  const found = notes();
  return (
    <div role="status" class="map-notes">
      {found.map((note) => (
        <p class="warn">▲ {note}</p>
      ))}
    </div>
  );
}

/** How far from the pointer a card is, in pixels. */
const BESIDE = 14;

function Card({ told, class: name, style }: { told: Told; class: string; style?: Readonly<Record<string, string>> }) {
  return (
    <div class={name} {...(style && { style })}>
      <b>{told.title}</b>
      {told.lines.map((line) => (
        <div>{line}</div>
      ))}
    </div>
  );
}

/** What the pointer is over; the card is on the side where there is room. */
function Tip() {
  const at = pointer.value;
  const told = hovered.value && tell(scene.value, hovered.value);
  if (!at || !told) return null;
  const { width, height } = size.value;
  const across = at.x < width / 2 ? { left: `${at.x + BESIDE}px` } : { right: `${width - at.x + BESIDE}px` };
  const down = at.y < height / 2 ? { top: `${at.y + BESIDE}px` } : { bottom: `${height - at.y + BESIDE}px` };
  return <Card told={told} class="map-tip" style={{ ...across, ...down }} />;
}

/** Where the pointer is and what is known of that place. */
function Readout({ map }: { map: Grid | undefined }) {
  const t = texts.value.map;
  const at = pointer.value?.map;
  if (!at) return <p class="map-readout soft">&nbsp;</p>;
  const cell = map && cellAt(map, at.x, at.y);
  const known = field.value?.value;
  const value = known && fieldAt(known, at.x, at.y);
  return (
    <p class="map-readout">
      {t.place(at.x, at.y)} · {cell ? t.cells[cell] : t.outside}
      {known && ` · ${sensorName(sensor.value)} ${measured(sensor.value, value)}`}
    </p>
  );
}

/** What was tapped or chosen. */
function Chosen() {
  const told = selected.value ? tell(scene.value, selected.value) : undefined;
  return (
    <div role="status" class="map-chosen">
      {told && <Card told={told} class="" />}
    </div>
  );
}

function Drive() {
  const t = texts.value.map.drive;
  const refusal = driveRefusal.value;
  const to = aim.value;
  const map = scene.value.grid;
  const cell = to && map && cellAt(map, to.x, to.y);
  return (
    <div class="map-drive">
      <div class="row">
        <button
          aria-pressed={choosing.value}
          aria-disabled={refusal !== ""}
          aria-describedby="map-drive-why"
          onClick={() => {
            if (choosing.value) endChoosing();
            else if (!refusal) [choosing.value, driven.value] = [true, ""];
          }}
        >
          {choosing.value ? t.end : t.begin}
        </button>
        {(mayTake.value || isTaken.value) && (
          <button aria-pressed={isTaken.value} onClick={() => void (isTaken.value ? giveBack() : takeBase(true))}>
            {isTaken.value ? t.giveBack : t.take}
          </button>
        )}
        <span id="map-drive-why" class="soft">
          {refusal || (choosing.value && !to ? t.how : "")}
        </span>
      </div>
      {to && (
        <div class="note info row" role="group" aria-label={t.begin}>
          <span>
            {t.confirm(to.x, to.y, to.yaw)}
            {cell !== "free" && ` ▲ ${t.notFree(texts.value.map.cells[cell ?? "unknown"])}`}
          </span>
          <button class="main" disabled={refusal !== ""} onClick={drive}>
            {t.go}
          </button>
          <button onClick={endChoosing}>{t.cancel}</button>
        </div>
      )}
      <p role="status">{driven.value}</p>
    </div>
  );
}

function Picking() {
  const wanted = picking.value;
  if (!wanted) return null;
  const t = texts.value.map;
  return (
    <div class="note info row" role="status">
      <span>{t.picking(wanted.field, wanted.mission, picked.value.join(", ") || "–")}</span>
      <button class="main" onClick={() => (endPicking(), open("control"))}>
        {t.picked}
      </button>
    </div>
  );
}

export function MapView() {
  const t = texts.value.map;
  useEffect(followField, []);
  const map = scene.value.grid;
  const summary = t.summary(scene.value.marks.length, map ? map.width * map.resolution : 0, map ? map.height * map.resolution : 0);
  const tools = (
    <div class="row">
      <FieldChoice />
      <button aria-label={t.nearer} onClick={() => zoom(1.4)}>
        +
      </button>
      <button aria-label={t.farther} onClick={() => zoom(1 / 1.4)}>
        −
      </button>
      <button aria-label={t.fit} title={t.fit} onClick={fit}>
        ⤢
      </button>
    </div>
  );
  return (
    <>
      <Panel title={t.title} tools={tools}>
        <Picking />
        <Notes />
        <p id="map-keys" class="map-keys">
          {t.keys}
        </p>
        <div class="map-body">
          <div>
            <div class="map-frame">
              <Surface summary={summary} />
              <Tip />
            </div>
            <Readout map={map} />
          </div>
          <div>
            <Legend />
            <Drive />
            <Chosen />
            <Layers />
          </div>
        </div>
      </Panel>
      <TagList />
    </>
  );
}
