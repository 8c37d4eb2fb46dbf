/** Weights of the samples that an interpolated value is the sum of. */
export interface Weights {
  index: number[];
  weight: number[];
}

/** Periodic Catmull-Rom between `count` equidistant samples, at `place` in units of their distance. */
export function periodicWeights(count: number, place: number): Weights {
  const left = Math.floor(place);
  const t = place - left;
  const weight = [
    -0.5 * t + t * t - 0.5 * t ** 3,
    1 - 2.5 * t * t + 1.5 * t ** 3,
    0.5 * t + 2 * t * t - 1.5 * t ** 3,
    -0.5 * t * t + 0.5 * t ** 3,
  ];
  const index = [-1, 0, 1, 2].map((step) => (((left + step) % count) + count) % count);
  return { index, weight };
}

/**
 * Cubic Hermite, slopes by central differences, along an axis whose inner places are `places` (rising, within 0 and
 * `length`) and whose ends are held at 0. At `z`, in the units of the places. Weights of the inner samples only.
 */
export function clampedWeights(places: readonly number[], length: number, z: number): Weights {
  const knots = [0, ...places, length];
  const last = knots.length - 1;
  let left = 0;
  while (left < last - 1 && z > knots[left + 1]) ++left;
  const width = knots[left + 1] - knots[left];
  const t = Math.min(1, Math.max(0, (z - knots[left]) / width));
  const weights = new Array<number>(knots.length).fill(0);
  const h10 = t * (1 - t) ** 2;
  const h11 = t * t * (t - 1);
  weights[left] += (1 + 2 * t) * (1 - t) ** 2;
  weights[left + 1] += t * t * (3 - 2 * t);
  const addSlope = (knot: number, factor: number) => {
    const before = Math.max(0, knot - 1);
    const after = Math.min(last, knot + 1);
    const slope = (factor * width) / (knots[after] - knots[before]);
    weights[after] += slope;
    weights[before] -= slope;
  };
  addSlope(left, h10);
  addSlope(left + 1, h11);
  const out: Weights = { index: [], weight: [] };
  for (let knot = 1; knot < last; ++knot) {
    if (weights[knot] === 0) continue;
    out.index.push(knot - 1);
    out.weight.push(weights[knot]);
  }
  return out;
}

/** Piecewise linear, constant outside. `xs` rises. */
export function linear(xs: readonly number[], ys: readonly number[], x: number): number {
  if (xs.length === 0) return 0;
  if (x <= xs[0]) return ys[0];
  for (let i = 1; i < xs.length; ++i)
    if (x <= xs[i]) return ys[i - 1] + ((ys[i] - ys[i - 1]) * (x - xs[i - 1])) / (xs[i] - xs[i - 1]);
  return ys[ys.length - 1];
}
