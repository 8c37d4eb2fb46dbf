import { signal } from "@preact/signals";
import type { Arm } from "../api/gen/taclink/v1/arm_pb";
import type { StreamContactsResponse } from "../api/gen/taclink/v1/contacts_pb";
import { EventKind, ForceLevel, type Event } from "../api/gen/taclink/v1/events_pb";
import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";
import type { LinkStreamCounts } from "../api/gen/taclink/v1/tactile_pb";
import { ForceHistory } from "./force_history";
import { lengthOf } from "./vectors";

const EVENTS_KEPT = 500;

/** What is known of one link beside the Arm message. */
export class LinkRecord {
  /** The newest message of any kind. */
  newest: LinkFrame | undefined;
  /** The newest one with markers' positions; undefined while nothing is measured. */
  shape: LinkFrame | undefined;
  /** Where the link is now, if that is known better than from the Arm. */
  pose: Pose | undefined;
  readonly history = new ForceHistory();
  counts: LinkStreamCounts | undefined;
  /** Frames received, for the rate at which they come. */
  received = 0;
}

/**
 * The arm as this page knows it, live or from a log. What changes with every frame is in plain fields, with `onChange` for
 * those who draw; what people read is signals.
 */
export class ArmStore {
  readonly arm = signal<Arm | undefined>(undefined);
  /** Newest first. */
  readonly events = signal<readonly Event[]>([]);
  readonly contacts = signal<StreamContactsResponse | undefined>(undefined);
  /** Rises a few times a second while frames come: for text that follows them. */
  readonly beat = signal(0);
  /** The newest time of the arm, s since 1970-01-01 UTC. */
  timeS = NaN;
  timeAtMs = 0;

  private records = new Map<string, LinkRecord>();
  private readonly listeners = new Set<(link: string) => void>();
  private beatDue = false;

  link(name: string): LinkRecord {
    let record = this.records.get(name);
    if (!record) this.records.set(name, (record = new LinkRecord()));
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
    if (!arm.baseFrame) for (const record of this.records.values()) record.pose = undefined;
    this.arm.value = arm;
    for (const name of names) this.changed(name);
  }

  takeFrame(frame: LinkFrame): void {
    const record = this.link(frame.link);
    record.received++;
    record.newest = frame;
    const measured = frame.markersSeen > 0;
    if (frame.positionsM.length > 0) record.shape = frame;
    else if (!measured && !frame.unchanged) record.shape = undefined;
    const utcNs = frame.times?.exposureUtcNs ?? 0n;
    if (utcNs > 0n) {
      const timeS = Number(utcNs / 1000n) / 1e6;
      const total = measured && frame.totalForceN ? lengthOf(frame.totalForceN) : NaN;
      record.history.add(
        timeS,
        total,
        frame.contacts.map((contact) => ({
          id: contact.id.toString(),
          forceN: contact.forceN ? lengthOf(contact.forceN) : 0,
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

  takeContacts(contacts: StreamContactsResponse): void {
    for (const link of contacts.links) {
      if (!link.baseFromLink) continue;
      this.link(link.link).pose = link.baseFromLink;
      this.changed(link.link);
    }
    this.contacts.value = contacts;
  }

  takeCounts(counts: readonly LinkStreamCounts[]): void {
    for (const each of counts) this.link(each.link).counts = each;
  }

  takeEvent(event: Event): void {
    this.events.value = [event, ...this.events.value].slice(0, EVENTS_KEPT);
    const detail = event.detail;
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
