import { create } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { EventKind, EventSchema, type Event } from "../src/api/gen/taclink/v1/events_pb";
import { LinkStatus } from "../src/api/gen/taclink/v1/frame_pb";
import { touchesOf } from "../src/model/touches";

function contact(kind: EventKind, id: bigint, atS: number, forceN: number, more: object = {}): Event {
  return create(EventSchema, {
    kind,
    link: "base",
    frameStatus: LinkStatus.OK,
    times: { exposureUtcNs: BigInt(atS) * 1_000_000_000n },
    detail: { case: "contact", value: { contactId: id, forceN: { x: forceN }, peakForceN: forceN, ...more } },
  });
}

describe("touches", () => {
  test("are one row each, from begin to end, newest first", () => {
    const events = [
      contact(EventKind.CONTACT_BEGIN, 1n, 10, 0.1),
      contact(EventKind.CONTACT_UPDATE, 1n, 11, 0.4),
      contact(EventKind.CONTACT_BEGIN, 2n, 12, 0.2),
      contact(EventKind.CONTACT_END, 1n, 13, 0.05, { peakForceN: 0.4, durationS: 3, endReason: "released" }),
    ].reverse();
    const [newest, older, ...more] = touchesOf(events);
    expect(more).toEqual([]);
    expect(newest).toMatchObject({ id: 2n, beginS: 12, durationS: undefined, peakN: 0.2 });
    expect(older).toMatchObject({ id: 1n, beginS: 10, durationS: 3, peakN: 0.4, endReason: "released" });
  });
  test("of another run with the same number are others", () => {
    const events = [
      contact(EventKind.CONTACT_BEGIN, 1n, 10, 0.1),
      contact(EventKind.CONTACT_BEGIN, 1n, 50, 0.3),
    ];
    expect(touchesOf(events.reverse())).toMatchObject([
      { beginS: 50, durationS: undefined, peakN: 0.3 },
      { beginS: 10, durationS: 0, peakN: 0.1 },
    ]);
  });
  test("that began before the known events begin where their end says", () => {
    const end = contact(EventKind.CONTACT_END, 9n, 13, 0, { peakForceN: 0.7, durationS: 5 });
    expect(touchesOf([end])).toMatchObject([{ beginS: 8, durationS: 5, peakN: 0.7 }]);
  });
  test("from a frame that is not well are doubted", () => {
    const begin = contact(EventKind.CONTACT_BEGIN, 1n, 10, 0.1);
    begin.frameStatus = LinkStatus.DEGRADED;
    expect(touchesOf([begin])[0].isDoubted).toBe(true);
  });
});
