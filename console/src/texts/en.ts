// All texts of the console in English. A text with something to fill in is a function. Each view has a part of its own.
export const en = {
  shell: {
    title: "Lupin console",
    skip: "To the content",
    views: "Views",
    connecting: "connecting",
    open: "connected",
    lost: "connection lost",
    settings: "Settings",
    language: "Language",
    theme: "Colours",
    themes: { auto: "as the device", light: "light", dark: "dark" },
    modes: { robot: "robot", simulation: "SIMULATION", recording: "RECORDING" },
    noState: "no mission state yet",
    paused: "paused",
    broken: "This view cannot be shown:",
  },
  time: {
    ago: (text: string) => `${text} ago`,
    never: "never",
  },
  sensors: {
    temperature: "temperature",
    humidity: "humidity",
    co2: "CO₂",
    light: "light",
    soil_moisture: "soil moisture",
  },
  control: { title: "Mission" },
  chart: { title: "Chart" },
  map: { title: "Map" },
  log: { title: "Log" },
  twin: { title: "Tags" },
  arm: { title: "Arm" },
  health: { title: "Health" },
  people: { title: "People" },
};

type Widened<T> = T extends string ? string : { readonly [K in keyof T]: T[K] extends (...given: infer G) => string ? (...given: G) => string : Widened<T[K]> };
export type Texts = Widened<typeof en>;
