/**
 * Colour maps of even lightness, also for colour-blind people. sRGB, 0 to 255. `skin` begins at the colour of the silicone
 * and gets darker, so that only what is pressed has a colour; the others go from dark to bright.
 */
const STOPS = {
  skin: "e6e1d8 f6dca0 fcc365 fba03f f47a2a e2541f c5331f a01b2a 76103a 4b0a3f",
  cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
  viridis: "440154 482878 3e4a89 31688e 26828e 1f9e89 35b779 6dcd59 b4de2c fde725",
  inferno: "000004 1b0c41 4a0c6b 781c6d a52c60 cf4446 ed6925 fb9b06 f7d13d fcffa4",
} as const;

export type ColourMapName = keyof typeof STOPS;
export const COLOUR_MAPS = Object.keys(STOPS) as ColourMapName[];
const SIZE = 256;

/** 256 colours, three bytes each. */
export function colourTable(name: ColourMapName): Uint8Array {
  const digits = STOPS[name].replaceAll(" ", "");
  const stops = digits.length / 6;
  const byte = (stop: number, channel: number) =>
    parseInt(digits.substring(6 * stop + 2 * channel, 6 * stop + 2 * channel + 2), 16);
  const out = new Uint8Array(3 * SIZE);
  for (let i = 0; i < SIZE; ++i) {
    const place = (i / (SIZE - 1)) * (stops - 1);
    const left = Math.min(stops - 2, Math.floor(place));
    for (let channel = 0; channel < 3; ++channel) {
      const a = byte(left, channel);
      out[3 * i + channel] = Math.round(a + (byte(left + 1, channel) - a) * (place - left));
    }
  }
  return out;
}

/** Place of a value in the table. */
export function colourIndex(value: number, range: number): number {
  return Math.max(0, Math.min(SIZE - 1, Math.round((value / range) * (SIZE - 1))));
}

/** Of lines over the colours of no load. */
export function inkOn(name: ColourMapName): string {
  return name === "skin" ? "#16202b" : "#ffffff";
}

/** CSS, from no load to the most. */
export function gradientOf(name: ColourMapName, direction = "to right"): string {
  const table = colourTable(name);
  const stops = Array.from({ length: 11 }, (_, i) => {
    const at = 3 * Math.round((i / 10) * (SIZE - 1));
    return `rgb(${table[at]} ${table[at + 1]} ${table[at + 2]})`;
  });
  return `linear-gradient(${direction}, ${stops.join(", ")})`;
}

/** The next of 1, 2, 5, 10, 20, ... that is not below `value`. */
export function roundUp(value: number): number {
  if (!(value > 0)) return 1;
  const decade = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 2, 5]) if (value <= step * decade * (1 + 1e-9)) return step * decade;
  return 10 * decade;
}

/** The top of a colour scale: grows in round steps, never falls by itself, so that a colour keeps its meaning. */
export class StickyRange {
  constructor(public top: number) {}

  /** Whether it has grown. */
  include(value: number): boolean {
    if (!(value > this.top) || !Number.isFinite(value)) return false;
    this.top = roundUp(value);
    return true;
  }
}
