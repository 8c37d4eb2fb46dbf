import * as THREE from "three";
import type { LinkModel } from "../api/gen/taclink/v1/arm_pb";
import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";
import { colourIndex } from "../skin/colour_map";
import { isKnown, MarkerFields, type Quantity } from "../skin/fields";
import { SkinSurface } from "../skin/surface";

const CAP_LENGTH_M = 0.012;
const CAP_COLOUR = 0x3a4048;
const CAP_SELECTED = 0x2f81f7;
const UNMEASURED = 0x808890;
const OUTLINE = 0xffffff;
const OUTLINE_ABOVE_M = 0.0008; // the skin, so that it is not hidden between the vertices that are drawn

/** How scalar values become colours. */
export interface Colouring {
  quantity: Quantity;
  /** 256 colours, linear RGB. */
  table: Float32Array;
  /** Value of the last colour, SI. */
  range: number;
}

/** One link in the scene: its skin as it is deformed now, between the rings that clamp it. */
export class LinkObject {
  readonly group = new THREE.Group();
  readonly skin: THREE.Mesh<THREE.BufferGeometry, THREE.MeshLambertMaterial>;
  /** The largest value drawn last, SI. */
  largest = 0;

  private readonly surface: SkinSurface;
  private readonly fields: MarkerFields;
  private readonly colours: THREE.BufferAttribute;
  private readonly caps: THREE.MeshLambertMaterial;
  private readonly outlines = new THREE.LineSegments(
    new THREE.BufferGeometry(),
    new THREE.LineBasicMaterial({ color: OUTLINE }),
  );

  constructor(
    readonly name: string,
    readonly model: LinkModel,
  ) {
    this.surface = new SkinSurface(model);
    this.fields = new MarkerFields(model);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.surface.positions, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(this.surface.normals, 3));
    this.colours = new THREE.BufferAttribute(new Float32Array(this.surface.positions.length), 3);
    geometry.setAttribute("color", this.colours);
    geometry.setIndex(new THREE.BufferAttribute(this.surface.indices, 1));
    this.skin = new THREE.Mesh(
      geometry,
      new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }),
    );
    this.skin.userData.link = name;
    this.caps = new THREE.MeshLambertMaterial({ color: CAP_COLOUR });
    this.outlines.frustumCulled = false;
    this.outlines.userData.link = name;
    this.group.add(this.skin, this.outlines, this.cap(0), this.cap(model.lengthM));
    // A skin dents by less than its radius.
    const radius = Math.max(...model.profileRadiusM, 0.01);
    geometry.boundingSphere = new THREE.Sphere(
      new THREE.Vector3(0, 0, model.lengthM / 2),
      Math.hypot(model.lengthM / 2, radius) * 1.5,
    );
    this.group.matrixAutoUpdate = false;
  }

  private cap(z: number): THREE.Mesh {
    const at = z === 0 ? 0 : this.model.profileRadiusM.length - 1;
    const radius = (this.model.profileRadiusM[at] ?? 0.02) * 1.04;
    const cap = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, CAP_LENGTH_M, 48), this.caps);
    cap.rotation.x = Math.PI / 2;
    cap.position.z = z === 0 ? -CAP_LENGTH_M / 2 : z + CAP_LENGTH_M / 2;
    cap.userData.link = this.name;
    return cap;
  }

  place(pose: Pose | undefined): void {
    const t = pose?.translationM;
    const q = pose?.rotation;
    this.group.matrix.compose(
      new THREE.Vector3(t?.x ?? 0, t?.y ?? 0, t?.z ?? 0),
      q ? new THREE.Quaternion(q.x, q.y, q.z, q.w) : new THREE.Quaternion(),
      new THREE.Vector3(1, 1, 1),
    );
    this.group.updateMatrixWorld(true);
  }

  select(selected: boolean): void {
    this.caps.color.set(selected ? CAP_SELECTED : CAP_COLOUR);
  }

  /** Without a frame nothing is measured, and it shows; so does a skin whose pressures are not known. */
  update(frame: LinkFrame | undefined, colouring: Colouring): void {
    const { surface } = this;
    if (frame)
      surface.update(this.fields.displacements(frame), this.fields.values(frame, colouring.quantity));
    else surface.update(undefined, undefined);
    const known = frame !== undefined && isKnown(frame, colouring.quantity);
    this.skin.material.vertexColors = known;
    this.skin.material.wireframe = frame === undefined;
    this.skin.material.color.set(known ? 0xffffff : UNMEASURED);
    this.skin.material.needsUpdate = true;
    this.paint(colouring);
    this.skin.geometry.attributes.position.needsUpdate = true;
    this.skin.geometry.attributes.normal.needsUpdate = true;
  }

  private paint({ table, range }: Colouring): void {
    const { values } = this.surface;
    const colours = this.colours.array;
    let largest = 0;
    for (let vertex = 0; vertex < values.length; ++vertex) {
      const value = values[vertex];
      if (value > largest) largest = value;
      const from = 3 * colourIndex(value, range);
      colours[3 * vertex] = table[from];
      colours[3 * vertex + 1] = table[from + 1];
      colours[3 * vertex + 2] = table[from + 2];
    }
    this.largest = largest;
    this.colours.needsUpdate = true;
  }

  /** Draws the contacts' outlines: x, y, z of each corner, link frame, m. */
  outline(contacts: readonly (readonly number[])[]): void {
    const points: number[] = [];
    for (const corners of contacts) {
      const corner = (i: number) => {
        const [x, y, z] = [0, 1, 2].map((axis) => corners[(3 * i + axis) % corners.length]);
        const out = 1 + OUTLINE_ABOVE_M / Math.max(Math.hypot(x, y), OUTLINE_ABOVE_M);
        points.push(x * out, y * out, z);
      };
      for (let i = 0; 3 * i < corners.length; ++i) {
        corner(i);
        corner(i + 1);
      }
    }
    const { geometry } = this.outlines;
    if (points.length === 0 && !this.outlines.visible) return;
    this.outlines.visible = points.length > 0;
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  }

  /** The middle of the link, base frame. */
  center(): THREE.Vector3 {
    return new THREE.Vector3(0, 0, this.model.lengthM / 2).applyMatrix4(this.group.matrix);
  }

  dispose(): void {
    this.group.traverse((object) => {
      if (object instanceof THREE.Mesh) object.geometry.dispose();
    });
    this.outlines.geometry.dispose();
    this.outlines.material.dispose();
    this.skin.material.dispose();
    this.caps.dispose();
  }
}
