import type { SkinPlace } from "../model/poker";

const WHEEL_M = 0.001; // deeper by a notch of the wheel
const NOTCH = 100; // of a wheel event's delta, px

export interface PointerTarget {
  /** Where the pointer meets a skin that can be pressed; undefined: elsewhere. `link`: only that one's. */
  placeAt(clientX: number, clientY: number, link?: string): SkinPlace | undefined;
  press(place: SkinPlace): void;
  deepen(byM: number): void;
  letGo(): void;
  /** Whether a drag turns the view. */
  allowTurning(allowed: boolean): void;
}

/** Mouse, pen or finger on a skin: down presses, a drag moves the body along the skin, the wheel changes its depth. */
export class SkinPointer {
  private pressing: { id: number; link: string } | undefined;

  constructor(
    private readonly host: HTMLElement,
    private readonly target: PointerTarget,
  ) {
    // Before the controls that turn the view.
    host.addEventListener("pointerdown", this.down, { capture: true });
    host.addEventListener("pointermove", this.move, { capture: true });
    host.addEventListener("pointerup", this.up, { capture: true });
    host.addEventListener("pointercancel", this.up, { capture: true });
    host.addEventListener("wheel", this.wheel, { capture: true, passive: false });
  }

  dispose(): void {
    this.end();
    this.host.removeEventListener("pointerdown", this.down, { capture: true });
    this.host.removeEventListener("pointermove", this.move, { capture: true });
    this.host.removeEventListener("pointerup", this.up, { capture: true });
    this.host.removeEventListener("pointercancel", this.up, { capture: true });
    this.host.removeEventListener("wheel", this.wheel, { capture: true });
  }

  private readonly down = (event: PointerEvent): void => {
    if (event.button !== 0 || this.pressing) return;
    const place = this.target.placeAt(event.clientX, event.clientY);
    this.target.allowTurning(!place);
    if (!place) return;
    this.pressing = { id: event.pointerId, link: place.link };
    this.host.setPointerCapture(event.pointerId);
    this.target.press(place);
  };

  private readonly move = (event: PointerEvent): void => {
    if (event.pointerId !== this.pressing?.id) return;
    const place = this.target.placeAt(event.clientX, event.clientY, this.pressing.link);
    if (place) this.target.press(place);
  };

  private readonly up = (event: PointerEvent): void => {
    if (event.pointerId === this.pressing?.id) this.end();
  };

  private readonly wheel = (event: WheelEvent): void => {
    if (!this.pressing) return;
    event.preventDefault();
    event.stopPropagation();
    this.target.deepen((-event.deltaY / NOTCH) * WHEEL_M);
  };

  private end(): void {
    if (!this.pressing) return;
    this.pressing = undefined;
    this.target.allowTurning(true);
    this.target.letGo();
  }
}
