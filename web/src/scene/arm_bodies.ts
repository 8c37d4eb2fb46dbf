import * as THREE from "three";
import { VisualShape, type Arm, type Visual } from "../api/gen/taclink/v1/arm_pb";
import type { FramePose } from "../api/gen/taclink/v1/contacts_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";

const COLOUR = 0x39424c; // of a body whose URDF names none

/** The arm's rigid bodies, as its URDF draws them. */
export class ArmBodies {
  readonly group = new THREE.Group();
  private shown: readonly Visual[] = [];
  private signature = "";
  private arm: Arm | undefined;

  /** Whether the URDF draws any. `frames`: where they are; of those that are not among them as the Arm has it. */
  show(arm: Arm, frames: readonly FramePose[]): boolean {
    if (arm !== this.arm) {
      this.arm = arm;
      const signature = JSON.stringify(arm.visuals.map((each) => ({ ...each, baseFromFrame: undefined })));
      if (signature !== this.signature) this.make(arm.visuals);
      this.signature = signature;
    }
    const places = new Map(frames.map((each) => [each.frame, each.baseFromFrame]));
    for (const [i, visual] of this.shown.entries()) {
      const frame = matrixOf(places.get(visual.frame) ?? arm.visuals[i].baseFromFrame);
      this.group.children[i].matrix.multiplyMatrices(frame, matrixOf(visual.frameFromVisual));
    }
    return this.shown.length > 0;
  }

  /** Corners of their surroundings. */
  outline(): THREE.Vector3[] {
    if (this.shown.length === 0) return [];
    const { min, max } = new THREE.Box3().setFromObject(this.group);
    return [min, max];
  }

  private make(visuals: readonly Visual[]): void {
    this.dispose();
    this.shown = visuals;
    for (const visual of visuals) {
      const [r, g, b] = visual.color;
      const colour =
        visual.color.length === 3 ? new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace) : COLOUR;
      const material = new THREE.MeshPhongMaterial({ color: colour, shininess: 50 });
      const body = new THREE.Mesh(geometryOf(visual), material);
      body.matrixAutoUpdate = false;
      this.group.add(body);
    }
  }

  dispose(): void {
    for (const child of this.group.children) {
      const body = child as THREE.Mesh<THREE.BufferGeometry, THREE.Material>;
      body.geometry.dispose();
      body.material.dispose();
    }
    this.group.clear();
    this.shown = [];
  }
}

function geometryOf({ shape, sizeM }: Visual): THREE.BufferGeometry {
  const { x, y, z } = sizeM ?? { x: 0, y: 0, z: 0 };
  if (shape === VisualShape.SPHERE) return new THREE.SphereGeometry(x / 2, 32, 20);
  if (shape === VisualShape.BOX) return new THREE.BoxGeometry(x, y, z);
  // three.js has the axis along y.
  return new THREE.CylinderGeometry(x / 2, x / 2, z, 48).rotateX(Math.PI / 2);
}

function matrixOf(pose: Pose | undefined): THREE.Matrix4 {
  const { translationM: t, rotation: q } = pose ?? {};
  const place = t ? new THREE.Vector3(t.x, t.y, t.z) : new THREE.Vector3();
  const turn = q ? new THREE.Quaternion(q.x, q.y, q.z, q.w) : new THREE.Quaternion();
  return new THREE.Matrix4().compose(place, turn, new THREE.Vector3(1, 1, 1));
}
