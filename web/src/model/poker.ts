import { signal } from "@preact/signals";
import { BodyShape } from "../api/gen/taclink/v1/simulation_pb";
import { messageOf, type Session } from "../api/session";

const HOLD_S = 2; // without a word from this page the server takes the body off
const AGAIN_MS = 500;
const DEEPEST_M = 0.025;

/** Where on a link's undeformed skin. */
export interface SkinPlace {
  link: string;
  angleRad: number;
  zM: number;
}

/** Presses one body on simulated links, from here on the server's. */
export class Poker {
  readonly shape = signal(BodyShape.FINGER);
  readonly depthM = signal(0.006);
  /** The body stays after the hand has let go, until `releaseAll`. */
  readonly stays = signal(false);
  /** Where it is pressed now; undefined: nowhere. */
  readonly place = signal<SkinPlace | undefined>(undefined);

  private bodyId = 1n;
  private readonly left = new Set<string>(); // links with bodies that stay
  private sending = false;
  private changed = false;
  private again: ReturnType<typeof setInterval> | undefined;

  constructor(
    private readonly session: Session,
    private readonly onTrouble: (text: string) => void,
  ) {}

  press(place: SkinPlace): void {
    const before = this.place.peek();
    if (before && before.link !== place.link) this.letGo();
    this.place.value = place;
    this.again ??= setInterval(() => this.send(), AGAIN_MS);
    this.send();
  }

  deepen(byM: number): void {
    this.depthM.value = Math.min(DEEPEST_M, Math.max(0.001, this.depthM.value + byM));
    this.send();
  }

  letGo(): void {
    const place = this.place.peek();
    if (!place) return;
    clearInterval(this.again);
    this.again = undefined;
    this.place.value = undefined;
    if (this.stays.peek()) {
      this.left.add(place.link);
      void this.ask(this.request(place, 0));
      this.bodyId++;
      return;
    }
    void this.session.simulation.release({ link: place.link, bodyId: this.bodyId }).catch(() => undefined);
  }

  releaseAll(): void {
    this.letGo();
    for (const link of this.left) this.tell(this.session.simulation.release({ link }));
    this.left.clear();
    this.bodyId = 1n;
  }

  /** Inside the link's skin, Pa. */
  setPressure(link: string, pressurePa: number): void {
    this.tell(this.session.simulation.setScenePressure({ link, pressurePa }));
  }

  /** The joint that swings the link in its scene. */
  moveJoint(link: string, positionRad: number): void {
    this.tell(this.session.simulation.moveSceneJoint({ link, positionRad }));
  }

  /** Pressure and joint as the scene has them. */
  followScene(link: string): void {
    this.tell(this.session.simulation.setScenePressure({ link }));
    this.session.simulation.moveSceneJoint({ link }).catch(() => undefined); // not every scene has one
  }

  private tell(answer: Promise<unknown>): void {
    answer.catch((error: unknown) => this.onTrouble(messageOf(error)));
  }

  private request({ link, angleRad, zM }: SkinPlace, holdS: number) {
    const load = { case: "depthM" as const, value: this.depthM.peek() };
    return { link, bodyId: this.bodyId, shape: this.shape.peek(), angleRad, zM, load, holdS };
  }

  // One call at a time: what changed meanwhile follows in the next.
  private send(): void {
    const place = this.place.peek();
    if (!place) return;
    this.changed = true;
    if (this.sending) return;
    this.sending = true;
    this.changed = false;
    void this.ask(this.request(place, HOLD_S)).finally(() => {
      this.sending = false;
      if (this.changed) this.send();
    });
  }

  private async ask(request: ReturnType<Poker["request"]>): Promise<void> {
    try {
      await this.session.simulation.press(request, { timeoutMs: 3000 });
    } catch (error) {
      this.onTrouble(messageOf(error));
    }
  }
}
