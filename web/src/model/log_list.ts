import type { Log } from "../api/gen/taclink/v1/recording_pb";

export type LogKey = "name" | "start" | "duration" | "bytes" | "frames" | "contacts";

export interface LogOrder {
  key: LogKey;
  descending: boolean;
}

/** ns; 0: not known. */
export function durationNs(log: Log): bigint {
  return log.endUtcNs > log.startUtcNs ? log.endUtcNs - log.startUtcNs : 0n;
}

function compare(a: Log, b: Log, key: LogKey): number {
  const difference = (x: bigint, y: bigint) => (x < y ? -1 : x > y ? 1 : 0);
  switch (key) {
    case "name":
      return a.name < b.name ? -1 : a.name > b.name ? 1 : 0;
    case "start":
      return difference(a.startUtcNs, b.startUtcNs);
    case "duration":
      return difference(durationNs(a), durationNs(b));
    case "bytes":
      return difference(a.bytes, b.bytes);
    case "frames":
      return difference(a.frames, b.frames);
    case "contacts":
      return difference(a.contacts ?? -1n, b.contacts ?? -1n);
  }
}

/** Logs whose name, note or links hold all words of `filter`, in order. */
export function chooseLogs(logs: readonly Log[], filter: string, order: LogOrder): Log[] {
  const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
  const holds = (log: Log) => {
    const text = `${log.name} ${log.note} ${log.links.join(" ")}`.toLowerCase();
    return words.every((word) => text.includes(word));
  };
  const sign = order.descending ? -1 : 1;
  return logs.filter(holds).sort((a, b) => sign * compare(a, b, order.key) || (a.name < b.name ? -1 : 1));
}
