import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { PressureRegulatorSchema, RegulatorState } from "../src/api/gen/taclink/v1/pressure_pb";
import { readingText, regulatorText } from "../src/ui/regulator_text";

const regulator = (fields: object) => create(PressureRegulatorSchema, fields);

test("a closed regulator has no setpoint", () => {
  expect(regulatorText(regulator({ state: RegulatorState.CLOSED }))).toBe("closed and vented");
  expect(regulatorText(regulator({ state: RegulatorState.TRIPPED }))).toBe("tripped, closed and vented");
});

test("a ramp says where to and how fast", () => {
  const fields = { setpointPa: 500, targetPa: 1500, rampPaPerS: 500 };
  expect(regulatorText(regulator({ state: RegulatorState.RAMPING, ...fields }))).toBe(
    "ramping, setpoint 0.500 kPa on its way to 1.500 kPa at 0.5 kPa/s",
  );
  expect(regulatorText(regulator({ state: RegulatorState.HOLDING, ...fields, setpointPa: 1500 }))).toBe(
    "holding, setpoint 1.500 kPa",
  );
});

test("a state of a newer server is unknown", () => {
  expect(regulatorText(regulator({ state: 99 as RegulatorState }))).toBe("unknown");
});

test("a reading says when it is old", () => {
  expect(readingText(regulator({}))).toBe("no reading");
  expect(readingText(regulator({ measuredPa: 1234, ageS: 0.02 }))).toBe("1.234 kPa");
  expect(readingText(regulator({ measuredPa: 0, ageS: 3.21 }))).toBe("0.000 kPa, 3.2 s old");
});
