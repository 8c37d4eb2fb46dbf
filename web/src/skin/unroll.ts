import { colourIndex } from "./colour_map";
import { periodicWeights } from "./interpolation";

/** The marker grid laid flat: path from left to right, ring 0 at the bottom; a marker is in the middle of its cell. */
export interface FlatGrid {
  paths: number;
  rings: number;
}

/** Of a value per marker, at a place in units of cells, both from 0; linear along the axis, cubic around it, never negative. */
export function sampleFlat(
  values: ArrayLike<number>,
  { paths, rings }: FlatGrid,
  path: number,
  ring: number,
): number {
  const { index, weight } = periodicWeights(paths, path - 0.5);
  const at = Math.min(rings - 1, Math.max(0, ring - 0.5));
  const low = Math.min(rings - 1, Math.floor(at));
  const high = Math.min(rings - 1, low + 1);
  const t = at - low;
  let sum = 0;
  for (let k = 0; k < 4; ++k)
    sum += weight[k] * ((1 - t) * values[low * paths + index[k]] + t * values[high * paths + index[k]]);
  return Math.max(0, sum);
}

/** Fills `pixels` (RGBA, top row first) with the map of `values`. `table`: 256 colours, RGB bytes. */
export function paintFlat(
  pixels: Uint8ClampedArray,
  width: number,
  height: number,
  values: ArrayLike<number>,
  grid: FlatGrid,
  table: Uint8Array,
  range: number,
): void {
  for (let y = 0; y < height; ++y) {
    const ring = (1 - (y + 0.5) / height) * grid.rings;
    for (let x = 0; x < width; ++x) {
      const path = ((x + 0.5) / width) * grid.paths;
      const from = 3 * colourIndex(sampleFlat(values, grid, path, ring), range);
      const to = 4 * (y * width + x);
      pixels[to] = table[from];
      pixels[to + 1] = table[from + 1];
      pixels[to + 2] = table[from + 2];
      pixels[to + 3] = 255;
    }
  }
}

/** Line segments (x0, y0, x1, y1 in cells) where `values` passes `level`: marching squares, three steps a cell. */
export function contourFlat(values: ArrayLike<number>, grid: FlatGrid, level: number, fine = 3): number[] {
  const columns = grid.paths * fine;
  const rows = grid.rings * fine;
  const samples = new Float64Array((columns + 1) * (rows + 1));
  for (let row = 0; row <= rows; ++row)
    for (let column = 0; column <= columns; ++column)
      samples[row * (columns + 1) + column] = sampleFlat(values, grid, column / fine, row / fine) - level;
  const out: number[] = [];
  const at = (column: number, row: number) => samples[row * (columns + 1) + column];
  for (let row = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      const corners = [at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)];
      const places = [
        [column, row],
        [column + 1, row],
        [column + 1, row + 1],
        [column, row + 1],
      ];
      const cuts: number[] = [];
      for (let edge = 0; edge < 4; ++edge) {
        const a = corners[edge];
        const b = corners[(edge + 1) % 4];
        if (a > 0 === b > 0) continue;
        const t = a / (a - b);
        const [ax, ay] = places[edge];
        const [bx, by] = places[(edge + 1) % 4];
        cuts.push((ax + t * (bx - ax)) / fine, (ay + t * (by - ay)) / fine);
      }
      for (let cut = 0; cut + 3 < cuts.length; cut += 4) out.push(...cuts.slice(cut, cut + 4));
    }
  }
  return out;
}
