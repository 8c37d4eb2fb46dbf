import type { LinkModel } from "../api/gen/taclink/v1/arm_pb";
import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import { linear } from "./interpolation";
import { gridNormals } from "./surface";

/** What colours mean. */
export type Quantity = "pressure" | "displacement";

export interface QuantityInfo {
  name: string;
  unit: string;
  /** Of the unit, in SI. */
  scale: number;
  /** Top of the scale at first, in the unit. */
  range: number;
}

export const QUANTITIES: Record<Quantity, QuantityInfo> = {
  pressure: { name: "Contact pressure", unit: "kPa", scale: 1e3, range: 2 },
  displacement: { name: "Displacement", unit: "mm", scale: 1e-3, range: 5 },
};

/** Whether a measured frame has what is shown: forces that can't be trusted are not in it, nor is pressure. */
export function isKnown(frame: LinkFrame, quantity: Quantity): boolean {
  return quantity !== "pressure" || frame.totalForceN !== undefined;
}

/** What is computed once for a model: areas that belong to markers, their places at rest. */
export class MarkerFields {
  private readonly areas: Float64Array;
  private readonly rest: Float64Array;
  private readonly normals: Float64Array;
  private readonly displacement: Float64Array;
  private readonly value: Float64Array;
  readonly count: number;

  constructor(private readonly model: LinkModel) {
    const grid = model.markers!;
    this.count = grid.paths * grid.rings;
    this.rest = Float64Array.from(grid.restPositionsM);
    this.normals = new Float64Array(3 * this.count);
    this.displacement = new Float64Array(3 * this.count);
    this.value = new Float64Array(this.count);
    this.areas = markerAreas(model);
  }

  /** Of each marker from the undeformed skin, m. Reused by the next call. */
  displacements(frame: LinkFrame): Float64Array {
    const { displacement, rest } = this;
    if (frame.displacementsM.length === 3 * this.count) displacement.set(frame.displacementsM);
    else for (let i = 0; i < displacement.length; ++i) displacement[i] = frame.positionsM[i] - rest[i];
    return displacement;
  }

  /**
   * Of each marker, SI. Pressure: the nodal force against the skin's normal over the marker's area, Pa; needs FULL frames.
   * Displacement: its length, m. Reused by the next call.
   */
  values(frame: LinkFrame, quantity: Quantity): Float64Array {
    const { value } = this;
    value.fill(0);
    if (quantity === "displacement") {
      const d = this.displacements(frame);
      for (let i = 0; i < this.count; ++i) value[i] = Math.hypot(d[3 * i], d[3 * i + 1], d[3 * i + 2]);
      return value;
    }
    const forces = frame.nodalForcesN;
    if (forces.length !== 3 * this.count || frame.positionsM.length !== 3 * this.count) return value;
    const grid = this.model.markers!;
    gridNormals(frame.positionsM, grid.rings, grid.paths, this.normals);
    for (let i = 0; i < this.count; ++i) {
      const n = this.normals;
      const inward = -(
        forces[3 * i] * n[3 * i] +
        forces[3 * i + 1] * n[3 * i + 1] +
        forces[3 * i + 2] * n[3 * i + 2]
      );
      value[i] = Math.max(0, inward / this.areas[i]);
    }
    return value;
  }
}

/** Area of the outer surface that belongs to each marker, m^2: half-way to its neighbours. */
export function markerAreas(model: LinkModel): Float64Array {
  const grid = model.markers!;
  const out = new Float64Array(grid.paths * grid.rings);
  const z = grid.ringZM;
  for (let ring = 0; ring < grid.rings; ++ring) {
    const from = ring > 0 ? (z[ring] + z[ring - 1]) / 2 : z[0] / 2;
    const to = ring + 1 < grid.rings ? (z[ring] + z[ring + 1]) / 2 : (z[ring] + model.lengthM) / 2;
    const radius = linear(model.profileZM, model.profileRadiusM, z[ring]);
    const area = ((to - from) * 2 * Math.PI * radius) / grid.paths;
    out.fill(area, ring * grid.paths, (ring + 1) * grid.paths);
  }
  return out;
}
