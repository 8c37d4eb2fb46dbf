import { Code } from "@connectrpc/connect";
import { signal } from "@preact/signals";
import { keepOpen } from "../api/keep_open";
import { EventKind } from "../api/gen/taclink/v1/events_pb";
import { Detail } from "../api/gen/taclink/v1/frame_pb";
import type { GetReplayPicturesResponse, ReplayStatus } from "../api/gen/taclink/v1/recording_pb";
import { messageOf, type Session } from "../api/session";
import { secondsOf } from "../ui/format";
import type { ArmStore } from "./arm_store";
import type { Connection, Feed } from "./feed";
import { magnitudeN } from "./magnitude";

/** When something touched a link, s since 1970-01-01 UTC. */
export interface ContactSpan {
  link: string;
  id: bigint;
  fromS: number;
  toS: number;
  peakN: number;
}

const ALL_LINKS_TOLD_S = 1;

const keyOf = (link: string, id: bigint) => `${link}\n${id}`;
const toNs = (seconds: number) => BigInt(Math.round(seconds * 1e6)) * 1000n;

/** Keeps the store as the arm was when a log was recorded. */
export class ReplayFeed implements Feed {
  readonly connection = signal<Connection>({ state: "connecting" });
  readonly status = signal<ReplayStatus | undefined>(undefined);
  readonly positionS = signal(NaN);
  readonly contacts = signal<readonly ContactSpan[]>([]);
  /** Not all of the log's contacts are known yet. */
  readonly looking = signal(true);
  /** Why an order was refused, or the log can't be played. */
  readonly trouble = signal("");

  private life: AbortController | undefined;
  private pausedByHiding = false;
  private seeks = 0; // that are on their way
  private placedAtMs = 0;
  private toldAtMs = 0;
  private looping = false;

  constructor(
    private readonly session: Session,
    private readonly store: ArmStore,
    readonly log: string,
    private startS: number,
    private readonly onPosition: (timeS: number) => void,
  ) {}

  start(): void {
    this.stop();
    this.life = new AbortController();
    const { signal: stop } = this.life;
    void keepOpen(stop, {
      run: (end, alive) => this.read(end, alive),
      onLost: (reason, retryInMs, code) => this.lost(reason, retryInMs, code),
      silenceMs: 10_000,
    });
    void this.findContacts(stop);
  }

  stop(): void {
    this.life?.abort();
    this.life = undefined;
    if (Number.isFinite(this.positionS.peek())) this.startS = this.positionS.peek();
  }

  setHidden(hidden: boolean): void {
    const status = this.status.value;
    if (!this.life || status?.ended) {
      this.pausedByHiding = false;
    } else if (hidden && status && !status.paused) {
      this.pausedByHiding = true;
      void this.pause(true);
    } else if (!hidden && this.pausedByHiding) {
      this.pausedByHiding = false;
      void this.pause(false);
    }
  }

  get loop(): boolean {
    return this.looping;
  }

  pause(paused: boolean): Promise<void> {
    return this.control({ case: "pause", value: paused });
  }
  step(frames: number): Promise<void> {
    return this.control({ case: "step", value: frames });
  }
  setSpeed(speed: number): Promise<void> {
    return this.control({ case: "speed", value: speed });
  }
  setLoop(loop: boolean): Promise<void> {
    this.looping = loop;
    return this.control({ case: "loop", value: loop });
  }
  async seek(timeS: number): Promise<void> {
    this.positionS.value = timeS;
    this.onPosition(timeS);
    if (this.status.value?.ended || !this.life) {
      this.start();
      return;
    }
    this.store.clear();
    ++this.seeks;
    await this.control({ case: "seekUtcNs", value: toNs(timeS) }).finally(() => --this.seeks);
  }

  /** What the link's cameras saw then; undefined: nothing is played now. */
  async picturesOf(
    link: string,
    timeS: number,
    stop: AbortSignal,
  ): Promise<GetReplayPicturesResponse | undefined> {
    const player = this.status.peek()?.player;
    if (!player || this.status.peek()?.ended || !Number.isFinite(timeS)) return undefined;
    const request = { player, link, utcNs: toNs(timeS) };
    return this.session.recording.getReplayPictures(request, { signal: stop, timeoutMs: 5000 });
  }

  private async control(
    action: Parameters<Session["recording"]["controlReplay"]>[0]["action"],
  ): Promise<void> {
    const player = this.status.value?.player;
    if (!player) return;
    try {
      await this.session.recording.controlReplay({ player, action }, { timeoutMs: 5000 });
      this.trouble.value = "";
    } catch (error) {
      this.trouble.value = messageOf(error);
    }
  }

  private lost(reason: string, retryInMs: number, code: Code | undefined): void {
    if (code === Code.Unauthenticated || code === Code.PermissionDenied) {
      this.connection.value = { state: "signIn", reason: "This server wants to know who you are." };
      this.stop();
      return;
    }
    if (code === Code.NotFound || code === Code.InvalidArgument || code === Code.DataLoss) {
      this.trouble.value = reason;
      this.status.value = undefined;
      this.connection.value = { state: "connecting" };
      this.stop();
      return;
    }
    const now = performance.now();
    const before = this.connection.value;
    const sinceMs = before.state === "lost" ? before.sinceMs : now;
    this.startS = this.positionS.value;
    this.connection.value = { state: "lost", reason, sinceMs, retryAtMs: now + retryInMs };
  }

  // Begins with what was last before the start, also paused: by a seek, which a range would cut off.
  private async read(stop: AbortSignal, alive: () => void): Promise<void> {
    await this.session.refresh();
    const wanted = this.startS;
    let sought = !Number.isFinite(wanted);
    const before = this.status.value;
    const speed = before && !before.ended ? before.speed : 1;
    const stayPaused = before !== undefined && before.paused && !before.ended;
    const request = { log: this.log, detail: Detail.FULL, speed, loop: this.looping, paused: !sought };
    for await (const { message } of this.session.recording.replay(request, { signal: stop })) {
      alive();
      if (this.connection.value.state !== "live") this.connection.value = { state: "live" };
      switch (message.case) {
        case "status":
          this.takeStatus(message.value);
          if (!sought) {
            sought = true;
            await this.seek(wanted);
            if (!stayPaused) await this.pause(false);
          }
          if (message.value.ended) return this.stop();
          break;
        case "frame":
          this.store.takeFrame(message.value);
          this.takePosition(this.store.timeS);
          break;
        case "contacts":
          this.store.takeContacts(message.value);
          break;
        case "event":
          this.store.takeEvent(message.value);
          break;
        case "arm":
          this.store.takeArm(message.value);
          break;
        default:
          break;
      }
    }
  }

  private takeStatus(status: ReplayStatus): void {
    if (status.loops !== (this.status.value?.loops ?? 0n)) this.store.clear();
    this.status.value = status;
    if (status.paused || status.ended) this.takePosition(secondsOf(status.positionUtcNs));
  }

  private takePosition(timeS: number): void {
    // What is on its way from before a seek is not where the log is.
    if (!(timeS > 0) || this.seeks > 0) return;
    const now = performance.now();
    // While it is paused the next to come may be the last one.
    if (!this.status.value?.paused && now - this.placedAtMs < 100) return;
    this.positionS.value = timeS;
    this.placedAtMs = now;
    // Browsers allow few changes of the address.
    if (now - this.toldAtMs < 1000) return;
    this.toldAtMs = now;
    this.onPosition(timeS);
  }

  // Of those that were there when the recording began no event tells. By link and id.
  private async contactsAtStart(stop: AbortSignal): Promise<Map<string, ContactSpan>> {
    const request = { log: this.log, withoutFrames: true, withoutEvents: true, withoutArm: true };
    const found = new Map<string, ContactSpan>();
    let beginS = NaN;
    for await (const { message } of this.session.recording.replay(request, { signal: stop })) {
      if (message.case !== "contacts") continue;
      const timeS = secondsOf(message.value.utcNs);
      if (Number.isNaN(beginS)) beginS = timeS;
      if (timeS > beginS + ALL_LINKS_TOLD_S) break; // each message has the links that came until then
      for (const { link, linkContactId: id, wrench, normalForceN } of message.value.contacts) {
        const key = keyOf(link, id);
        if (found.has(key)) continue;
        const peakN = magnitudeN({ normalForceN, forceN: wrench?.forceN });
        found.set(key, { link, id, fromS: beginS, toS: beginS, peakN });
      }
    }
    return found;
  }

  // Only the events of the whole log, as fast as they come.
  private async findContacts(stop: AbortSignal): Promise<void> {
    if (!this.looking.peek()) return;
    const spans: ContactSpan[] = [];
    const request = { log: this.log, withoutFrames: true, withoutContacts: true, withoutArm: true };
    try {
      const open = await this.contactsAtStart(stop);
      spans.push(...open.values());
      for await (const { message } of this.session.recording.replay(request, { signal: stop })) {
        if (message.case === "status" && message.value.ended)
          for (const span of open.values()) span.toS = secondsOf(message.value.toUtcNs);
        if (message.case !== "event" || message.value.detail.case !== "contact") continue;
        const { kind, link, times } = message.value;
        const contact = message.value.detail.value;
        const timeS = secondsOf(times?.exposureUtcNs || times?.raisedUtcNs || 0n);
        const key = keyOf(link, contact.contactId);
        let span = open.get(key);
        if (!span) {
          const fromS = timeS - contact.durationS;
          span = { link, id: contact.contactId, fromS, toS: timeS, peakN: contact.peakForceN };
          open.set(key, span);
          spans.push(span);
        }
        span.toS = timeS;
        span.peakN = Math.max(span.peakN, contact.peakForceN);
        if (kind === EventKind.CONTACT_END) open.delete(key);
      }
      this.looking.value = false;
    } catch (error) {
      if (!stop.aborted) this.trouble.value = `Contacts of the time line: ${messageOf(error)}`;
    }
    this.contacts.value = spans;
  }
}
