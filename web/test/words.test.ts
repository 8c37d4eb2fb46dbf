import { create } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { Supervision } from "../src/api/gen/taclink/v1/arm_pb";
import { EventKind, EventKindSchema, EventSchema, ForceLevel } from "../src/api/gen/taclink/v1/events_pb";
import { LinkStatus } from "../src/api/gen/taclink/v1/frame_pb";
import { LogSchema } from "../src/api/gen/taclink/v1/recording_pb";
import { formatAddress, parseAddress } from "../src/model/address";
import { chooseLogs } from "../src/model/log_list";
import * as format from "../src/ui/format";
import { eventText, severity } from "../src/ui/words";

describe("addresses", () => {
  test.each(["", "?link=upper", "?page=logs", "?link=a%26b&log=run+1.mcap&t=1763800000.250"])(
    "%s comes back",
    (text) => {
      expect(formatAddress(parseAddress(text))).toBe(text);
    },
  );
  test("nonsense is left out", () => {
    expect(formatAddress(parseAddress("?page=x&t=abc&log=l"))).toBe("?log=l");
  });
});

describe("numbers for people", () => {
  test("durations", () => {
    expect([0.25, 59.9, 61, 3700, 90_000, -1, NaN].map(format.duration)).toEqual([
      "0.3 s",
      "60 s",
      "1 min 01 s",
      "1 h 01 min",
      "1 d 1 h",
      "–",
      "–",
    ]);
  });
  test("bytes", () => {
    expect([0, 999, 1000, 12_345_678n, 3e12].map(format.bytes)).toEqual([
      "0 B",
      "999 B",
      "1.00 kB",
      "12.3 MB",
      "3.00 TB",
    ]);
  });
  test("latencies", () => {
    expect([0, 0.0042, 0.0123].map(format.milliseconds)).toEqual(["–", "4.2 ms", "12 ms"]);
  });
  test("nanoseconds keep their microseconds", () => {
    expect(format.secondsOf(1_763_800_000_123_456_789n)).toBeCloseTo(1_763_800_000.123456, 6);
  });
});

test("what is worse is above", () => {
  const well = severity(LinkStatus.OK, ForceLevel.NORMAL, Supervision.RUNNING);
  const warned = severity(LinkStatus.OK, ForceLevel.WARNING, Supervision.RUNNING);
  const degraded = severity(LinkStatus.DEGRADED, ForceLevel.NORMAL, Supervision.RUNNING);
  const alarmed = severity(LinkStatus.OK, ForceLevel.ALARM, Supervision.RUNNING);
  const lost = severity(LinkStatus.LOST, ForceLevel.NORMAL, Supervision.RUNNING);
  const resting = severity(LinkStatus.LOST, ForceLevel.NORMAL, Supervision.RESTING);
  const all = [well, warned, degraded, alarmed, lost, resting];
  expect(all).toEqual([...all].sort((a, b) => a - b));
  expect(new Set(all).size).toBe(all.length);
});

describe("events", () => {
  test("a refused tare says why", () => {
    const event = create(EventSchema, {
      kind: EventKind.TARE,
      detail: { case: "operation", value: { who: "otto", accepted: false, outcome: "the skin is touched" } },
    });
    expect(eventText(event)).toBe("tare refused by otto: the skin is touched");
  });
  test("every kind of operation has its name", () => {
    for (const { number } of EventKindSchema.values.slice(1)) {
      if (number === EventKind.CLOCK_STEPPED || number === EventKind.PRESSURE_TRIP) continue; // nobody asks for it
      const event = create(EventSchema, {
        kind: number,
        detail: { case: "operation", value: { who: "otto" } },
      });
      expect(eventText(event)).toMatch(/^[a-z ]+ refused by otto$/);
      expect(eventText(event)).not.toMatch(/unknown|unspecified/);
    }
  });
  test("a step of the clock says by how much", () => {
    const event = create(EventSchema, {
      kind: EventKind.CLOCK_STEPPED,
      detail: {
        case: "operation",
        value: { who: "server", accepted: true, outcome: "UTC stepped by -60 s" },
      },
    });
    expect(eventText(event)).toBe("clock: UTC stepped by -60 s");
  });
  test("a trip of a pressure regulator says why", () => {
    const trip = (accepted: boolean, outcome: string) =>
      create(EventSchema, {
        kind: EventKind.PRESSURE_TRIP,
        detail: { case: "operation", value: { who: accepted ? "otto" : "server", accepted, outcome } },
      });
    expect(eventText(trip(false, "over-pressure: 2.1 kPa"))).toBe(
      "pressure regulator closed its valve: over-pressure: 2.1 kPa",
    );
    expect(eventText(trip(true, "reset"))).toBe("pressure trip done by otto: reset");
  });
  test("the end of a contact tells its peak", () => {
    const event = create(EventSchema, {
      kind: EventKind.CONTACT_END,
      detail: {
        case: "contact",
        value: { contactId: 3n, durationS: 1.26, peakForceN: 2.5, endReason: "released" },
      },
    });
    expect(eventText(event)).toBe("contact #3 ended after 1.3 s, peak 2.50 N (released)");
  });
});

describe("logs", () => {
  const log = (name: string, startUtcNs: bigint, contacts?: bigint, note = "") =>
    create(LogSchema, { name, startUtcNs, endUtcNs: startUtcNs + 5n, contacts, note, links: ["upper"] });
  const logs = [log("b", 2n, 5n), log("a", 3n, undefined, "pinch test"), log("c", 1n, 9n)];
  const names = (filter: string, key: Parameters<typeof chooseLogs>[2]["key"], descending: boolean) =>
    chooseLogs(logs, filter, { key, descending })
      .map((each) => each.name)
      .join("");
  test("are sorted by any column", () => {
    expect(names("", "start", true)).toBe("abc");
    expect(names("", "name", true)).toBe("cba");
    expect(names("", "contacts", false)).toBe("abc");
    expect(names("", "duration", false)).toBe("abc");
  });
  test("are found by all words, in name, note or link", () => {
    expect(names("PINCH upper", "name", false)).toBe("a");
    expect(names("pinch lower", "name", false)).toBe("");
  });
});
