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

/** What `outlineFlat` needs of a link's marker grid. */
export interface FlatPlaces {
  paths: number;
  firstPathAngleRad: number;
  ringZM: readonly number[];
}

/**
 * A contact's outline (x, y, z of each corner; link frame, m) on the map: path and ring of each corner in units of
 * cells, as `sampleFlat` has them. Corners follow each other without a jump at the seam, so that paths may lie beyond
 * 0 or the last one.
 */
export function outlineFlat(outlineM: ArrayLike<number>, places: FlatPlaces): [path: number, ring: number][] {
  const out: [number, number][] = [];
  const { paths } = places;
  for (let i = 0; i + 2 < outlineM.length; i += 3) {
    const angle = Math.atan2(outlineM[i + 1], outlineM[i]) - places.firstPathAngleRad;
    let path = (angle / (2 * Math.PI)) * paths + 0.5;
    path -=
      paths *
      (out.length === 0 ? Math.floor(path / paths) : Math.round((path - out[out.length - 1][0]) / paths));
    out.push([path, ringAt(outlineM[i + 2], places.ringZM) + 0.5]);
  }
  return out;
}

// Linear between the rings and beyond the first and last one.
function ringAt(z: number, ringZM: readonly number[]): number {
  let low = 0;
  while (low + 2 < ringZM.length && z > ringZM[low + 1]) ++low;
  return low + (z - ringZM[low]) / (ringZM[low + 1] - ringZM[low]);
}
