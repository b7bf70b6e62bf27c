// Tables as files of comma-separated values, RFC 4180.

type Cell = string | number | boolean | null | undefined;

function written(cell: Cell): string {
  const text = cell === null || cell === undefined ? "" : String(cell);
  // A text that a spreadsheet would take for a formula is shown as a text.
  const safe = typeof cell === "string" && /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

export function csv(rows: readonly (readonly Cell[])[]): string {
  return rows.map((row) => row.map(written).join(",") + "\r\n").join("");
}

/** Let the browser save a table. */
export function saveCsv(name: string, rows: readonly (readonly Cell[])[]): void {
  saveFile(name, csv(rows), "text/csv;charset=utf-8");
}

export function saveFile(name: string, text: string, type: string): void {
  const address = URL.createObjectURL(new Blob([text], { type }));
  const anchor = document.createElement("a");
  anchor.href = address;
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** The time in names of files and in tables: `2026-11-23T03:12:07Z`. */
export function isoTime(at: number): string {
  return `${new Date(at).toISOString().slice(0, 19)}Z`;
}
