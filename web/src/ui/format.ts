const DASH = "–";

export const PASCALS_PER_KPA = 1e3;

/** With so many digits after the point; a dash where there is no number. */
export function fixed(value: number | undefined, digits: number): string {
  return value === undefined || !Number.isFinite(value) ? DASH : value.toFixed(digits);
}

export function newtons(value: number | undefined): string {
  return value === undefined || !Number.isFinite(value) ? DASH : `${value.toFixed(2)} N`;
}

export function milliseconds(seconds: number | undefined): string {
  if (!seconds || !Number.isFinite(seconds)) return DASH;
  const ms = seconds * 1e3;
  return `${ms.toFixed(ms < 10 ? 1 : 0)} ms`;
}

/** How long something lasts or is ago, coarsely. */
export function duration(seconds: number | undefined): string {
  if (seconds === undefined || !Number.isFinite(seconds) || seconds < 0) return DASH;
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${pad(Math.floor(seconds % 60))} s`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h ${pad(Math.floor((seconds % 3600) / 60))} min`;
  return `${Math.floor(seconds / 86400)} d ${Math.floor((seconds % 86400) / 3600)} h`;
}

export function bytes(count: bigint | number): string {
  let value = Number(count);
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (value >= 1000 && unit < units.length - 1) {
    value /= 1000;
    ++unit;
  }
  return `${unit === 0 ? value : value.toFixed(value < 10 ? 2 : 1)} ${units[unit]}`;
}

const pad = (value: number) => String(value).padStart(2, "0");

/** Local time of day, to the tenth. */
export function clockTime(utcS: number): string {
  if (!Number.isFinite(utcS)) return DASH;
  const date = new Date(utcS * 1e3);
  return `${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}.${Math.floor(date.getMilliseconds() / 100)}`;
}

/** Local date and time. */
export function dateTime(utcS: number): string {
  if (!Number.isFinite(utcS) || utcS <= 0) return DASH;
  const date = new Date(utcS * 1e3);
  const day = `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())}`;
  return `${day} ${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}`;
}

/** ns since 1970-01-01 UTC to s. */
export function secondsOf(ns: bigint): number {
  return Number(ns / 1000n) / 1e6;
}
