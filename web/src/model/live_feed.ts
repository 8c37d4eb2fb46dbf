import { Code, ConnectError } from "@connectrpc/connect";
import { signal } from "@preact/signals";
import { keepOpen, sleep } from "../api/keep_open";
import { Detail } from "../api/gen/taclink/v1/frame_pb";
import { Delivery } from "../api/gen/taclink/v1/tactile_pb";
import type { Session } from "../api/session";
import type { ArmStore } from "./arm_store";
import type { Connection, Feed } from "./feed";

const FRAMES_HZ = 30;
// Below what people see; a link at rest then costs one message a second.
const STILL_FORCE_N = 0.02;
const STILL_MOVE_M = 0.1e-3;
const ARM_PERIOD_MS = 1000;
const HISTORY_S = 60;
// Every link gives a sign of life each second.
const SILENCE_MS = 3500;
// A glance at another tab does not close the stream.
const HIDDEN_GRACE_MS = 5000;

/** Keeps the store as the running arm is. Browsers allow six connections to a server: a visible page keeps two, or three. */
export class LiveFeed implements Feed {
  readonly connection = signal<Connection>({ state: "connecting" });
  private life: AbortController | undefined;
  private looking: AbortController | undefined;
  private hideTimer: ReturnType<typeof setTimeout> | undefined;
  private eventsAfter: bigint | undefined;
  private eventsRun = "";

  constructor(
    private readonly session: Session,
    private readonly store: ArmStore,
  ) {}

  start(): void {
    this.stop();
    this.life = new AbortController();
    this.connection.value = { state: "connecting" };
    void keepOpen(this.life.signal, {
      run: (stop, alive) => this.readEvents(stop, alive),
      onLost: (_, __, code) => this.refused(code),
      silenceMs: SILENCE_MS,
    });
    this.look();
  }

  stop(): void {
    clearTimeout(this.hideTimer);
    this.hideTimer = undefined;
    this.life?.abort();
    this.looking?.abort();
    this.life = this.looking = undefined;
  }

  setHidden(hidden: boolean): void {
    clearTimeout(this.hideTimer);
    this.hideTimer = undefined;
    if (!this.life) return;
    if (hidden) {
      this.hideTimer = setTimeout(() => {
        this.looking?.abort();
        this.looking = undefined;
      }, HIDDEN_GRACE_MS);
    } else if (!this.looking) {
      this.look();
    }
  }

  private look(): void {
    const looking = (this.looking = new AbortController());
    void keepOpen(looking.signal, {
      run: (stop, alive) => this.readFrames(stop, alive),
      onLost: (reason, retryInMs, code) => {
        if (this.refused(code)) return;
        const before = this.connection.value;
        const now = performance.now();
        const sinceMs = before.state === "lost" ? before.sinceMs : now;
        this.connection.value = { state: "lost", reason, sinceMs, retryAtMs: now + retryInMs };
      },
      silenceMs: SILENCE_MS,
    });
    void keepOpen(looking.signal, {
      run: (stop) => this.followArm(stop),
      onLost: () => undefined,
      silenceMs: 0,
    });
  }

  // Signing in starts the feed again.
  private refused(code: Code | undefined): boolean {
    if (code !== Code.Unauthenticated && code !== Code.PermissionDenied) return false;
    this.connection.value = { state: "signIn", reason: "This server wants to know who you are." };
    this.stop();
    return true;
  }

  // All at once: the first frame need not wait for the arm.
  private async readFrames(stop: AbortSignal, alive: () => void): Promise<void> {
    const inner = new AbortController();
    stop.addEventListener("abort", () => inner.abort(), { once: true });
    try {
      await Promise.all([this.learnArm(inner.signal), this.followFrames(inner.signal, alive)]);
    } finally {
      inner.abort();
    }
  }

  private async learnArm(stop: AbortSignal): Promise<void> {
    const asked = this.session.tactile.getArm({}, { signal: stop, timeoutMs: 5000 });
    const [{ arm }] = await Promise.all([asked, this.session.refresh()]);
    if (!arm) return;
    this.store.takeArm(arm);
    void this.learnHistory(stop);
    if (arm.baseFrame)
      void keepOpen(stop, {
        run: (end) => this.readContacts(end),
        onLost: () => undefined,
        silenceMs: 0,
      });
  }

  // The curves of what was before: nothing else waits for them, nor needs them.
  private async learnHistory(stop: AbortSignal): Promise<void> {
    try {
      const { links } = await this.session.tactile.getForceHistory(
        { spanS: HISTORY_S },
        { signal: stop, timeoutMs: 10_000 },
      );
      this.store.takeHistory(links);
    } catch (error) {
      // A server without a history, or a lost connection, which the frame stream reports.
      const { code } = ConnectError.from(error);
      if (stop.aborted || code === Code.Unimplemented || code === Code.Unavailable) return;
      console.error("The curves begin now, for the server's history cannot be read:", error);
    }
  }

  private async followFrames(stop: AbortSignal, alive: () => void): Promise<void> {
    const request = {
      detail: Detail.FULL,
      maxRateHz: FRAMES_HZ,
      delivery: Delivery.LATEST,
      deadbandForceN: STILL_FORCE_N,
      deadbandMoveM: STILL_MOVE_M,
    };
    for await (const { message } of this.session.tactile.streamFrames(request, { signal: stop })) {
      alive();
      if (this.store.arm.peek() && this.connection.peek().state !== "live")
        this.connection.value = { state: "live" };
      if (message.case === "frame") this.store.takeFrame(message.value);
      else if (message.case === "status") {
        this.store.takeCounts(message.value.links);
        if (message.value.endReason) throw new Error(message.value.endReason);
      }
    }
  }

  // The joints move the links: their places come with the contacts.
  private async readContacts(stop: AbortSignal): Promise<void> {
    const request = { maxRateHz: FRAMES_HZ };
    for await (const contacts of this.session.tactile.streamContacts(request, { signal: stop }))
      this.store.takeContacts(contacts);
  }

  private async readEvents(stop: AbortSignal, alive: () => void): Promise<void> {
    const request = { afterSequence: this.eventsAfter ?? 0n, runId: this.eventsRun };
    for await (const { message } of this.session.tactile.streamEvents(request, { signal: stop })) {
      alive();
      if (message.case === "event") {
        this.store.takeEvent(message.value);
        this.eventsAfter = message.value.sequence;
      } else if (message.case === "status") {
        if (this.eventsRun && this.eventsRun !== message.value.runId) this.store.forgetEvents();
        this.eventsRun = message.value.runId;
        this.eventsAfter = message.value.position;
      }
    }
  }

  private async followArm(stop: AbortSignal): Promise<void> {
    while (!stop.aborted) {
      await sleep(ARM_PERIOD_MS, stop);
      if (stop.aborted || this.connection.value.state !== "live") continue;
      const { arm } = await this.session.tactile.getArm({}, { signal: stop, timeoutMs: 5000 });
      if (arm) this.store.takeArm(arm);
    }
  }
}
