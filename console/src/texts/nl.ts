// Alle teksten van het console in het Nederlands, in dezelfde volgorde als de Engelse.
import type { Texts } from "./en";

export const nl: Texts = {
  shell: {
    title: "Lupin-console",
    skip: "Naar de inhoud",
    views: "Weergaven",
    connecting: "verbinden",
    open: "verbonden",
    lost: "verbinding verbroken",
    settings: "Instellingen",
    language: "Taal",
    theme: "Kleuren",
    themes: { auto: "zoals het apparaat", light: "licht", dark: "donker" },
    modes: { robot: "robot", simulation: "SIMULATIE", recording: "OPNAME" },
    noState: "nog geen toestand van de missie",
    paused: "gepauzeerd",
    broken: "Deze weergave kan niet worden getoond:",
  },
  time: {
    ago: (text) => `${text} geleden`,
    never: "nooit",
  },
  sensors: {
    temperature: "temperatuur",
    humidity: "luchtvochtigheid",
    co2: "CO₂",
    light: "licht",
    soil_moisture: "bodemvocht",
  },
  control: { title: "Missie" },
  chart: { title: "Diagram" },
  map: { title: "Kaart" },
  log: { title: "Logboek" },
  twin: { title: "Tags" },
  arm: { title: "Arm" },
  health: { title: "Toestand" },
  people: { title: "Mensen" },
};
