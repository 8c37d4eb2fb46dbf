import type { CameraShift } from "../api/gen/taclink/v1/tactile_pb";
import { fixed } from "./format";

const TINY = 5e-4; // below that, a standard deviation of a lens coefficient needs an exponent

/** A parameter of a camera with its standard deviation, in mm, degrees and px. */
export function parameterText(unit: string, value: number, sigma: number): string {
  const [factor, name] =
    unit === "m" ? [1e3, "mm"] : unit === "rad" ? [180 / Math.PI, "°"] : [1, unit === "1" ? "" : unit];
  const tiny = unit.startsWith("px^") || (unit === "1" && sigma > 0 && sigma < TINY);
  const text = tiny
    ? `${value.toExponential(3)} ± ${sigma.toExponential(1)}`
    : `${fixed(value * factor, 3)} ± ${fixed(sigma * factor, 3)}`;
  return `${text} ${name}`.trim();
}

/** By how much a camera has moved since the calibration before. */
export function shiftText(shift: Pick<CameraShift, "movedM" | "turnedRad" | "isLarge">): string {
  const text = `moved by ${fixed(shift.movedM * 1e3, 2)} mm, turned by ${fixed((shift.turnedRad * 180) / Math.PI, 2)}° since the calibration before`;
  return shift.isLarge ? `${text}: it was mounted again, or knocked` : text;
}
