import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { FramePose } from "../api/gen/taclink/v1/contacts_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";
import type { StreamPreviewResponse } from "../api/gen/taclink/v1/preview_pb";

/** How far back the page can look, s. */
export const PAST_S = 300;
const MOST_MOMENTS = 4000; // of all links together: some 60 MB
const LEAST_PERIOD_S = 0.1;
const MOMENT_HOLDS_S = 3;
const CLOCK_BACK_S = 5; // less: a frame that was exposed before a report without one
const MOST_IMAGE_BYTES = 64e6;
const IMAGE_HOLDS_S = 2;

/** What is known of a link at one moment, its place left out. */
export interface Measurement {
  /** The newest message of any kind. */
  newest: LinkFrame | undefined;
  /** The newest one with markers' positions; undefined while nothing is measured. */
  shape: LinkFrame | undefined;
}

/** Where everything that moves with joints is, at one moment. */
export interface Poses {
  /** By name, in the base frame. */
  links: ReadonlyMap<string, Pose>;
  frames: readonly FramePose[];
}

/** What was known over the last PAST_S, a few times a second. */
export class Past<T> {
  private readonly times: number[] = [];
  private readonly moments: T[] = [];

  /** `links`: among how many the room is shared. */
  add(timeS: number, moment: T, links: number): void {
    const newest = this.times.at(-1) ?? -Infinity;
    if (timeS < newest - CLOCK_BACK_S) this.clear();
    else if (timeS - newest < Math.max(LEAST_PERIOD_S, (PAST_S * links) / MOST_MOMENTS)) return;
    this.times.push(timeS);
    this.moments.push(moment);
    const old = firstFrom(this.times, timeS - PAST_S);
    if (old > 0) {
      this.times.splice(0, old);
      this.moments.splice(0, old);
    }
  }

  /** The newest moment until then; undefined: there is none, or it is older than the second in which each link reports at least once. */
  at(timeS: number): T | undefined {
    const index = firstFrom(this.times, timeS + 1e-6) - 1;
    return index >= 0 && timeS - this.times[index] <= MOMENT_HOLDS_S ? this.moments[index] : undefined;
  }

  get count(): number {
    return this.times.length;
  }

  get oldestS(): number {
    return this.times[0] ?? NaN;
  }

  clear(): void {
    this.times.length = this.moments.length = 0;
  }
}

/** Images of the links that were shown, for looking back. */
export class PastImages {
  private readonly kept: { link: string; timeS: number; images: StreamPreviewResponse; bytes: number }[] = [];
  private bytes = 0;

  add(link: string, timeS: number, images: StreamPreviewResponse): void {
    const bytes = images.pictures.reduce((sum, each) => sum + each.jpeg.length, 0);
    this.kept.push({ link, timeS, images, bytes });
    this.bytes += bytes;
    while (this.bytes > MOST_IMAGE_BYTES || timeS - this.kept[0].timeS > PAST_S)
      this.bytes -= this.kept.shift()!.bytes;
  }

  /** The newest ones of the link that were taken until then, and not long before; undefined: there are none. */
  at(link: string, timeS: number): StreamPreviewResponse | undefined {
    let found: StreamPreviewResponse | undefined;
    for (const each of this.kept)
      if (each.link === link && each.timeS <= timeS && timeS - each.timeS <= IMAGE_HOLDS_S)
        found = each.images;
    return found;
  }
}

// The first index whose time is not before `timeS`.
function firstFrom(times: readonly number[], timeS: number): number {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < timeS) low = middle + 1;
    else high = middle;
  }
  return low;
}
