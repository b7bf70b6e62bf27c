// Builds the console into the gateway's folder of pages: `npm run build`, or `npm run watch` while working on it.
// What is built comes with the package, so that whoever installs it needs no Node.js.
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join, relative } from "node:path";
import { brotliCompressSync } from "node:zlib";
import * as esbuild from "esbuild";

const here = import.meta.dirname;
const pages = join(here, "..", "plugins", "lupin_gateway", "pages");

/** All that decides what is built, by which a test sees that the pages are those of these sources. */
function sourcesHash() {
  const files = readdirSync(join(here, "src"), { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => join(entry.parentPath, entry.name));
  const hash = createHash("sha256");
  for (const file of [...files, join(here, "package.json"), join(here, "build.mjs")].sort())
    hash.update(relative(here, file)).update("\0").update(readFileSync(file)).update("\0");
  return hash.digest("hex");
}

const told = {
  name: "told",
  setup: (build) =>
    build.onEnd((result) => {
      if (result.errors.length) return;
      let packed = 0;
      for (const file of result.outputFiles) {
        writeFileSync(file.path, file.contents);
        packed += brotliCompressSync(file.contents).length;
      }
      const licenses = ["preact", "@preact/signals", "@preact/signals-core", "uplot"].map(
        (name) => `${name}\n\n${readFileSync(join(here, "node_modules", name, "LICENSE"), "utf8").trim()}\n`,
      );
      writeFileSync(join(pages, "LICENSES.txt"), licenses.join("\n\n"));
      writeFileSync(join(pages, "sources.sha256"), `${sourcesHash()}\n`);
      console.log(`built ${pages}: ${(packed / 1000).toFixed(1)} kB packed by brotli`);
    }),
};

mkdirSync(pages, { recursive: true });
const options = {
  entryPoints: { console: join(here, "src", "main.tsx"), stop: join(here, "src", "stop.ts") },
  outdir: pages,
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022"],
  jsx: "automatic",
  jsxImportSource: "preact",
  legalComments: "none",
  logLevel: "warning",
  write: false,
  plugins: [told],
};
if (process.argv.includes("--watch")) await (await esbuild.context(options)).watch();
else await esbuild.build(options);
