// Opens the gateway's own page, waits until it shows a stop, presses its button, and tells what it then says.
import { createRequire } from "node:module";
const { JSDOM } = createRequire(`${process.argv[2]}/`)("jsdom");
const page = await JSDOM.fromURL(process.argv[3], { runScripts: "dangerously" });
const part = (id) => page.window.document.getElementById(id).textContent;
const until = async (condition) => {
  while (!condition()) await new Promise((resolve) => setTimeout(resolve, 20));
};
await until(() => page.window.document.querySelector("#stops button"));
const before = [part("stop"), part("stops")];
page.window.document.querySelector("#stops button").click();
await until(() => part("answer") && !page.window.document.querySelector("#stops button"));
console.log(JSON.stringify({ before, after: [part("stop"), part("answer")] }));
process.exit(0);
