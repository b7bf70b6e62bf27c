// What the model asks of a browser when it is loaded. It comes before every test: nothing is drawn, nobody is connected.
const nothing = (): void => undefined;

Object.assign(globalThis, {
  document: { getElementById: () => ({ dataset: {} }) },
  localStorage: { getItem: () => null, setItem: nothing },
  location: { protocol: "http:", host: "robot", hash: "" },
});
Object.defineProperty(globalThis, "navigator", { value: { language: "en" }, configurable: true });

export {};
