/** What an address of the page says: it can be shared. */
export interface Address {
  page: "live" | "logs";
  /** Selected link; empty: the first. */
  link: string;
  /** Log that is played; empty: the arm as it is now. */
  log: string;
  /** Place in the log, s since 1970-01-01 UTC; NaN: its beginning. */
  timeS: number;
}

export function parseAddress(search: string): Address {
  const query = new URLSearchParams(search);
  const time = query.get("t");
  const timeS = time === null || time === "" ? NaN : Number(time);
  return {
    page: query.get("page") === "logs" ? "logs" : "live",
    link: query.get("link") ?? "",
    log: query.get("log") ?? "",
    timeS: Number.isFinite(timeS) && timeS > 0 ? timeS : NaN,
  };
}

/** Empty, or with a leading '?'. */
export function formatAddress(address: Address): string {
  const query = new URLSearchParams();
  if (address.page !== "live") query.set("page", address.page);
  if (address.link) query.set("link", address.link);
  if (address.log) query.set("log", address.log);
  if (address.log && Number.isFinite(address.timeS)) query.set("t", address.timeS.toFixed(3));
  const text = query.toString();
  return text ? `?${text}` : "";
}
