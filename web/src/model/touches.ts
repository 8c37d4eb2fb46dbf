import { EventKind, type Event } from "../api/gen/taclink/v1/events_pb";
import { LinkStatus } from "../api/gen/taclink/v1/frame_pb";
import { secondsOf } from "../ui/format";
import { lengthOf } from "./vectors";

/** One contact from its begin to its end, as its events tell. */
export interface Touch {
  link: string;
  id: bigint;
  /** s since 1970-01-01 UTC; NaN: it began before the events that are known. */
  beginS: number;
  /** s; undefined: it goes on. */
  durationS: number | undefined;
  peakN: number;
  endReason: string;
  /** Some event of it comes from a frame that was not OK. */
  isDoubted: boolean;
}

/** `events`: newest first. The touches, in the order in which they began, newest first. */
export function touchesOf(events: readonly Event[]): Touch[] {
  const touches = new Map<string, Touch>();
  for (const event of [...events].reverse()) {
    if (event.detail.case !== "contact") continue;
    const { contactId, forceN, peakForceN, durationS, endReason } = event.detail.value;
    const key = `${event.link} ${contactId}`;
    const begins = event.kind === EventKind.CONTACT_BEGIN;
    const beginS = begins ? secondsOf(event.times?.exposureUtcNs || event.times?.raisedUtcNs || 0n) : NaN;
    let touch = touches.get(key);
    // Another run of the server numbers contacts anew.
    if (!touch || begins) {
      touches.delete(key);
      touch = {
        link: event.link,
        id: contactId,
        beginS,
        durationS: undefined,
        peakN: 0,
        endReason: "",
        isDoubted: false,
      };
      touches.set(key, touch);
    }
    touch.peakN = Math.max(touch.peakN, peakForceN, forceN ? lengthOf(forceN) : 0);
    touch.isDoubted ||= event.frameStatus !== LinkStatus.UNSPECIFIED && event.frameStatus !== LinkStatus.OK;
    if (event.kind !== EventKind.CONTACT_END) continue;
    touch.durationS = durationS;
    touch.endReason = endReason;
  }
  return [...touches.values()].reverse();
}
