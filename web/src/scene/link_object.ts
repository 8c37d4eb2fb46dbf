import * as THREE from "three";
import type { LinkModel } from "../api/gen/taclink/v1/arm_pb";
import type { LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import type { Pose } from "../api/gen/taclink/v1/geometry_pb";
import { colourIndex } from "../skin/colour_map";
import { isKnown, MarkerFields, type Quantity } from "../skin/fields";
import { SkinSurface } from "../skin/surface";
import { hatching } from "./hatching";

const FLANGE_LENGTH_M = 0.014;
const FLANGE_COLOUR = 0x4a525c;
const FLANGE_SELECTED = 0x2f81f7;
const NOISE_SHARE = 0.03; // of the scale, below which a value is drawn as none

/** How scalar values become colours. */
export interface Colouring {
  quantity: Quantity;
  /** 256 colours, linear RGB. */
  table: Float32Array;
  /** Value of the last colour, SI. */
  range: number;
  /** Of the displacements that are drawn. */
  depthScale: number;
}

/** One link in the scene: its skin as it is deformed now, between the rings that clamp it. */
export class LinkObject {
  readonly group = new THREE.Group();
  readonly skin: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhongMaterial>;
  /** The largest value drawn last, SI. */
  largest = 0;

  private readonly surface: SkinSurface;
  private readonly fields: MarkerFields;
  private readonly colours: THREE.BufferAttribute;
  private readonly hatch = hatching();
  private readonly flanges = new THREE.MeshPhongMaterial({ color: FLANGE_COLOUR, shininess: 60 });

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
    geometry.setAttribute("uv", new THREE.BufferAttribute(this.surface.gridPlaces(), 2));
    geometry.setIndex(new THREE.BufferAttribute(this.surface.indices, 1));
    this.skin = new THREE.Mesh(
      geometry,
      new THREE.MeshPhongMaterial({
        vertexColors: true,
        side: THREE.DoubleSide,
        shininess: 22,
        specular: 0x2a2a2a,
      }),
    );
    this.skin.userData.link = name;
    this.group.add(this.skin, this.flange(0), this.flange(model.lengthM));
    // A skin dents by less than its radius.
    const radius = Math.max(...model.profileRadiusM, 0.01);
    geometry.boundingSphere = new THREE.Sphere(
      new THREE.Vector3(0, 0, model.lengthM / 2),
      Math.hypot(model.lengthM / 2, radius) * 1.5,
    );
    this.group.matrixAutoUpdate = false;
  }

  // What clamps the skin's end: a ring with a rounded edge and a neck.
  private flange(z: number): THREE.Mesh {
    const at = z === 0 ? 0 : this.model.profileRadiusM.length - 1;
    const radius = this.model.profileRadiusM[at] ?? 0.02;
    const profile = [
      [0.02, 0],
      [1.04, 0],
      [1.08, 0.12],
      [1.08, 0.45],
      [1.02, 0.6],
      [0.72, 0.68],
      [0.7, 1],
      [0.02, 1],
    ].map(([share, along]) => new THREE.Vector2(share * radius, along * FLANGE_LENGTH_M));
    const flange = new THREE.Mesh(new THREE.LatheGeometry(profile, 48), this.flanges);
    flange.rotation.x = z === 0 ? -Math.PI / 2 : Math.PI / 2;
    flange.position.z = z;
    flange.userData.link = this.name;
    return flange;
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
    this.flanges.color.set(selected ? FLANGE_SELECTED : FLANGE_COLOUR);
  }

  /** Hatched while nothing is measured, or the pressures are not known. */
  update(frame: LinkFrame | undefined, colouring: Colouring): void {
    const { surface } = this;
    if (frame)
      surface.update(
        this.fields.displacements(frame),
        this.fields.values(frame, colouring.quantity),
        colouring.depthScale,
      );
    else surface.update(undefined, undefined);
    const known = frame !== undefined && isKnown(frame, colouring.quantity);
    if (known === (this.skin.material.map !== null)) {
      this.skin.material.vertexColors = known;
      this.skin.material.map = known ? null : this.hatch;
      this.skin.material.needsUpdate = true;
    }
    this.largest = 0;
    if (known) this.paint(colouring);
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
      const from = 3 * colourIndex(value < NOISE_SHARE * range ? 0 : value, range);
      colours[3 * vertex] = table[from];
      colours[3 * vertex + 1] = table[from + 1];
      colours[3 * vertex + 2] = table[from + 2];
    }
    this.largest = largest;
    this.colours.needsUpdate = true;
  }

  /** The middle of the link, base frame. */
  center(): THREE.Vector3 {
    return new THREE.Vector3(0, 0, this.model.lengthM / 2).applyMatrix4(this.group.matrix);
  }

  /** The middle of a clamped end, base frame. */
  end(far: boolean): THREE.Vector3 {
    return new THREE.Vector3(0, 0, far ? this.model.lengthM : 0).applyMatrix4(this.group.matrix);
  }

  get endRadiusM(): number {
    return this.model.profileRadiusM.at(-1) ?? 0.02;
  }

  /** The link's outline, base frame: around both ends and the middle. */
  surroundings(): THREE.Vector3[] {
    const radius = Math.max(...this.model.profileRadiusM);
    const out: THREE.Vector3[] = [];
    for (const z of [0, this.model.lengthM / 2, this.model.lengthM])
      for (let i = 0; i < 8; ++i) {
        const angle = (i / 8) * 2 * Math.PI;
        out.push(
          new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), z).applyMatrix4(
            this.group.matrix,
          ),
        );
      }
    return out;
  }

  dispose(): void {
    this.group.traverse((object) => {
      if (object instanceof THREE.Mesh) object.geometry.dispose();
    });
    this.skin.material.dispose();
    this.hatch.dispose();
    this.flanges.dispose();
  }
}
