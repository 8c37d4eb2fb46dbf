import type { LinkModel } from "../api/gen/taclink/v1/arm_pb";
import { clampedWeights, linear, periodicWeights, type Weights } from "./interpolation";

/**
 * The outer surface of a skin as a mesh, link frame, m: `rows` x `columns` vertices, row by row along the axis, column 0 at
 * the angle of path 0. Between the markers displacements and values are interpolated with cubics; the clamped ends do not
 * move.
 */
export class SkinSurface {
  readonly columns: number;
  readonly rows: number;
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** A number for each vertex, of what `update` was given for each marker. */
  readonly values: Float32Array;
  readonly indices: Uint32Array;

  private readonly rest: Float32Array;
  private readonly rowWeights: Weights[];
  private readonly columnWeights: Weights[];
  private readonly paths: number;
  private readonly between: Float32Array; // rows x paths x 4: displacement and value

  constructor(model: LinkModel, vertices = { around: 72, along: 48 }) {
    const grid = model.markers!;
    this.paths = grid.paths;
    this.columns = Math.max(1, Math.round(vertices.around / grid.paths)) * grid.paths;
    this.rows = vertices.along + 1;
    const count = this.rows * this.columns;
    this.positions = new Float32Array(3 * count);
    this.normals = new Float32Array(3 * count);
    this.values = new Float32Array(count);
    this.rest = restSurface(model, this.rows, this.columns);
    this.indices = gridIndices(this.rows, this.columns);
    this.rowWeights = Array.from({ length: this.rows }, (_, row) =>
      clampedWeights(grid.ringZM, model.lengthM, (row / (this.rows - 1)) * model.lengthM),
    );
    this.columnWeights = Array.from({ length: this.columns }, (_, column) =>
      periodicWeights(this.paths, (column / this.columns) * this.paths),
    );
    this.between = new Float32Array(this.rows * this.paths * 4);
    this.update(undefined, undefined);
  }

  /** Of each vertex: part of the way around, and along; 0 to 1. */
  gridPlaces(): Float32Array {
    const out = new Float32Array(2 * this.rows * this.columns);
    for (let row = 0; row < this.rows; ++row)
      for (let column = 0; column < this.columns; ++column)
        out.set([column / this.columns, row / (this.rows - 1)], 2 * (row * this.columns + column));
    return out;
  }

  /**
   * Of each marker, in their order: displacement (x, y, z), m, and a value. Without them: at rest, 0. `scale`: of the
   * displacements.
   */
  update(
    displacements: ArrayLike<number> | undefined,
    values: ArrayLike<number> | undefined,
    scale = 1,
  ): void {
    this.alongAxis(displacements, values, scale);
    this.aroundAxis();
    gridNormals(this.positions, this.rows, this.columns, this.normals);
  }

  private alongAxis(
    displacements: ArrayLike<number> | undefined,
    values: ArrayLike<number> | undefined,
    scale: number,
  ): void {
    const { between, paths } = this;
    between.fill(0);
    for (let row = 0; row < this.rows; ++row) {
      const { index, weight } = this.rowWeights[row];
      for (let k = 0; k < index.length; ++k) {
        for (let path = 0; path < paths; ++path) {
          const marker = index[k] * paths + path;
          const to = 4 * (row * paths + path);
          if (displacements)
            for (let axis = 0; axis < 3; ++axis)
              between[to + axis] += scale * weight[k] * displacements[3 * marker + axis];
          if (values) between[to + 3] += weight[k] * values[marker];
        }
      }
    }
  }

  private aroundAxis(): void {
    const { between, paths, positions, rest, values } = this;
    for (let row = 0; row < this.rows; ++row) {
      for (let column = 0; column < this.columns; ++column) {
        const { index, weight } = this.columnWeights[column];
        let x = 0;
        let y = 0;
        let z = 0;
        let value = 0;
        for (let k = 0; k < 4; ++k) {
          const from = 4 * (row * paths + index[k]);
          x += weight[k] * between[from];
          y += weight[k] * between[from + 1];
          z += weight[k] * between[from + 2];
          value += weight[k] * between[from + 3];
        }
        const vertex = row * this.columns + column;
        positions[3 * vertex] = rest[3 * vertex] + x;
        positions[3 * vertex + 1] = rest[3 * vertex + 1] + y;
        positions[3 * vertex + 2] = rest[3 * vertex + 2] + z;
        values[vertex] = Math.max(0, value);
      }
    }
  }
}

function restSurface(model: LinkModel, rows: number, columns: number): Float32Array {
  const out = new Float32Array(3 * rows * columns);
  const first = model.markers!.firstPathAngleRad;
  for (let row = 0; row < rows; ++row) {
    const z = (row / (rows - 1)) * model.lengthM;
    const radius = linear(model.profileZM, model.profileRadiusM, z);
    for (let column = 0; column < columns; ++column) {
      const angle = first + (column / columns) * 2 * Math.PI;
      out.set([radius * Math.cos(angle), radius * Math.sin(angle), z], 3 * (row * columns + column));
    }
  }
  return out;
}

/** Two triangles a cell, seen from outside counter-clockwise; the last column meets the first. */
function gridIndices(rows: number, columns: number): Uint32Array {
  const out = new Uint32Array(6 * (rows - 1) * columns);
  let next = 0;
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      const a = row * columns + column;
      const b = row * columns + ((column + 1) % columns);
      const c = a + columns;
      const d = b + columns;
      for (const vertex of [a, b, d, a, d, c]) out[next++] = vertex;
    }
  }
  return out;
}

/** Unit normals, away from the axis, of a grid that closes around: by central differences. */
export function gridNormals(
  positions: ArrayLike<number>,
  rows: number,
  columns: number,
  out: Float32Array | Float64Array,
): void {
  for (let row = 0; row < rows; ++row) {
    const below = Math.max(0, row - 1) * columns;
    const above = Math.min(rows - 1, row + 1) * columns;
    for (let column = 0; column < columns; ++column) {
      const left = 3 * (row * columns + ((column + columns - 1) % columns));
      const right = 3 * (row * columns + ((column + 1) % columns));
      const down = 3 * (below + column);
      const up = 3 * (above + column);
      const ax = positions[right] - positions[left];
      const ay = positions[right + 1] - positions[left + 1];
      const az = positions[right + 2] - positions[left + 2];
      const bx = positions[up] - positions[down];
      const by = positions[up + 1] - positions[down + 1];
      const bz = positions[up + 2] - positions[down + 2];
      const nx = ay * bz - az * by;
      const ny = az * bx - ax * bz;
      const nz = ax * by - ay * bx;
      const length = Math.hypot(nx, ny, nz) || 1;
      const to = 3 * (row * columns + column);
      out[to] = nx / length;
      out[to + 1] = ny / length;
      out[to + 2] = nz / length;
    }
  }
}
