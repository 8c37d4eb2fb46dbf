import * as THREE from "three";

const COLOUR = 0xff6a13;
const HEAD = 0.012;
const HEAD_RADIUS = 0.005;
const SHAFT_RADIUS = 0.0018;

export interface ForceArrow {
  /** Where it points to, base frame, m. */
  tip: THREE.Vector3;
  /** Base frame, N. */
  force: THREE.Vector3;
  text: string;
}

/** Arrows that point at where something pushes, as long as it pushes hard. Behind a skin they shine through. */
export class ForceArrows {
  readonly group = new THREE.Group();
  private readonly material = new THREE.MeshBasicMaterial({ color: COLOUR });
  private readonly ghost = new THREE.MeshBasicMaterial({
    color: COLOUR,
    transparent: true,
    opacity: 0.35,
    depthTest: false,
  });
  private readonly shaft = new THREE.CylinderGeometry(SHAFT_RADIUS, SHAFT_RADIUS, 1, 12).translate(0, 0.5, 0);
  private readonly head = new THREE.ConeGeometry(HEAD_RADIUS, HEAD, 20).translate(0, -HEAD / 2, 0);

  /** `metresPerNewton`: length of an arrow. */
  show(arrows: readonly ForceArrow[], metresPerNewton: number): void {
    while (this.group.children.length < arrows.length) this.group.add(this.makeArrow());
    this.group.children.forEach((child, i) => {
      child.visible = i < arrows.length;
      if (i < arrows.length) this.lay(child, arrows[i], metresPerNewton);
    });
  }

  private makeArrow(): THREE.Object3D {
    const arrow = new THREE.Group();
    for (const material of [this.material, this.ghost])
      arrow.add(new THREE.Mesh(this.shaft, material), new THREE.Mesh(this.head, material));
    return arrow;
  }

  // +y of an arrow is its direction; its tip is its origin.
  private lay(arrow: THREE.Object3D, { tip, force }: ForceArrow, metresPerNewton: number): void {
    const length = Math.max(force.length() * metresPerNewton, 1.5 * HEAD);
    for (const shaft of [arrow.children[0], arrow.children[2]]) {
      shaft.position.y = -length;
      shaft.scale.y = length - HEAD / 2;
    }
    arrow.position.copy(tip);
    arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), force.clone().normalize());
  }

  dispose(): void {
    for (const each of [this.material, this.ghost, this.shaft, this.head]) each.dispose();
  }

  /** Where an arrow begins: its label's place. */
  static tail({ tip, force }: ForceArrow, metresPerNewton: number): THREE.Vector3 {
    const length = Math.max(force.length() * metresPerNewton, 1.5 * HEAD);
    return tip.clone().addScaledVector(force.clone().normalize(), -length - 0.006);
  }
}
