/** Time, total (null: nothing was measured), and the contacts' ids and forces. */
export type Sample = [timeS: number, totalN: number | null, contacts: [id: string, forceN: number][]];

/** One link's forces over time, of bounded length. Times: s since 1970-01-01 UTC; forces: N. */
export class ForceHistory {
  private readonly times: Float64Array;
  private readonly totals: Float32Array;
  private readonly contacts: { id: string; forceN: number }[][];
  private next = 0;
  private count = 0;

  constructor(private readonly capacity = 40_000) {
    this.times = new Float64Array(capacity);
    this.totals = new Float32Array(capacity);
    this.contacts = new Array(capacity);
  }

  /** `totalN` NaN: nothing was measured. A time before the newest one starts again: the clock, or a replay, went back. */
  add(timeS: number, totalN: number, contacts: { id: string; forceN: number }[]): void {
    if (this.count > 0) {
      const newest = this.newestS;
      if (timeS === newest) return;
      if (timeS < newest) this.clear();
    }
    this.times[this.next] = timeS;
    this.totals[this.next] = totalN;
    this.contacts[this.next] = contacts;
    this.next = (this.next + 1) % this.capacity;
    this.count = Math.min(this.count + 1, this.capacity);
  }

  clear(): void {
    this.next = 0;
    this.count = 0;
  }

  get length(): number {
    return this.count;
  }

  get newestS(): number {
    return this.count === 0 ? NaN : this.times[(this.next - 1 + this.capacity) % this.capacity];
  }

  private place(index: number): number {
    return (this.next - this.count + index + this.capacity) % this.capacity;
  }

  /** The first sample not before `timeS`. */
  private find(timeS: number): number {
    let low = 0;
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[this.place(middle)] < timeS) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** All from `fromS` on, in their order. */
  samplesFrom(fromS: number): Sample[] {
    const out: Sample[] = [];
    this.each(fromS, Infinity, (place, timeS) => {
      const total = this.totals[place];
      const contacts = this.contacts[place].map(({ id, forceN }): [string, number] => [id, forceN]);
      out.push([timeS, Number.isNaN(total) ? null : total, contacts]);
    });
    return out;
  }

  /** Adds samples, in their order, where there are none yet. */
  merge(samples: readonly Sample[]): void {
    const own = this.samplesFrom(-Infinity);
    const all = [...own, ...samples.filter(([timeS]) => !this.has(timeS))].sort((a, b) => a[0] - b[0]);
    this.clear();
    for (const sample of all) this.addSample(sample);
  }

  // Half a microsecond: times are whole ones.
  private has(timeS: number): boolean {
    const index = this.find(timeS - 5e-7);
    return index < this.count && this.times[this.place(index)] < timeS + 5e-7;
  }

  private addSample([timeS, totalN, contacts]: Sample): void {
    this.add(
      timeS,
      totalN ?? NaN,
      contacts.map(([id, forceN]) => ({ id, forceN })),
    );
  }

  /** Calls `visit` for the samples from `fromS` to `toS`, both included, in their order. */
  private each(fromS: number, toS: number, visit: (place: number, timeS: number) => void): void {
    for (let i = this.find(fromS); i < this.count; ++i) {
      const place = this.place(i);
      if (this.times[place] > toS) return;
      visit(place, this.times[place]);
    }
  }

  /**
   * The largest total of each of `bins` equal parts of the time from `fromS` to `toS`: a peak is never lost. A part
   * without a sample holds the one before, for `holdS` at most (a link at rest tells its force once a second);
   * then null.
   */
  totalsIn(fromS: number, toS: number, bins: number, holdS: number): (number | null)[] {
    const out: (number | null)[] = new Array(bins).fill(null);
    const width = (toS - fromS) / bins;
    this.each(fromS - holdS, toS, (place, time) => {
      const bin = Math.min(bins - 1, Math.floor((time - fromS) / width));
      const value = this.totals[place];
      if (bin < 0) return;
      if (Number.isNaN(value)) return;
      const before = out[bin];
      out[bin] = before === null ? value : Math.max(before, value);
    });
    this.hold(out, fromS, width, holdS);
    return out;
  }

  private hold(out: (number | null)[], fromS: number, width: number, holdS: number): void {
    const first = this.find(fromS) - 1;
    let value: number | null = null;
    let since = -Infinity;
    if (first >= 0) {
      const place = this.place(first);
      if (!Number.isNaN(this.totals[place])) value = this.totals[place];
      since = this.times[place];
    }
    const newest = this.newestS;
    for (let bin = 0; bin < out.length; ++bin) {
      const start = fromS + bin * width;
      if (start > newest) return;
      if (out[bin] !== null) {
        value = out[bin];
        since = start;
      } else if (value !== null && start - since <= holdS) {
        out[bin] = value;
      }
    }
  }

  /** Forces of the contacts there were, by id, as totalsIn has them; the `most` strongest. */
  contactsIn(fromS: number, toS: number, bins: number, most: number): Map<string, (number | null)[]> {
    const all = new Map<string, (number | null)[]>();
    const peaks = new Map<string, number>();
    const width = (toS - fromS) / bins;
    this.each(fromS, toS, (place, time) => {
      const bin = Math.min(bins - 1, Math.floor((time - fromS) / width));
      for (const { id, forceN } of this.contacts[place]) {
        let series = all.get(id);
        if (!series) all.set(id, (series = new Array(bins).fill(null)));
        series[bin] = Math.max(series[bin] ?? 0, forceN);
        peaks.set(id, Math.max(peaks.get(id) ?? 0, forceN));
      }
    });
    const strongest = [...peaks].sort((a, b) => b[1] - a[1]).slice(0, most);
    const kept = strongest.map(([id]) => id).sort((a, b) => (BigInt(a) < BigInt(b) ? -1 : 1));
    return new Map(kept.map((id) => [id, all.get(id)!]));
  }
}

/** Middles of the bins, s. */
export function binTimes(fromS: number, toS: number, bins: number): number[] {
  const width = (toS - fromS) / bins;
  return Array.from({ length: bins }, (_, bin) => fromS + (bin + 0.5) * width);
}
