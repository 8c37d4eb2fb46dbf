import { create } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { LinkModelSchema, type LinkModel } from "../src/api/gen/taclink/v1/arm_pb";
import { LinkFrameSchema } from "../src/api/gen/taclink/v1/frame_pb";
import { colourIndex, colourTable, COLOUR_MAPS, roundUp, StickyRange } from "../src/skin/colour_map";
import { markerAreas, MarkerFields } from "../src/skin/fields";
import { clampedWeights, linear, periodicWeights } from "../src/skin/interpolation";
import { SkinSurface } from "../src/skin/surface";
import { outlineFlat, sampleFlat } from "../src/skin/unroll";

const LENGTH = 0.2;
const RADIUS = 0.05;
const PATHS = 16;
const RINGS = 9;

function cylinder(): LinkModel {
  const ringZM = Array.from({ length: RINGS }, (_, i) => (LENGTH * (i + 1)) / (RINGS + 1));
  const restPositionsM = ringZM.flatMap((z) =>
    Array.from({ length: PATHS }, (_, i) => {
      const angle = (2 * Math.PI * i) / PATHS;
      return [RADIUS * Math.cos(angle), RADIUS * Math.sin(angle), z];
    }).flat(),
  );
  return create(LinkModelSchema, {
    lengthM: LENGTH,
    profileZM: [0, LENGTH],
    profileRadiusM: [RADIUS, RADIUS],
    markers: { paths: PATHS, rings: RINGS, firstPathAngleRad: 0, ringZM, restPositionsM },
  });
}

function apply(weights: { index: number[]; weight: number[] }, samples: number[]): number {
  return weights.index.reduce((sum, at, k) => sum + weights.weight[k] * samples[at], 0);
}

describe("interpolation", () => {
  test("goes through the samples", () => {
    const samples = [3, 1, 4, 1, 5, 9];
    for (let i = 0; i < 6; ++i) expect(apply(periodicWeights(6, i), samples)).toBeCloseTo(samples[i], 12);
    const places = [1, 2, 4, 5, 7, 8];
    for (let i = 0; i < 6; ++i)
      expect(apply(clampedWeights(places, 10, places[i]), samples)).toBeCloseTo(samples[i], 12);
  });
  test("follows a wave around the axis to a thousandth", () => {
    const samples = Array.from({ length: 16 }, (_, i) => Math.cos((2 * Math.PI * i) / 16));
    for (let place = 0; place < 16; place += 0.13)
      expect(
        Math.abs(apply(periodicWeights(16, place), samples) - Math.cos((2 * Math.PI * place) / 16)),
      ).toBeLessThan(3e-3);
  });
  test("is 0 at the clamped ends", () => {
    expect(apply(clampedWeights([1, 2, 3], 4, 0), [5, 6, 7])).toBe(0);
    expect(apply(clampedWeights([1, 2, 3], 4, 4), [5, 6, 7])).toBe(0);
  });
  test("linear is constant outside", () => {
    expect([-1, 0, 0.5, 3].map((x) => linear([0, 1], [10, 20], x))).toEqual([10, 10, 15, 20]);
  });
});

describe("surface", () => {
  test("at rest is the profile, with outward normals", () => {
    const surface = new SkinSurface(cylinder());
    for (let v = 0; v < surface.values.length; ++v) {
      const [x, y] = [surface.positions[3 * v], surface.positions[3 * v + 1]];
      expect(Math.hypot(x, y)).toBeCloseTo(RADIUS, 6);
      expect((surface.normals[3 * v] * x + surface.normals[3 * v + 1] * y) / RADIUS).toBeCloseTo(1, 5);
    }
  });
  test("goes through the displaced markers and stays at the ends", () => {
    const model = cylinder();
    const surface = new SkinSurface(model, { around: PATHS, along: 10 * (RINGS + 1) });
    const d = new Float64Array(3 * PATHS * RINGS);
    const marker = 4 * PATHS + 3;
    d.set([0.001, -0.002, 0.003], 3 * marker);
    surface.update(d, undefined);
    const vertex = 50 * PATHS + 3;
    const rest = model.markers!.restPositionsM;
    for (let axis = 0; axis < 3; ++axis)
      expect(surface.positions[3 * vertex + axis]).toBeCloseTo(
        rest[3 * marker + axis] + d[3 * marker + axis],
        6,
      );
    expect(surface.positions[2]).toBe(0);
  });
  test("its triangles look outside", () => {
    const surface = new SkinSurface(cylinder());
    const [a, b, c] = surface.indices;
    const p = (v: number) => [0, 1, 2].map((axis) => surface.positions[3 * v + axis]);
    const [pa, pb, pc] = [p(a), p(b), p(c)];
    const u = pb.map((x, i) => x - pa[i]);
    const w = pc.map((x, i) => x - pa[i]);
    const normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
    expect(normal[0] * pa[0] + normal[1] * pa[1]).toBeGreaterThan(0);
  });
});

describe("fields", () => {
  test("the markers' areas are the skin's", () => {
    const sum = markerAreas(cylinder()).reduce((a, b) => a + b, 0);
    expect(sum).toBeCloseTo(2 * Math.PI * RADIUS * (LENGTH - LENGTH / (RINGS + 1)), 6);
  });
  test("pressure is the inward force over the area, and only that", () => {
    const model = cylinder();
    const marker = 4 * PATHS; // at +x
    const nodalForcesN = new Array<number>(3 * PATHS * RINGS).fill(0);
    nodalForcesN[3 * marker] = -0.5;
    nodalForcesN[3 * marker + 2] = 3; // along the axis: no pressure
    nodalForcesN[3 * (marker + PATHS)] = 2; // pulls outwards
    const frame = create(LinkFrameSchema, { positionsM: model.markers!.restPositionsM, nodalForcesN });
    const values = new MarkerFields(model).values(frame, "pressure");
    expect(values[marker]).toBeCloseTo(0.5 / markerAreas(model)[marker], 3);
    expect(values[marker + PATHS]).toBe(0);
  });
  test("displacement falls back on positions where a frame has no more", () => {
    const model = cylinder();
    const positionsM = model.markers!.restPositionsM.map((x, i) => (i === 5 ? x + 0.004 : x));
    const values = new MarkerFields(model).values(create(LinkFrameSchema, { positionsM }), "displacement");
    expect(values[1]).toBeCloseTo(0.004, 6);
  });
});

describe("colours", () => {
  // `skin` gets darker, the others lighter.
  test.each(COLOUR_MAPS)("the lightness of %s goes one way", (name) => {
    const table = colourTable(name);
    const luminances = Array.from({ length: 18 }, (_, step) => {
      const [r, g, b] = table.slice(45 * step, 45 * step + 3);
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    });
    if (name === "skin") luminances.reverse();
    for (let i = 1; i < luminances.length; ++i) expect(luminances[i]).toBeGreaterThan(luminances[i - 1]);
  });
  test("values outside the scale get its ends", () => {
    expect([-1, 0, 5, 10, 99].map((value) => colourIndex(value, 10))).toEqual([0, 0, 128, 255, 255]);
  });
  test("a scale grows in round steps and never falls", () => {
    const range = new StickyRange(10);
    expect(range.include(9)).toBe(false);
    expect(range.include(11)).toBe(true);
    expect(range.top).toBe(20);
    expect(range.include(3)).toBe(false);
    expect(range.include(NaN)).toBe(false);
    expect([0.03, 1, 1.2, 2, 49, 1000].map(roundUp)).toEqual([0.05, 1, 2, 2, 50, 1000]);
  });
});

describe("flat map", () => {
  const grid = { paths: PATHS, rings: RINGS };
  const values = new Float64Array(PATHS * RINGS);
  values[4 * PATHS] = 10; // path 0: the map's seam goes through its contact
  test("a marker's value is in the middle of its cell, also across the seam", () => {
    expect(sampleFlat(values, grid, 0.5, 4.5)).toBeCloseTo(10, 12);
    expect(sampleFlat(values, grid, PATHS + 0.5, 4.5)).toBeCloseTo(10, 12);
    expect(sampleFlat(values, grid, 0.5, 6.5)).toBe(0);
  });
  test("an outline lies over its markers and does not jump at the seam", () => {
    const ringZM = [0.01, 0.03, 0.05];
    const at = (path: number, z: number) => {
      const angle = (2 * Math.PI * path) / PATHS;
      return [0.04 * Math.cos(angle), 0.04 * Math.sin(angle), z];
    };
    const corners = [at(-1, 0.01), at(1, 0.01), at(1, 0.04), at(-1, 0.06)].flat();
    const flat = outlineFlat(corners, { paths: PATHS, firstPathAngleRad: 0, ringZM });
    const expected = [
      [PATHS - 0.5, 0.5],
      [PATHS + 1.5, 0.5],
      [PATHS + 1.5, 2],
      [PATHS - 0.5, 3],
    ];
    flat.forEach((corner, i) =>
      corner.forEach((value, axis) => expect(value).toBeCloseTo(expected[i][axis], 9)),
    );
    expect(outlineFlat([], { paths: PATHS, firstPathAngleRad: 0, ringZM })).toEqual([]);
  });
});
