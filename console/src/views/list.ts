// The views, in the order of the navigation.
import type { ComponentType } from "preact";
import type { Mode } from "../model/page";
import { openNotifications } from "../model/people";
import type { Texts } from "../texts/en";
import { ArmView } from "./arm";
import { ChartView } from "./chart";
import { ControlView } from "./control";
import { HealthView } from "./health";
import { LogView } from "./log";
import { MapView } from "./map";
import { PeopleView } from "./people";
import { SimulationView } from "./simulation";
import { TwinView } from "./twin";

export interface ViewEntry {
  readonly id: "control" | "chart" | "map" | "log" | "twin" | "arm" | "health" | "people" | "simulation";
  /** A sign for narrow screens. */
  readonly sign: string;
  readonly title: (texts: Texts) => string;
  readonly View: ComponentType;
  /** It shows the mission: it is of the past when the orchestrator is not heard. */
  readonly ofMission?: boolean;
  /** It is there only where this is looked at. */
  readonly only?: Mode;
  /** How many things of it wait for somebody, and in words. */
  readonly waiting?: (texts: Texts) => { readonly count: number; readonly text: string };
}

function unacknowledged({ people }: Texts) {
  const count = openNotifications.value.length;
  return { count, text: people.badge(count) };
}

export const VIEWS: readonly ViewEntry[] = [
  { id: "control", sign: "▶", title: (t) => t.control.title, View: ControlView, ofMission: true },
  { id: "chart", sign: "◫", title: (t) => t.chart.title, View: ChartView, ofMission: true },
  { id: "map", sign: "▦", title: (t) => t.map.title, View: MapView },
  { id: "log", sign: "☰", title: (t) => t.log.title, View: LogView },
  { id: "twin", sign: "❀", title: (t) => t.twin.title, View: TwinView },
  { id: "arm", sign: "⚙", title: (t) => t.arm.title, View: ArmView },
  { id: "health", sign: "♥", title: (t) => t.health.title, View: HealthView },
  { id: "people", sign: "☺", title: (t) => t.people.title, View: PeopleView, waiting: unacknowledged },
  { id: "simulation", sign: "⚗", title: (t) => t.simulation.title, View: SimulationView, only: "simulation" },
];
