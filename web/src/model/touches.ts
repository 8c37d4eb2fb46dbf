import { EventKind, type Event } from "../api/gen/taclink/v1/events_pb";
import { LinkStatus } from "../api/gen/taclink/v1/frame_pb";
import { secondsOf } from "../ui/format";
import { magnitudeN } from "./magnitude";

/** One contact from its begin to its end, as its events tell. */
export interface Touch {
  link: string;
  id: bigint;
  /** s since 1970-01-01 UTC. */
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
  const touches: Touch[] = [];
  const open = new Map<string, { touch: Touch; lastS: number }>();
  for (const event of [...events].reverse()) {
    if (event.detail.case !== "contact") continue;
    const { contactId, peakForceN, durationS, endReason } = event.detail.value;
    const key = `${event.link} ${contactId}`;
    const timeS = secondsOf(event.times?.exposureUtcNs || event.times?.raisedUtcNs || 0n);
    const before = open.get(key);
    let touch = before?.touch;
    if (!touch || event.kind === EventKind.CONTACT_BEGIN) {
      // A link that was started again numbers its contacts from 1: how the one before ended is not known.
      if (before) before.touch.durationS = before.lastS - before.touch.beginS;
      touch = {
        link: event.link,
        id: contactId,
        beginS: event.kind === EventKind.CONTACT_BEGIN ? timeS : timeS - durationS,
        durationS: undefined,
        peakN: 0,
        endReason: "",
        isDoubted: false,
      };
      touches.push(touch);
    }
    open.set(key, { touch, lastS: timeS });
    touch.peakN = Math.max(touch.peakN, peakForceN, magnitudeN(event.detail.value));
    touch.isDoubted ||= event.frameStatus !== LinkStatus.UNSPECIFIED && event.frameStatus !== LinkStatus.OK;
    if (event.kind !== EventKind.CONTACT_END) continue;
    touch.durationS = durationS;
    touch.endReason = endReason;
    open.delete(key);
  }
  return touches.sort((a, b) => b.beginS - a.beginS);
}
