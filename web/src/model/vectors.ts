import type { Vector3 } from "../api/gen/taclink/v1/geometry_pb";

export function lengthOf(v: Pick<Vector3, "x" | "y" | "z">): number {
  return Math.hypot(v.x, v.y, v.z);
}
