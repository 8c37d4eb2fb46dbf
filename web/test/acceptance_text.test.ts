import { create } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { AcceptanceSummarySchema, AcceptanceVerdict } from "../src/api/gen/taclink/v1/arm_pb";
import {
  AcceptanceQuantitySchema,
  AcceptanceTrialSchema,
  TrialKind,
} from "../src/api/gen/taclink/v1/acceptance_pb";
import { quantityText, resultText, summaryText, trialText } from "../src/ui/acceptance_text";

const trialOf = (fields: object) =>
  create(AcceptanceTrialSchema, { kind: TrialKind.LOAD, path: 6, ring: 4, forceN: 0.49, ...fields });

describe("acceptance", () => {
  test("a trial says what to do, its conditions only where they change", () => {
    const trial = trialOf({ pressurePa: 1000 });
    expect(trialText(trial, undefined)).toBe(
      "Set the pressure to 1.00 kPa. Put 0.490 N (50.0 g) on the marker at path 6, ring 4.",
    );
    expect(trialText(trial, trial)).toBe("Put 0.490 N (50.0 g) on the marker at path 6, ring 4.");
    const step = create(AcceptanceTrialSchema, { kind: TrialKind.PRESSURE, pressurePa: 500 });
    expect(trialText(step, trial)).toBe("Set the pressure to 0.50 kPa. Nothing may touch the link.");
  });
  test("a result compares with the reference, and says why there is none", () => {
    const loaded = { frames: 30, usableFrames: 30, hasContact: true, forceN: 0.51 };
    expect(resultText(trialOf({ loaded, reference: { forceN: 0.5 } }))).toBe("0.510 N, +2.0 %");
    expect(resultText(trialOf({ loaded: { ...loaded, hasContact: false } }))).toBe("nothing was felt there");
    const blind = { frames: 30, usableFrames: 3, reasons: [{ name: "camera", text: "no image" }] };
    expect(resultText(trialOf({ loaded: blind }))).toBe("not measured: no image");
  });
  test("the summary has its numbers and says when it is outdated", () => {
    const summary = create(AcceptanceSummarySchema, {
      verdict: AcceptanceVerdict.FAILED,
      finishedUtcNs: 1n,
      forceBias: -0.052,
      forceBiasHalfWidth: 0.011,
      placeError95M: 0.0021,
      outdated: "the cameras were calibrated again since",
    });
    expect(summaryText(summary)).toMatch(
      /^Failed on .*: force -5\.2 ± 1\.1 %, place 2\.1 mm\. Outdated: the cameras/,
    );
  });
  test("a quantity has its interval and limit", () => {
    const quantity = create(AcceptanceQuantitySchema, {
      value: 1.2345,
      unit: "%",
      low: -0.5,
      high: 3,
      limit: 6,
    });
    expect(quantityText(quantity)).toBe("1.23 % (-0.5 to 3), limit 6");
  });
});
