// The lines that are shown, as a file: CSV for a spreadsheet, JSON for a program.
import type { Entry } from "../../model/story";

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

/** A cell of CSV (RFC 4180); what a spreadsheet would take for a formula is not one. */
function cell(value: string | number): string {
  const text = typeof value === "string" && /^[=+\-@\t\r]/.test(value) ? `'${value}` : String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

function asCsv(lines: readonly Entry[]): string {
  const rows = lines.map((entry) => Object.values(rowOf(entry)).map(cell).join(","));
  return [COLUMNS.join(","), ...rows, ""].join("\r\n");
}

/** Let the browser save lines. */
export function save(lines: readonly Entry[], kind: "csv" | "json"): void {
  const text = kind === "csv" ? asCsv(lines) : JSON.stringify(lines.map(rowOf), null, 1);
  const address = URL.createObjectURL(new Blob([text], { type: kind === "csv" ? "text/csv" : "application/json" }));
  const day = new Date(lines.at(-1)?.at ?? 0).toISOString().slice(0, 19).replaceAll(":", "");
  const link = Object.assign(document.createElement("a"), { href: address, download: `lupin-log-${day}Z.${kind}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
