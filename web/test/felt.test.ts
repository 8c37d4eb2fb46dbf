import { create } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { LinkFrameSchema } from "../src/api/gen/taclink/v1/frame_pb";
import { feltOf } from "../src/model/felt";

const at = (x: number, y: number, z: number) => ({ x, y, z });

describe("what is felt of what users press", () => {
  test("is nothing where only the scene presses", () => {
    const contacts = [{ bodyId: 0n, centerM: at(0.04, 0, 0.1), forceN: at(-0.3, 0, 0) }];
    expect(feltOf(create(LinkFrameSchema, { simulation: { contacts } }))).toBeUndefined();
    expect(feltOf(undefined)).toBeUndefined();
  });
  test("sums a body's pieces, and leaves out the scene's contacts", () => {
    const frame = create(LinkFrameSchema, {
      simulation: {
        contacts: [
          { bodyId: 1n, centerM: at(0.04, 0, 0.1), forceN: at(-0.3, 0, 0) },
          { bodyId: 1n, centerM: at(-0.04, 0, 0.1), forceN: at(0.1, 0, 0) },
          { bodyId: 0n, centerM: at(0, 0.04, 0.03), forceN: at(0, -0.5, 0) },
        ],
      },
      contacts: [
        { id: 1n, centerM: at(0.04, 0, 0.102), normalForceN: 0.28 },
        { id: 2n, centerM: at(-0.04, 0, 0.102), normalForceN: 0.12 },
        { id: 3n, centerM: at(0, 0.04, 0.03), normalForceN: 0.5 },
      ],
    });
    const felt = feltOf(frame)!;
    expect(felt.trueN).toBeCloseTo(0.4);
    expect(felt.feltN).toBeCloseTo(0.4);
    expect(felt.offM).toBeCloseTo(Math.hypot(0.004, 0.002));
  });
  test("is nothing felt where no contact is near", () => {
    const frame = create(LinkFrameSchema, {
      simulation: { contacts: [{ bodyId: 1n, centerM: at(0.04, 0, 0.1), forceN: at(-0.3, 0, 0) }] },
      contacts: [{ id: 1n, centerM: at(0.04, 0, 0.15), normalForceN: 0.28 }],
    });
    expect(feltOf(frame)).toEqual({ trueN: expect.closeTo(0.3), feltN: 0, offM: NaN });
  });
});
