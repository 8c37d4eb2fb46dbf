import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { Vector3 } from "../api/gen/taclink/v1/geometry_pb";
import { lengthOf } from "./vectors";

// A contact further from all pieces of a user's bodies is none of theirs.
const OTHER_BODY_M = 0.025;

/** What users press on a simulated link, as it is and as the link feels it: sums of the pressing forces, N. */
export interface Felt {
  trueN: number;
  feltN: number;
  /** From the true center to the felt one, m; NaN: nothing is felt. */
  offM: number;
}

/** Undefined: no user presses. */
export function feltOf(frame: LinkFrame | undefined): Felt | undefined {
  const pieces = frame?.simulation?.contacts ?? [];
  const own = pieces.filter((piece) => piece.bodyId !== 0n && piece.forceN && piece.centerM);
  if (!frame || own.length === 0) return undefined;
  const truth = new WeightedCenter();
  for (const piece of own) truth.add(piece.centerM!, lengthOf(piece.forceN!));
  const felt = new WeightedCenter();
  for (const contact of frame.contacts) {
    if (!contact.centerM) continue;
    const away = (piece: (typeof pieces)[number]) => distance(piece.centerM!, contact.centerM!);
    const nearest = Math.min(...own.map(away));
    const others = pieces.filter((piece) => piece.bodyId === 0n && piece.centerM).map(away);
    if (nearest <= OTHER_BODY_M && nearest <= Math.min(Infinity, ...others))
      felt.add(contact.centerM, contact.normalForceN);
  }
  const offM = felt.weight > 0 ? distance(felt.mean(), truth.mean()) : NaN;
  return { trueN: truth.weight, feltN: felt.weight, offM };
}

type Point = Pick<Vector3, "x" | "y" | "z">;

function distance(a: Point, b: Point): number {
  return Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

class WeightedCenter {
  weight = 0;
  private readonly sum = [0, 0, 0];

  add(at: Point, weight: number): void {
    this.weight += weight;
    for (const [axis, value] of [at.x, at.y, at.z].entries()) this.sum[axis] += weight * value;
  }
  mean(): Point {
    const [x, y, z] = this.sum.map((value) => value / this.weight);
    return { x, y, z };
  }
}
