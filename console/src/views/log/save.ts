// The lines that are shown, as a file: CSV for a spreadsheet, JSON for a program.
import type { Entry } from "../../model/story/story";
import { isoTime, saveCsv, saveFile } from "../../parts/csv";

const COLUMNS = ["time", "severity", "kind", "target", "text", "led_to", "commanded", "notes", "step"] as const;
const SEVERITIES = ["info", "warning", "error"] as const;

type Row = Record<(typeof COLUMNS)[number], string | number>;

function rowOf(entry: Entry): Row {
  return {
    time: new Date(entry.at).toISOString(),
    severity: SEVERITIES[entry.severity],
    kind: entry.kind,
    target: entry.target ?? "",
    text: entry.text,
    led_to: entry.moved ?? "",
    commanded: entry.commands?.join("; ") ?? "",
    notes: entry.notes?.join("; ") ?? "",
    step: entry.sequence ?? "",
  };
}

/** Let the browser save lines. */
export function save(lines: readonly Entry[], kind: "csv" | "json"): void {
  const rows = lines.map(rowOf);
  const name = `lupin-log-${isoTime(lines.at(-1)?.at ?? 0).replaceAll(":", "")}.${kind}`;
  if (kind === "csv") saveCsv(name, [COLUMNS, ...rows.map((row) => Object.values(row))]);
  else saveFile(name, JSON.stringify(rows, null, 1), "application/json");
}
