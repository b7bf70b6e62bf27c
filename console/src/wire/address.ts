/** What stands before the paths of this page's robot: nothing where the gateway has one robot only. */
export function baseOf(page: Location): string {
  return /^\/robots\/[^/]+(?=\/)/.exec(page.pathname)?.[0] ?? "";
}

/** Where this page's gateway speaks the protocol. */
export function addressOf(page: Location): string {
  return `${page.protocol === "https:" ? "wss" : "ws"}://${page.host}${baseOf(page)}/_ros`;
}
