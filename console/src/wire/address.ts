/** Where this page's gateway speaks the protocol. */
export function addressOf(page: Location): string {
  return `${page.protocol === "https:" ? "wss" : "ws"}://${page.host}/_ros`;
}
