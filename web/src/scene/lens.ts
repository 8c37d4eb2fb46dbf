import * as THREE from "three";

const AWAY_M = 0.19;
const SIDEWAYS = 0.45; // of the way away, so that a dent is seen as one
const SHARE = 0.34; // of the canvas' width
const MARGIN_PX = 8;
const BOTTOM_PX = 50; // the buttons are below
const LEAST_WIDTH_PX = 480; // of a canvas with a lens

/** Where the lens is on the canvas, CSS pixels from the lower left corner. */
export interface LensPlace {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** A second look, at one contact from near by, in a corner of the canvas. */
export class Lens {
  private readonly camera = new THREE.PerspectiveCamera(32, 1.25, 0.01, 5);

  constructor(private readonly renderer: THREE.WebGLRenderer) {
    this.camera.up.set(0, 0, 1);
  }

  /**
   * On the right, above or below, where less of the arm is. `arm`: points around it, CSS pixels from the lower left
   * corner. Undefined: there is no room.
   */
  place(width: number, height: number, arm: readonly [x: number, y: number][]): LensPlace | undefined {
    if (width < LEAST_WIDTH_PX) return undefined;
    const own = { width: SHARE * width, height: (SHARE * width) / this.camera.aspect };
    const places = [BOTTOM_PX, height - own.height - MARGIN_PX].map((y) => ({
      x: width - own.width - MARGIN_PX,
      y,
      ...own,
    }));
    const hidden = ({ x, y }: LensPlace) =>
      arm.filter(([px, py]) => px > x && px < x + own.width && py > y && py < y + own.height).length;
    return hidden(places[1]) < hidden(places[0]) ? places[1] : places[0];
  }

  /** Draws after the whole picture. `at`: a point of the skin and its normal, base frame. */
  draw(
    scene: THREE.Scene,
    at: THREE.Vector3,
    normal: THREE.Vector3,
    place: LensPlace,
    width: number,
    height: number,
  ): void {
    const side = new THREE.Vector3().crossVectors(this.camera.up, normal).normalize();
    this.camera.position
      .copy(at)
      .addScaledVector(normal, AWAY_M)
      .addScaledVector(side, -SIDEWAYS * AWAY_M)
      .addScaledVector(this.camera.up, SIDEWAYS * AWAY_M);
    this.camera.lookAt(at);
    this.renderer.setScissorTest(true);
    this.renderer.setScissor(place.x, place.y, place.width, place.height);
    this.renderer.setViewport(place.x, place.y, place.width, place.height);
    this.renderer.render(scene, this.camera);
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, width, height);
  }
}
