import * as THREE from "three";
import type { LinkObject } from "./link_object";

const COLOUR = 0x2c333b;
const RADIUS = 0.62; // of the skin's at its clamped end
const LONGEST_M = 0.15; // a longer gap is not one piece of an arm

/** What holds the links: pieces between one link's end and the next one's beginning, and a foot on the floor. */
export class Bones {
  readonly group = new THREE.Group();
  private readonly material = new THREE.MeshPhongMaterial({ color: COLOUR, shininess: 50 });
  private readonly piece = new THREE.CylinderGeometry(1, 1, 1, 40);
  private readonly foot = new THREE.CylinderGeometry(1, 1.25, 1, 48);

  /** `links`: in the arm's order. */
  show(links: readonly LinkObject[], floorZ: number): void {
    this.group.clear();
    for (let i = 0; i + 1 < links.length; ++i) {
      const [from, to] = [links[i].end(true), links[i + 1].end(false)];
      if (from.distanceTo(to) < LONGEST_M) this.add(this.piece, from, to, RADIUS * links[i].endRadiusM);
    }
    if (links.length === 0) return;
    const first = links[0].end(false);
    const under = new THREE.Vector3(first.x, first.y, floorZ);
    if (first.z - floorZ > 0.001 && first.z - floorZ < 2 * LONGEST_M)
      this.add(this.foot, under, first, 1.05 * links[0].endRadiusM);
  }

  private add(geometry: THREE.BufferGeometry, from: THREE.Vector3, to: THREE.Vector3, radiusM: number): void {
    const bone = new THREE.Mesh(geometry, this.material);
    const along = to.clone().sub(from);
    bone.position.copy(from).addScaledVector(along, 0.5);
    bone.scale.set(radiusM, along.length(), radiusM);
    bone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
    this.group.add(bone);
  }

  dispose(): void {
    this.material.dispose();
    this.piece.dispose();
    this.foot.dispose();
  }
}
