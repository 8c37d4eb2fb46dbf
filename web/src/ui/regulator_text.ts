import { RegulatorState, type PressureRegulator } from "../api/gen/taclink/v1/pressure_pb";
import { fixed, PASCALS_PER_KPA } from "./format";

const STATE_WORDS: Record<RegulatorState, string> = {
  [RegulatorState.UNSPECIFIED]: "unknown",
  [RegulatorState.CLOSED]: "closed and vented",
  [RegulatorState.HOLDING]: "holding",
  [RegulatorState.RAMPING]: "ramping",
  [RegulatorState.TRIPPED]: "tripped, closed and vented",
};

/** A state and the setpoint: "ramping, setpoint 0.500 kPa on its way to 1.500 kPa at 0.5 kPa/s". */
export function regulatorText(regulator: PressureRegulator): string {
  const kpa = (pascals: number) => `${fixed(pascals / PASCALS_PER_KPA, 3)} kPa`;
  const { setpointPa, targetPa, rampPaPerS } = regulator;
  let text = STATE_WORDS[regulator.state] ?? STATE_WORDS[RegulatorState.UNSPECIFIED];
  if (setpointPa === undefined || targetPa === undefined) return text;
  text += `, setpoint ${kpa(setpointPa)}`;
  if (setpointPa === targetPa) return text;
  return `${text} on its way to ${kpa(targetPa)} at ${rampPaPerS / PASCALS_PER_KPA} kPa/s`;
}

/** The newest reading; one that is older than a second says so. */
export function readingText({ measuredPa, ageS }: PressureRegulator): string {
  if (measuredPa === undefined) return "no reading";
  const age = ageS !== undefined && ageS > 1 ? `, ${fixed(ageS, 1)} s old` : "";
  return `${fixed(measuredPa / PASCALS_PER_KPA, 3)} kPa${age}`;
}
