import type { ArmStore } from "./arm_store";
import type { Sample } from "./force_history";

const KEY = "taclink.curves";
const KEPT_S = 60;

/** Keeps the forces of the last minute for this tab's next load of the page. */
export function keepCurves(store: ArmStore, keep: Storage = sessionStorage): void {
  const round = (force: number) => Math.round(force * 1e4) / 1e4;
  const curves: Record<string, Sample[]> = {};
  for (const [link, { history }] of store.links())
    curves[link] = history
      .samplesFrom(history.newestS - KEPT_S)
      .map(([timeS, totalN, contacts]) => [
        timeS,
        totalN === null ? null : round(totalN),
        contacts.map(([id, forceN]) => [id, round(forceN)]),
      ]);
  try {
    keep.setItem(KEY, JSON.stringify(curves));
  } catch {
    keep.removeItem(KEY); // no room
  }
}

/** Into a store that has none yet. */
export function restoreCurves(store: ArmStore, keep: Storage = sessionStorage): void {
  try {
    const curves = JSON.parse(keep.getItem(KEY) ?? "{}") as Record<string, Sample[]>;
    for (const [link, samples] of Object.entries(curves))
      for (const sample of samples) store.link(link).history.addSample(sample);
  } catch {
    keep.removeItem(KEY);
  }
}
