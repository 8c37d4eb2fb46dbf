import { AcceptanceVerdict, type AcceptanceSummary } from "../api/gen/taclink/v1/arm_pb";
import {
  QuantityVerdict,
  TrialKind,
  type Acceptance,
  type AcceptanceQuantity,
  type AcceptanceTrial,
  type TrialReading,
} from "../api/gen/taclink/v1/acceptance_pb";
import { dateTime, fixed, PASCALS_PER_KPA, secondsOf } from "./format";

const GRAMS_PER_NEWTON = 1000 / 9.80665;

const VERDICTS: Record<AcceptanceVerdict, string> = {
  [AcceptanceVerdict.UNSPECIFIED]: "unknown",
  [AcceptanceVerdict.PASSED]: "passed",
  [AcceptanceVerdict.FAILED]: "failed",
  [AcceptanceVerdict.UNDECIDED]: "undecided",
};

/** "Passed on 2026-11-30 12:00:00: force +1.2 ± 2.0 %, place 2.1 mm." */
export function summaryText(summary: AcceptanceSummary): string {
  const verdict = VERDICTS[summary.verdict];
  const numbers = [
    summary.forceBias !== undefined &&
      `force ${signed(100 * summary.forceBias)}${summary.forceBiasHalfWidth !== undefined ? ` ± ${fixed(100 * summary.forceBiasHalfWidth, 1)}` : ""} %`,
    summary.placeError95M !== undefined && `place ${fixed(1e3 * summary.placeError95M, 1)} mm`,
  ].filter((part) => part !== false);
  const head = `${verdict[0].toUpperCase()}${verdict.slice(1)} on ${dateTime(secondsOf(summary.finishedUtcNs))}`;
  return `${head}${numbers.length > 0 ? `: ${numbers.join(", ")}` : ""}.${summary.outdated ? ` Outdated: ${summary.outdated}.` : ""}`;
}

export function verdictText(acceptance: Acceptance): string {
  return VERDICTS[acceptance.report?.verdict ?? AcceptanceVerdict.UNSPECIFIED];
}

/** What a person does for a trial; `before`: the trial before it. */
export function trialText(trial: AcceptanceTrial, before: AcceptanceTrial | undefined): string {
  const conditions: string[] = [];
  if (trial.attitude && trial.attitude !== before?.attitude)
    conditions.push(`Bring the link into the attitude "${trial.attitude}".`);
  if (trial.pressurePa !== undefined && trial.pressurePa !== before?.pressurePa)
    conditions.push(`Set the pressure to ${fixed(trial.pressurePa / PASCALS_PER_KPA, 2)} kPa.`);
  if (trial.kind === TrialKind.PRESSURE) return [...conditions, "Nothing may touch the link."].join(" ");
  const force = trial.forceN ?? 0;
  const place = trial.path > 0 ? ` on the marker at path ${trial.path}, ring ${trial.ring}` : "";
  const hold = trial.kind === TrialKind.HOLD ? ` It stays for ${fixed(trial.holdS, 0)} s.` : "";
  return [
    ...conditions,
    `Put ${fixed(force, 3)} N (${fixed(force * GRAMS_PER_NEWTON, 1)} g)${place}.${hold}`,
  ].join(" ");
}

/** What came of a trial. */
export function resultText(trial: AcceptanceTrial): string {
  const reading: TrialReading | undefined = trial.loaded;
  if (!reading) return "";
  if (reading.usableFrames === 0 || 2 * reading.usableFrames < reading.frames)
    return `not measured: ${reading.reasons[0]?.text ?? "the link has no forces"}`;
  if (trial.kind === TrialKind.PRESSURE)
    return `the sensor says ${fixed((reading.pressurePa ?? NaN) / PASCALS_PER_KPA, 3)} kPa`;
  if (!reading.hasContact) return "nothing was felt there";
  const reference = trial.reference?.forceN ?? trial.forceN;
  const off = reference ? `, ${signed(100 * (reading.forceN / reference - 1))} %` : "";
  return `${fixed(reading.forceN, 3)} N${off}`;
}

export function quantityText(quantity: AcceptanceQuantity): string {
  const interval =
    quantity.low !== undefined && quantity.high !== undefined
      ? ` (${digits(quantity.low)} to ${digits(quantity.high)})`
      : "";
  const limit = quantity.limit !== undefined ? `, limit ${digits(quantity.limit)}` : "";
  return `${digits(quantity.value)} ${quantity.unit}${interval}${limit}`;
}

export function isMeasured(quantity: AcceptanceQuantity): boolean {
  return quantity.verdict !== QuantityVerdict.NOT_MEASURED;
}

const signed = (value: number) => `${value >= 0 ? "+" : ""}${fixed(value, 1)}`;
const digits = (value: number) => String(Number(value.toPrecision(3)));
