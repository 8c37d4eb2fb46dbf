import * as THREE from "three";

const COLOUR = 0xff6a13;
const HEAD = 0.012;
const HEAD_RADIUS = 0.005;
const SHAFT_RADIUS = 0.0018;

const ALONG_VIEW = 0.85; // cosine
const HALO_ABOVE_M = 0.0015; // the skin
const HALO_LEAST_M = 0.006;

export interface ForceArrow {
  /** Of the contact, as long as it lasts. */
  key: string;
  link: string;
  /** Where it points to, base frame, m. */
  tip: THREE.Vector3;
  /** Of the skin there, unit, base frame. */
  normal: THREE.Vector3;
  /** Radius of the loaded region, m. */
  radiusM: number;
  /** Base frame, N. */
  force: THREE.Vector3;
  text: string;
}

/**
 * An arrow that points at where something pushes, the longer the harder, and a ring around the spot. Behind a skin they
 * shine through.
 */
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
  private readonly halo = new THREE.TorusGeometry(1, 0.07, 8, 40);
  private readonly head = new THREE.ConeGeometry(HEAD_RADIUS, HEAD, 20).translate(0, -HEAD / 2, 0);

  /** `metresPerNewton`: length of an arrow. `eye`: where they are seen from; one that points at it hides no spot. */
  show(arrows: readonly ForceArrow[], metresPerNewton: number, eye: THREE.Vector3): void {
    while (this.group.children.length < arrows.length) this.group.add(this.makeArrow());
    this.group.children.forEach((child, i) => {
      child.visible = i < arrows.length;
      if (i >= arrows.length) return;
      this.lay(child, arrows[i], metresPerNewton);
      const { tip, force } = arrows[i];
      const view = eye.clone().sub(tip).normalize();
      const isAlongView = Math.abs(view.dot(force.clone().normalize())) > ALONG_VIEW;
      const [arrow] = child.children;
      for (const solid of arrow.children.slice(0, 2)) solid.visible = !isAlongView; // the ghost stays
    });
  }

  private makeArrow(): THREE.Object3D {
    const arrow = new THREE.Group();
    for (const material of [this.material, this.ghost])
      arrow.add(new THREE.Mesh(this.shaft, material), new THREE.Mesh(this.head, material));
    const halos = [this.material, this.ghost].map((material) => new THREE.Mesh(this.halo, material));
    return new THREE.Group().add(arrow, ...halos);
  }

  // +y of an arrow is its direction; its tip is its origin.
  private lay(group: THREE.Object3D, contact: ForceArrow, metresPerNewton: number): void {
    const { tip, force, normal, radiusM } = contact;
    const [arrow, ...halos] = group.children;
    for (const halo of halos) {
      halo.scale.setScalar(Math.max(radiusM, HALO_LEAST_M));
      halo.position.copy(tip).addScaledVector(normal, HALO_ABOVE_M);
      halo.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    }
    const length = Math.max(force.length() * metresPerNewton, 1.5 * HEAD);
    for (const shaft of [arrow.children[0], arrow.children[2]]) {
      shaft.position.y = -length;
      shaft.scale.y = length - HEAD / 2;
    }
    arrow.position.copy(tip);
    arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), force.clone().normalize());
  }

  dispose(): void {
    for (const each of [this.material, this.ghost, this.shaft, this.head, this.halo]) each.dispose();
  }
}
