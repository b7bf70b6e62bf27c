// Parses and draws the Mermaid texts that are named, with Mermaid itself in a document without a browser.
// A document has no layout, so the sizes of texts are made up; boxes and lines are placed as ever.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, ...files] = process.argv.slice(2);
const from = createRequire(`${folder}/package.json`);
const { JSDOM } = await import(pathToFileURL(from.resolve("jsdom")).href);
const { window } = new JSDOM("<!DOCTYPE html><body></body>", { pretendToBeVisual: true });
globalThis.window = window;
const names = ["document", "CSSStyleSheet", "DOMParser", "Element", "HTMLElement", "MutationObserver", "Node"];
for (const name of [...names, "SVGElement", "XMLSerializer"]) {
  globalThis[name] = window[name];
}
globalThis.getComputedStyle = window.getComputedStyle;

const size = (element) => {
  const text = element.textContent ?? "";
  return { x: 0, y: 0, left: 0, top: 0, right: 8 * text.length, bottom: 16, width: 8 * text.length + 8, height: 16 };
};
window.SVGElement.prototype.getBBox = function () { return size(this); };
window.SVGElement.prototype.getComputedTextLength = function () { return size(this).width; };
window.Element.prototype.getBoundingClientRect = function () { return size(this); };

const mermaid = (await import(pathToFileURL(`${folder}/node_modules/mermaid/dist/mermaid.core.mjs`).href)).default;
mermaid.initialize({ startOnLoad: false });
const found = {};
for (const [index, file] of files.entries()) {
  try {
    const text = readFileSync(file, "utf8");
    await mermaid.parse(text);
    const { svg } = await mermaid.render(`drawn${index}`, text);
    const drawn = window.document.createElement("div");
    drawn.innerHTML = svg;
    found[file] = { arrows: drawn.querySelectorAll("path.transition").length, text: drawn.textContent };
  } catch (problem) {
    found[file] = { problem: String(problem?.stack ?? problem) };
  }
}
process.stdout.write(`${JSON.stringify(found)}\n`, () => process.exit(0));
