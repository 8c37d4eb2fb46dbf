import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Arm } from "../api/gen/taclink/v1/arm_pb";
import type { ArmStore } from "../model/arm_store";
import { magnitudeN } from "../model/magnitude";
import { lengthOf } from "../model/vectors";
import { colourTable, StickyRange, type ColourMapName } from "../skin/colour_map";
import { QUANTITIES, type Quantity } from "../skin/fields";
import { sameShape } from "../skin/same_shape";
import type { SkinPlace } from "../model/poker";
import { ArmBodies } from "./arm_bodies";
import { Bones } from "./bones";
import { ForceArrows, type ForceArrow } from "./force_arrows";
import { sizeOf } from "../ui/element_size";
import { fitView } from "./fit_view";
import { Labels, type Label } from "./labels";
import { Lens, type LensPlace } from "./lens";
import { LinkObject } from "./link_object";
import { SkinPointer } from "./skin_pointer";

const LONGEST_ARROW = 1 / 3; // of a link's length
const FIRST_ARROW_RANGE_N = 0.5;
const CLAMP_M = 0.004; // nothing presses nearer to a clamped end
const DRAG_PX = 4;
const FOOT_M = 0.06; // of the floor below the lowest link

/** What the legend tells. */
export interface Scales {
  /** Top of the colour scale, in the unit of the quantity. */
  top: number;
  /** Force of an arrow of arrowM, N. */
  arrowN: number;
  arrowM: number;
}

/** The whole arm in 3-D. Draws only when something has changed. */
export class ArmScene {
  onPick: (link: string) => void = () => undefined;
  onScales: (scales: Scales) => void = () => undefined;
  /** The newest contact, seen from near by: what and where; undefined: there is none, or no room. */
  onLens: (text: string, place: LensPlace | undefined) => void = () => undefined;
  /** A skin that may be pressed. */
  mayPress: (link: string) => boolean = () => false;
  onPress: (place: SkinPlace) => void = () => undefined;
  onDeepen: (byM: number) => void = () => undefined;
  onLetGo: () => void = () => undefined;

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
  private readonly bodies = new ArmBodies();
  private readonly bones = new Bones();
  private readonly lens: Lens;
  private readonly begun = new Map<string, number>(); // contacts of now, in the order in which they came
  private contactsBegun = 0;
  private readonly seen = new THREE.Box3(); // where links have been
  private followsArm = true; // the view, until somebody turns it

  private readonly pointer: SkinPointer;
  private quantity: Quantity = "pressure";
  private depthScale = 1;
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
    this.lens = new Lens(this.renderer);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.requestDraw());
    this.controls.addEventListener("start", () => (this.followsArm = false));
    this.labels = new Labels(labelHost);
    this.ranges = {
      pressure: new StickyRange(QUANTITIES.pressure.range),
      displacement: new StickyRange(QUANTITIES.displacement.range),
    };
    this.floor.rotation.x = Math.PI / 2;
    this.floor.material.transparent = true;
    this.floor.material.opacity = 0.25;
    // From the upper left of whoever looks, so that dents have a lit and a dark side.
    const sun = new THREE.DirectionalLight(0xffffff, 2.3);
    sun.position.set(-0.8, 0.9, 0.7);
    this.camera.add(sun);
    const sky = new THREE.HemisphereLight(0xffffff, 0x707883, 1.15);
    sky.position.set(0, 0, 1);
    this.scene.add(sky, this.camera, this.floor, this.bodies.group, this.bones.group, this.arrows.group);
    this.resizes = new ResizeObserver(() => this.resize());
    this.resizes.observe(canvas.parentElement!);
    this.pointer = new SkinPointer(canvas.parentElement!, {
      placeAt: (x, y, link) => this.placeAt(x, y, link),
      press: (place) => {
        this.followsArm = false;
        this.onPress(place);
      },
      deepen: (byM) => this.onDeepen(byM),
      letGo: () => this.onLetGo(),
      allowTurning: (allowed) => (this.controls.enabled = allowed),
    });
    canvas.addEventListener("pointerdown", this.press);
    canvas.addEventListener("click", this.pick);
    canvas.addEventListener("keydown", this.steer);
    this.endListening = store.onChange((link) => {
      this.changed.add(link);
      this.requestDraw();
    });
    this.setColours("pressure", "skin");
    this.resize();
  }

  dispose(): void {
    cancelAnimationFrame(this.drawing);
    this.drawing = -1;
    this.endListening();
    this.resizes.disconnect();
    this.pointer.dispose();
    this.canvas.removeEventListener("pointerdown", this.press);
    this.canvas.removeEventListener("click", this.pick);
    this.canvas.removeEventListener("keydown", this.steer);
    this.controls.dispose();
    for (const link of this.links.values()) link.dispose();
    this.labels.dispose();
    this.arrows.dispose();
    this.bodies.dispose();
    this.bones.dispose();
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

  setDepthScale(scale: number): void {
    this.depthScale = scale;
    this.redrawAll();
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
    this.followsArm = false;
    const box = new THREE.Box3().setFromObject(link.group);
    const normal = this.strongestNormal(name)?.transformDirection(link.group.matrix);
    if (normal) {
      const back = normal.add(new THREE.Vector3(0.3, -0.3, 0.3)).normalize();
      this.camera.position.copy(box.getCenter(new THREE.Vector3())).add(back);
    }
    this.lookAt(box);
  }

  /** Looks at the whole arm, from the side and a little above, wherever its links have been. */
  reset(): void {
    this.followsArm = true;
    const box = this.seen;
    if (box.isEmpty()) return;
    this.camera.position.copy(box.getCenter(new THREE.Vector3())).add(new THREE.Vector3(1.2, -1.6, 0.5));
    this.lookAt(box);
  }

  // While nobody has turned the view it takes in all places where the links have been.
  private follow(outline: readonly THREE.Vector3[]): void {
    const before = this.seen.clone();
    for (const point of outline) this.seen.expandByPoint(point);
    if (this.seen.equals(before)) return;
    this.floor.position.z = Math.min(
      0,
      this.seen.min.z - (this.bodies.group.children.length > 0 ? 0 : FOOT_M),
    );
    if (this.followsArm) this.reset();
  }

  private strongestNormal(name: string): THREE.Vector3 | undefined {
    const contacts = [...(this.store.link(name).newest?.contacts ?? [])];
    contacts.sort((a, b) => b.normalForceN - a.normalForceN);
    const normal = contacts[0]?.normal;
    return normal && new THREE.Vector3(normal.x, normal.y, normal.z);
  }

  private lookAt(box: THREE.Box3): void {
    this.controls.target.copy(box.getCenter(new THREE.Vector3()));
    fitView(this.camera, box);
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
    const metresPerNewton = this.longestArrowM() / this.arrowRange.top;
    this.arrows.show(arrows, metresPerNewton, this.camera.position);
    const hasBodies = this.bodies.show(arm, this.store.framePoses());
    const outline = [...this.links.values()].flatMap((link) => link.surroundings());
    this.follow([...outline, ...this.bodies.outline()]);
    const inOrder = arm.links.flatMap((link) => this.links.get(link.name) ?? []);
    this.bones.show(hasBodies ? [] : inOrder, this.floor.position.z);
    this.renderer.render(this.scene, this.camera);
    this.drawLens(arrows, outline);
    const texts: Label[] = arrows.map((arrow) => ({
      place: arrow.tip,
      text: arrow.text,
      kind: "force",
    }));
    for (const link of this.links.values())
      texts.push({
        place: link.center(),
        text: link.name,
        kind: "link",
        marked: link.name === this.selected,
      });
    const { width, height } = sizeOf(this.canvas);
    this.labels.show(texts, outline, this.camera, width, height);
    this.canvas.dataset.frames = String(Number(this.canvas.dataset.frames ?? 0) + 1);
  }

  private drawLens(arrows: readonly ForceArrow[], outline: readonly THREE.Vector3[]): void {
    const keys = new Set(arrows.map((arrow) => arrow.key));
    for (const key of this.begun.keys()) if (!keys.has(key)) this.begun.delete(key);
    for (const key of keys) if (!this.begun.has(key)) this.begun.set(key, this.contactsBegun++);
    const since = (arrow: ForceArrow) => this.begun.get(arrow.key) ?? -1;
    const newest = arrows.reduce<ForceArrow | undefined>(
      (best, arrow) => (best && since(best) > since(arrow) ? best : arrow),
      undefined,
    );
    const { width, height } = sizeOf(this.canvas);
    const onCanvas = outline.map((point): [number, number] => {
      const at = point.clone().project(this.camera);
      return [((at.x + 1) / 2) * width, ((at.y + 1) / 2) * height];
    });
    const place = newest && this.lens.place(width, height, onCanvas);
    if (newest && place) this.lens.draw(this.scene, newest.tip, newest.normal, place, width, height);
    this.onLens(newest?.text ?? "", place);
  }

  private longestArrowM(): number {
    const lengths = [...this.links.values()].map((link) => link.model.lengthM);
    return LONGEST_ARROW * Math.max(...lengths, 0.1);
  }

  // Links come and go with a configuration.
  private followArm(arm: Arm): void {
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
    }
  }

  private updateLink(arm: Arm, name: string): void {
    const object = this.links.get(name);
    if (!object) return;
    const record = this.store.link(name);
    object.place(record.pose ?? arm.links.find((link) => link.name === name)?.baseFromLink);
    const { scale } = QUANTITIES[this.quantity];
    const range = this.ranges[this.quantity];
    object.update(record.shape, {
      quantity: this.quantity,
      table: this.table,
      range: range.top * scale,
      depthScale: this.depthScale,
    });
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
      if (!object || !frame) continue;
      for (const contact of frame.contacts) {
        const { centerM, forceN, normal } = contact;
        if (!centerM || !forceN || !normal) continue;
        const newtons = lengthOf(forceN);
        if (this.arrowRange.include(newtons)) this.tellScales();
        const rotation = new THREE.Matrix3().setFromMatrix4(object.group.matrix);
        out.push({
          key: `${link.name} ${contact.id}`,
          link: link.name,
          tip: new THREE.Vector3(centerM.x, centerM.y, centerM.z).applyMatrix4(object.group.matrix),
          normal: new THREE.Vector3(normal.x, normal.y, normal.z).applyMatrix3(rotation),
          radiusM: Math.sqrt(contact.areaM2 / Math.PI),
          force: new THREE.Vector3(forceN.x, forceN.y, forceN.z).applyMatrix3(rotation),
          text: `${link.name} ${magnitudeN(contact).toFixed(2)} N`,
        });
      }
    }
    return out;
  }

  private tellScales(): void {
    this.onScales({
      top: this.ranges[this.quantity].top,
      arrowN: this.arrowRange.top,
      arrowM: this.longestArrowM(),
    });
  }

  private readonly press = (event: PointerEvent): void => {
    this.pressedAt = [event.clientX, event.clientY];
  };

  // A drag turns the view and ends with a click as well.
  private readonly pick = (event: MouseEvent): void => {
    if (Math.hypot(event.clientX - this.pressedAt[0], event.clientY - this.pressedAt[1]) > DRAG_PX) return;
    const hit = this.hitAt(event.clientX, event.clientY, [...this.links.values()]);
    if (hit) this.onPick(String(hit.object.userData.link));
  };

  private hitAt(clientX: number, clientY: number, links: LinkObject[]): THREE.Intersection | undefined {
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(
      ((clientX - box.left) / box.width) * 2 - 1,
      1 - ((clientY - box.top) / box.height) * 2,
    );
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray.intersectObjects(links.map((link) => link.group))[0];
  }

  private placeAt(clientX: number, clientY: number, name?: string): SkinPlace | undefined {
    const links = [...this.links.values()].filter((link) => name === undefined || link.name === name);
    const hit = this.hitAt(clientX, clientY, links);
    const link = this.links.get(String(hit?.object.userData.link));
    if (!hit || !link || hit.object !== link.skin || !this.mayPress(link.name)) return undefined;
    const p = hit.point.clone().applyMatrix4(link.group.matrix.clone().invert());
    const zM = Math.min(link.model.lengthM - CLAMP_M, Math.max(CLAMP_M, p.z));
    return { link: link.name, angleRad: Math.atan2(p.y, p.x), zM };
  }

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
