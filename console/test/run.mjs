// Runs the tests of the model, or those of the files that are named: `npm test`, `npm test -- alerts`.
// Each file is bundled as the page is, and run by Node's own runner.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import * as esbuild from "esbuild";

const here = import.meta.dirname;
const wanted = process.argv.slice(2);
const names = readdirSync(here)
  .filter((file) => file.endsWith(".test.ts"))
  .map((file) => file.slice(0, -".ts".length))
  .filter((name) => !wanted.length || wanted.some((each) => name === `${each}.test`));
if (!names.length) throw new Error(`no such test: ${wanted.join(", ")}`);

const outdir = mkdtempSync(join(tmpdir(), "lupin-console-"));
try {
  await esbuild.build({
    entryPoints: names.map((name) => join(here, `${name}.ts`)),
    inject: [join(here, "browser.ts")],
    outdir,
    outExtension: { ".js": ".mjs" },
    bundle: true,
    platform: "node",
    format: "esm",
    sourcemap: "inline",
    logLevel: "warning",
  });
  const files = names.map((name) => join(outdir, `${name}.mjs`));
  const { status } = spawnSync(process.execPath, ["--enable-source-maps", "--test", ...files], { stdio: "inherit" });
  process.exitCode = status ?? 1;
} finally {
  rmSync(outdir, { recursive: true });
}
