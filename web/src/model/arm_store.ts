import { create } from "@bufbuild/protobuf";
import { signal } from "@preact/signals";
import type { Arm } from "../api/gen/taclink/v1/arm_pb";
import type { FramePose, StreamContactsResponse } from "../api/gen/taclink/v1/contacts_pb";
import { EventKind, ForceLevel, type Event } from "../api/gen/taclink/v1/events_pb";
import { LinkFrameSchema, type LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";
import type { LinkForceHistory } from "../api/gen/taclink/v1/history_pb";
import type { LinkStreamCounts } from "../api/gen/taclink/v1/tactile_pb";
import { ForceHistory, type Sample } from "./force_history";
import { Past, type Measurement, type Poses } from "./past";
import { magnitudeN, totalMagnitudeN } from "./magnitude";

const EVENTS_KEPT = 500;
const MOST_EXTRAPOLATED_S = 1.5;

/** What is known of one link beside the Arm message. */
export class LinkRecord {
  /** As it is now, whatever is shown. */
  readonly now: Shown = { newest: undefined, shape: undefined, pose: undefined };
  /** What is shown: now, or a past moment. */
  shown: Shown = this.now;
  readonly past = new Past<Measurement>();
  readonly history = new ForceHistory();
  counts: LinkStreamCounts | undefined;
  /** Frames received, for the rate at which they come. */
  received = 0;

  get newest() {
    return this.shown.newest;
  }
  get shape() {
    return this.shown.shape;
  }
  get pose() {
    return this.shown.pose;
  }
}

/** A measurement and the link's place, if that is known better than from the Arm. */
interface Shown extends Measurement {
  pose: Pose | undefined;
}

const UNKNOWN: Measurement = {
  newest: create(LinkFrameSchema, { statusReason: "Nothing is kept of this moment." }),
  shape: undefined,
};

/**
 * The arm as this page knows it, live or from a log. What changes with every frame is in plain fields, with `onChange` for
 * those who draw; what people read is signals.
 */
export class ArmStore {
  readonly arm = signal<Arm | undefined>(undefined);
  /** Newest first. */
  readonly events = signal<readonly Event[]>([]);
  /** That was touched last; empty: none yet. */
  readonly touchedLink = signal("");
  readonly contacts = signal<StreamContactsResponse | undefined>(undefined);
  /** Rises a few times a second while frames come: for text that follows them. */
  readonly beat = signal(0);
  /** The moment that is shown, s since 1970-01-01 UTC; undefined: now. */
  readonly lookedAtS = signal<number | undefined>(undefined);
  /** The newest time of the arm, s since 1970-01-01 UTC. */
  timeS = NaN;
  timeAtMs = 0;

  private readonly poses = new Past<Poses>();
  private records = new Map<string, LinkRecord>();
  private readonly listeners = new Set<(link: string) => void>();
  private beatDue = false;

  /** `keepsPast`: moments are kept for lookAt. */
  constructor(private readonly keepsPast = false) {}

  link(name: string): LinkRecord {
    let record = this.records.get(name);
    if (record) return record;
    this.records.set(name, (record = new LinkRecord()));
    const timeS = this.lookedAtS.peek();
    if (timeS !== undefined) this.show(name, record, timeS);
    return record;
  }

  links(): Iterable<[string, LinkRecord]> {
    return this.records;
  }

  /** Called with the link that has changed. Returns how to end that. */
  onChange(listener: (link: string) => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  takeArm(arm: Arm): void {
    const names = new Set(arm.links.map((link) => link.name));
    for (const name of this.records.keys()) if (!names.has(name)) this.records.delete(name);
    // Without joints the arm itself says where its links are.
    if (!arm.baseFrame) for (const record of this.records.values()) record.now.pose = undefined;
    this.arm.value = arm;
    for (const name of names) this.changed(name);
  }

  takeFrame(frame: LinkFrame): void {
    const record = this.link(frame.link);
    record.received++;
    const { now } = record;
    now.newest = withoutCovariances(frame);
    const measured = frame.markersSeen > 0;
    if (frame.positionsM.length > 0) now.shape = now.newest;
    else if (!measured && !frame.unchanged) now.shape = undefined;
    const utcNs = frame.times?.exposureUtcNs ?? 0n;
    if (this.keepsPast) {
      const timeS = utcNs > 0n ? Number(utcNs / 1000n) / 1e6 : this.nowS(); // a report without a frame
      const { newest, shape } = now;
      if (Number.isFinite(timeS)) record.past.add(timeS, { newest, shape }, this.records.size);
    }
    if (utcNs > 0n) {
      const timeS = Number(utcNs / 1000n) / 1e6;
      const total = measured ? totalMagnitudeN(frame) : NaN;
      record.history.add(
        timeS,
        total,
        frame.contacts.map((contact) => ({
          id: contact.id.toString(),
          forceN: magnitudeN(contact),
        })),
      );
      this.takeTime(timeS);
    }
    this.changed(frame.link);
  }

  // Links' times differ by a little; a clock that goes back by more does so for all.
  private takeTime(timeS: number): void {
    if (timeS > this.timeS || Number.isNaN(this.timeS) || timeS < this.timeS - 0.5) {
      this.timeS = timeS;
      this.timeAtMs = performance.now();
    }
  }

  /** The arm's time now, s since 1970-01-01 UTC: it goes on between two messages. */
  nowS(): number {
    return this.timeS + Math.min(MOST_EXTRAPOLATED_S, (performance.now() - this.timeAtMs) / 1e3);
  }

  takeContacts(contacts: StreamContactsResponse): void {
    const links = new Map<string, Pose>();
    for (const link of contacts.links) {
      // All of one moment, or an arm that moves would be drawn in pieces.
      const pose = link.drawnBaseFromLink ?? link.baseFromLink;
      if (!pose) continue;
      links.set(link.link, pose);
      this.link(link.link).now.pose = pose;
      this.changed(link.link);
    }
    if (this.keepsPast)
      this.poses.add(Number(contacts.utcNs / 1000n) / 1e6, { links, frames: contacts.framePoses }, 1);
    this.contacts.value = contacts;
  }

  /** What the server remembers from before the page came, or from while it was away. */
  takeHistory(histories: readonly LinkForceHistory[]): void {
    for (const history of histories) this.link(history.link).history.merge(samplesOf(history));
    this.announce();
  }

  /** Shows a past moment, the oldest that is kept if need be; undefined, or not before now: now. */
  lookAt(timeS: number | undefined): void {
    const isPast = timeS !== undefined && timeS < this.timeS && Number.isFinite(this.oldestS);
    const shownS = isPast ? Math.max(timeS, this.oldestS) : undefined;
    this.lookedAtS.value = shownS;
    for (const [name, record] of this.records) this.show(name, record, shownS);
  }

  private show(name: string, record: LinkRecord, timeS: number | undefined): void {
    if (timeS === undefined) record.shown = record.now;
    else {
      const pose = this.poses.at(timeS)?.links.get(name);
      record.shown = { ...(record.past.at(timeS) ?? UNKNOWN), pose };
    }
    this.changed(name);
  }

  /** Where the frames of the arm's bodies are, in the moment that is shown. */
  framePoses(): readonly FramePose[] {
    const timeS = this.lookedAtS.peek();
    if (timeS === undefined) return this.contacts.peek()?.framePoses ?? [];
    return this.poses.at(timeS)?.frames ?? [];
  }

  /** Of the moments that can be looked at, s; NaN: there are none. */
  get oldestS(): number {
    const oldest = [...this.records.values()].map(({ past }) => past.oldestS).filter(Number.isFinite);
    return oldest.length > 0 ? Math.min(...oldest) : NaN;
  }

  takeCounts(counts: readonly LinkStreamCounts[]): void {
    for (const each of counts) this.link(each.link).counts = each;
  }

  takeEvent(event: Event): void {
    this.events.value = [event, ...this.events.value].slice(0, EVENTS_KEPT);
    const detail = event.detail;
    if (event.kind === EventKind.CONTACT_BEGIN) this.touchedLink.value = event.link;
    if (event.kind === EventKind.FORCE_LEVEL && detail.case === "forceLevel")
      this.levels.set(`${event.link}\n${detail.value.region}`, detail.value.level);
    this.announce();
  }

  /** Another run of the server: its events are numbered again, and levels begin at normal. */
  forgetEvents(): void {
    this.events.value = [];
    this.levels.clear();
    this.announce();
  }

  private readonly levels = new Map<string, ForceLevel>();

  /** The worst force level of a link, its regions included. */
  levelOf(link: string): ForceLevel {
    let worst = ForceLevel.UNSPECIFIED;
    const known = this.arm.value?.links.find((each) => each.name === link)?.forceLevels ?? [];
    for (const state of known)
      worst = Math.max(worst, this.levels.get(`${link}\n${state.region}`) ?? state.level);
    return worst;
  }

  /** Forgets all but the arm: another log, or another place in it. */
  clear(): void {
    this.records.clear();
    this.levels.clear();
    this.events.value = [];
    this.contacts.value = undefined;
    this.lookedAtS.value = undefined;
    this.timeS = NaN;
    for (const link of this.arm.value?.links ?? []) this.changed(link.name);
  }

  private changed(link: string): void {
    for (const listener of this.listeners) listener(link);
    this.announce();
  }

  private announce(): void {
    if (this.beatDue) return;
    this.beatDue = true;
    setTimeout(() => {
      this.beatDue = false;
      this.beat.value++;
    }, 200);
  }
}

// The page shows no covariances; they are a third of a frame, of which thousands are kept.
function withoutCovariances(frame: LinkFrame): LinkFrame {
  return { ...frame, displacementCovariancesM2: [] };
}

function samplesOf({ exposureUtcNs, totalMagnitudeN, contacts }: LinkForceHistory): Sample[] {
  const samples = exposureUtcNs.map((ns, i): Sample => {
    const total = totalMagnitudeN[i] ?? NaN;
    return [Number(ns / 1000n) / 1e6, Number.isNaN(total) ? null : total, []];
  });
  for (const { id, samples: places, magnitudeN } of contacts)
    for (const [i, place] of places.entries()) samples[place]?.[2].push([id.toString(), magnitudeN[i]]);
  return samples;
}
