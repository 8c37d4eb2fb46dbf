import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { LinkFrameSchema } from "../src/api/gen/taclink/v1/frame_pb";
import { magnitudeN, totalMagnitudeN } from "../src/model/magnitude";

test("forces from opposite sides do not cancel, and drag counts", () => {
  const ring = { normalForceN: 1.5, forceN: { x: 0.001 } };
  const dragged = { normalForceN: 0.1, forceN: { y: 0.5 } };
  const squeezed = [0.7, -0.7].map((x) => ({ normalForceN: 0.75, forceN: { x } }));
  const frame = create(LinkFrameSchema, { totalForceN: {}, contacts: [ring, dragged, ...squeezed] });
  expect(frame.contacts.map(magnitudeN)).toEqual([1.5, 0.5, 0.75, 0.75]);
  expect(totalMagnitudeN(frame)).toBeCloseTo(3.5);
});

test("no contacts are no force only where forces are known", () => {
  expect(totalMagnitudeN(create(LinkFrameSchema, { totalForceN: {} }))).toBe(0);
  expect(totalMagnitudeN(create(LinkFrameSchema, {}))).toBeNaN();
});
