import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Arm } from "../api/gen/taclink/v1/arm_pb";
import type { ArmStore } from "../model/arm_store";
import { lengthOf } from "../model/vectors";
import { colourTable, StickyRange, type ColourMapName } from "../skin/colour_map";
import { QUANTITIES, type Quantity } from "../skin/fields";
import { sameShape } from "../skin/same_shape";
import { ForceArrows, type ForceArrow } from "./force_arrows";
import { Labels, type Label } from "./labels";
import { LinkObject } from "./link_object";

const LONGEST_ARROW_M = 0.1;
const FIRST_ARROW_RANGE_N = 2;
const DRAG_PX = 4;

/** What the legend tells. */
export interface Scales {
  /** Top of the colour scale, in the unit of the quantity. */
  top: number;
  /** Force of an arrow of LONGEST_ARROW_M, N. */
  arrowN: number;
  arrowM: number;
}

/** The whole arm in 3-D. Draws only when something has changed. */
export class ArmScene {
  onPick: (link: string) => void = () => undefined;
  onScales: (scales: Scales) => void = () => undefined;

  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(40, 1, 0.01, 50);
  private readonly controls: OrbitControls;
  private readonly labels: Labels;
  private readonly arrows = new ForceArrows();
  private readonly floor = new THREE.GridHelper(2, 20);
  private readonly links = new Map<string, LinkObject>();
  private readonly changed = new Set<string>();
  private readonly resizes: ResizeObserver;
  private readonly endListening: () => void;
  private drawing = 0;
  private fitted = false;

  private quantity: Quantity = "pressure";
  private table = new Float32Array(768);
  private ranges: Record<Quantity, StickyRange>;
  private arrowRange = new StickyRange(FIRST_ARROW_RANGE_N);
  private selected = "";
  private pressedAt = [0, 0];

  /** Throws where the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    labelHost: HTMLElement,
    private readonly store: ArmStore,
  ) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.requestDraw());
    this.labels = new Labels(labelHost);
    this.ranges = {
      pressure: new StickyRange(QUANTITIES.pressure.range),
      displacement: new StickyRange(QUANTITIES.displacement.range),
    };
    this.floor.rotation.x = Math.PI / 2;
    this.floor.material.transparent = true;
    this.floor.material.opacity = 0.25;
    const sun = new THREE.DirectionalLight(0xffffff, 1.1);
    sun.position.set(0.3, 0.6, 1);
    this.camera.add(sun);
    this.scene.add(new THREE.AmbientLight(0xffffff, 2.2), this.camera, this.floor, this.arrows.group);
    this.resizes = new ResizeObserver(() => this.resize());
    this.resizes.observe(canvas.parentElement!);
    canvas.addEventListener("pointerdown", this.press);
    canvas.addEventListener("click", this.pick);
    canvas.addEventListener("keydown", this.steer);
    this.endListening = store.onChange((link) => {
      this.changed.add(link);
      this.requestDraw();
    });
    this.setColours("pressure", "cividis");
    this.resize();
  }

  dispose(): void {
    cancelAnimationFrame(this.drawing);
    this.drawing = -1;
    this.endListening();
    this.resizes.disconnect();
    this.canvas.removeEventListener("pointerdown", this.press);
    this.canvas.removeEventListener("click", this.pick);
    this.canvas.removeEventListener("keydown", this.steer);
    this.controls.dispose();
    for (const link of this.links.values()) link.dispose();
    this.labels.dispose();
    this.arrows.dispose();
    this.floor.dispose();
    this.renderer.dispose();
  }

  setColours(quantity: Quantity, map: ColourMapName): void {
    this.quantity = quantity;
    const bytes = colourTable(map);
    const colour = new THREE.Color();
    for (let i = 0; i < 256; ++i) {
      colour.setRGB(bytes[3 * i] / 255, bytes[3 * i + 1] / 255, bytes[3 * i + 2] / 255, THREE.SRGBColorSpace);
      colour.toArray(this.table, 3 * i);
    }
    this.redrawAll();
    this.tellScales();
  }

  resetScales(): void {
    for (const quantity of Object.keys(QUANTITIES) as Quantity[])
      this.ranges[quantity] = new StickyRange(QUANTITIES[quantity].range);
    this.arrowRange = new StickyRange(FIRST_ARROW_RANGE_N);
    this.redrawAll();
    this.tellScales();
  }

  select(link: string): void {
    this.selected = link;
    for (const [name, object] of this.links) object.select(name === link);
    this.requestDraw();
  }

  /** Looks at one link: at its strongest contact, or without one from where the view is now. */
  focus(name: string): void {
    const link = this.links.get(name);
    if (!link) return;
    const box = new THREE.Box3().setFromObject(link.group);
    const normal = this.strongestNormal(name)?.transformDirection(link.group.matrix);
    if (normal) {
      const back = normal.add(new THREE.Vector3(0.3, -0.3, 0.3)).normalize();
      this.camera.position.copy(box.getCenter(new THREE.Vector3())).add(back);
    }
    this.lookAt(box);
  }

  /** Looks at the whole arm, from the side and a little above. */
  reset(): void {
    const box = new THREE.Box3();
    for (const link of this.links.values()) box.expandByObject(link.group);
    if (box.isEmpty()) return;
    this.camera.position.copy(box.getCenter(new THREE.Vector3())).add(new THREE.Vector3(1.2, -1.6, 0.7));
    this.lookAt(box);
    this.floor.position.z = Math.min(0, box.min.z);
  }

  private strongestNormal(name: string): THREE.Vector3 | undefined {
    const contacts = [...(this.store.link(name).newest?.contacts ?? [])];
    contacts.sort((a, b) => b.normalForceN - a.normalForceN);
    const normal = contacts[0]?.normal;
    return normal && new THREE.Vector3(normal.x, normal.y, normal.z);
  }

  // As near as the box just fits, from the side where the camera is.
  private lookAt(box: THREE.Box3): void {
    const center = box.getCenter(new THREE.Vector3());
    const back = this.camera.position.clone().sub(center).normalize();
    const right = new THREE.Vector3().crossVectors(this.camera.up, back).normalize();
    const up = new THREE.Vector3().crossVectors(back, right);
    const tan = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const at = (axis: "x" | "y" | "z", bit: number) => (corner & bit ? box.max[axis] : box.min[axis]);
      const p = new THREE.Vector3(at("x", 1), at("y", 2), at("z", 4)).sub(center);
      const high = Math.abs(p.dot(up)) / tan;
      const wide = Math.abs(p.dot(right)) / (tan * this.camera.aspect);
      distance = Math.max(distance, Math.max(high, wide) + p.dot(back));
    }
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(back, 1.12 * distance);
    this.controls.update();
    this.requestDraw();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.requestDraw();
  }

  private requestDraw(): void {
    if (this.drawing === 0) this.drawing = requestAnimationFrame(() => this.draw());
  }

  private redrawAll(): void {
    for (const name of this.links.keys()) this.changed.add(name);
    this.requestDraw();
  }

  private draw(): void {
    this.drawing = 0;
    const arm = this.store.arm.value;
    if (!arm) return;
    this.followArm(arm);
    const changed = [...this.changed];
    this.changed.clear();
    for (const name of changed) this.updateLink(arm, name);
    const arrows = this.findArrows(arm);
    const metresPerNewton = LONGEST_ARROW_M / this.arrowRange.top;
    this.arrows.show(arrows, metresPerNewton);
    if (!this.fitted) {
      this.fitted = true;
      this.reset();
    }
    this.renderer.render(this.scene, this.camera);
    const texts: Label[] = arrows.map((arrow) => ({
      place: ForceArrows.tail(arrow, metresPerNewton),
      text: arrow.text,
      kind: "force",
    }));
    for (const link of this.links.values())
      texts.push({
        place: this.nameplate(link),
        text: link.name,
        kind: "link",
        marked: link.name === this.selected,
      });
    this.labels.show(texts, this.camera, this.canvas.clientWidth, this.canvas.clientHeight);
    this.canvas.dataset.frames = String(Number(this.canvas.dataset.frames ?? 0) + 1);
  }

  private nameplate(link: LinkObject): THREE.Vector3 {
    const side = new THREE.Vector3(1, 0, 0).applyQuaternion(this.camera.quaternion);
    return link.center().addScaledVector(side, -1.4 * Math.max(...link.model.profileRadiusM) - 0.04);
  }

  // Links come and go with a configuration.
  private followArm(arm: Arm): void {
    const names = new Set(arm.links.map((link) => link.name));
    for (const [name, object] of this.links) {
      const link = arm.links.find((each) => each.name === name);
      if (link?.model && sameShape(link.model, object.model)) continue;
      this.scene.remove(object.group);
      object.dispose();
      this.links.delete(name);
    }
    for (const link of arm.links) {
      if (!link.model?.markers || this.links.has(link.name)) continue;
      const object = new LinkObject(link.name, link.model);
      object.select(link.name === this.selected);
      this.links.set(link.name, object);
      this.scene.add(object.group);
      this.changed.add(link.name);
      this.fitted = this.fitted && names.size === this.links.size;
    }
  }

  private updateLink(arm: Arm, name: string): void {
    const object = this.links.get(name);
    if (!object) return;
    const record = this.store.link(name);
    object.place(record.pose ?? arm.links.find((link) => link.name === name)?.baseFromLink);
    const { scale } = QUANTITIES[this.quantity];
    const range = this.ranges[this.quantity];
    object.update(record.shape, { quantity: this.quantity, table: this.table, range: range.top * scale });
    if (range.include(object.largest / scale)) {
      this.redrawAll();
      this.tellScales();
    }
  }

  private findArrows(arm: Arm): ForceArrow[] {
    const out: ForceArrow[] = [];
    for (const link of arm.links) {
      const object = this.links.get(link.name);
      const frame = this.store.link(link.name).newest;
      if (!object) continue;
      if (!frame) {
        object.outline([]);
        continue;
      }
      object.outline(frame.contacts.map((contact) => contact.outlineM));
      for (const contact of frame.contacts) {
        const { centerM, forceN } = contact;
        if (!centerM || !forceN) continue;
        const newtons = lengthOf(forceN);
        if (this.arrowRange.include(newtons)) this.tellScales();
        const rotation = new THREE.Matrix3().setFromMatrix4(object.group.matrix);
        out.push({
          tip: new THREE.Vector3(centerM.x, centerM.y, centerM.z).applyMatrix4(object.group.matrix),
          force: new THREE.Vector3(forceN.x, forceN.y, forceN.z).applyMatrix3(rotation),
          text: `${(contact.isRingContact ? contact.normalForceN : newtons).toFixed(2)} N  #${contact.id}`,
        });
      }
    }
    return out;
  }

  private tellScales(): void {
    this.onScales({
      top: this.ranges[this.quantity].top,
      arrowN: this.arrowRange.top,
      arrowM: LONGEST_ARROW_M,
    });
  }

  private readonly press = (event: PointerEvent): void => {
    this.pressedAt = [event.clientX, event.clientY];
  };

  // A drag turns the view and ends with a click as well.
  private readonly pick = (event: MouseEvent): void => {
    if (Math.hypot(event.clientX - this.pressedAt[0], event.clientY - this.pressedAt[1]) > DRAG_PX) return;
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    const hit = ray.intersectObjects([...this.links.values()].map((link) => link.group))[0];
    if (hit) this.onPick(String(hit.object.userData.link));
  };

  private readonly steer = (event: KeyboardEvent): void => {
    const turn = 0.1;
    const steps: Record<string, () => void> = {
      ArrowLeft: () => this.orbit(-turn, 0),
      ArrowRight: () => this.orbit(turn, 0),
      ArrowUp: () => this.orbit(0, -turn),
      ArrowDown: () => this.orbit(0, turn),
      "+": () => this.zoom(0.85),
      "-": () => this.zoom(1 / 0.85),
      Home: () => this.reset(),
    };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    step();
  };

  private orbit(azimuth: number, polar: number): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    away.applyAxisAngle(new THREE.Vector3(0, 0, 1), azimuth);
    const axis = new THREE.Vector3().crossVectors(new THREE.Vector3(0, 0, 1), away).normalize();
    const angle = away.angleTo(new THREE.Vector3(0, 0, 1));
    away.applyAxisAngle(axis, Math.min(3, Math.max(0.14, angle + polar)) - angle);
    this.camera.position.copy(this.controls.target).add(away);
    this.controls.update();
  }

  private zoom(factor: number): void {
    const away = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    this.camera.position.copy(this.controls.target).add(away);
    this.controls.update();
  }
}
