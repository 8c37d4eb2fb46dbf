import * as THREE from "three";

export interface Label {
  /** What it is about, base frame, m. */
  place: THREE.Vector3;
  text: string;
  kind: "link" | "force";
  marked?: boolean;
}

const GAP_PX = 26; // between the arm and its labels
const LINE_PX = 24; // between labels, top to top
const MARGIN_PX = 8;

interface LabelElement {
  element: HTMLElement;
  line: SVGLineElement;
  /** Of the text as it is now, px; to ask the element itself makes the browser lay out the page. Digits are equally wide. */
  width: number;
}

interface Laid extends LabelElement {
  anchor: [x: number, y: number];
  y: number;
  isRight: boolean;
  own: LabelElement;
}

/**
 * Text beside the arm, as elements of the page: sharp, and readable by other means than a canvas. Links are named on its
 * left; forces stand on its right, each with a line to the spot that it is about.
 */
export class Labels {
  private readonly elements: LabelElement[] = [];
  private readonly svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");

  constructor(private readonly host: HTMLElement) {
    host.append(this.svg);
  }

  dispose(): void {
    for (const { element } of this.elements) element.remove();
    this.svg.remove();
  }

  /** `arm`: points around the arm, base frame, which no label covers as far as there is room. */
  show(
    labels: readonly Label[],
    arm: readonly THREE.Vector3[],
    camera: THREE.Camera,
    width: number,
    height: number,
  ): void {
    while (this.elements.length < labels.length) {
      const element = this.host.appendChild(document.createElement("span"));
      const line = this.svg.appendChild(document.createElementNS("http://www.w3.org/2000/svg", "line"));
      this.elements.push({ element, line, width: NaN });
    }
    const screen = (point: THREE.Vector3): [number, number, number] => {
      const at = point.clone().project(camera);
      return [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height, at.z];
    };
    const across = arm.map((point) => screen(point)[0]);
    const left = Math.max(0, Math.min(...across) - GAP_PX);
    const right = Math.min(width, Math.max(...across) + GAP_PX);
    const laid: Laid[] = [];
    this.elements.forEach((own, i) => {
      const { element, line } = own;
      const label = labels[i];
      const [x, y, depth] = label ? screen(label.place) : [0, 0, 2];
      element.hidden = depth > 1 || x < 0 || x > width || y < 0 || y > height;
      line.style.display = element.hidden ? "none" : "";
      if (element.hidden || !label) return;
      const style = `label ${label.kind}${label.marked ? " marked" : ""}`;
      if (widthKey(element.textContent) !== widthKey(label.text) || element.className !== style)
        own.width = NaN;
      if (element.textContent !== label.text) element.textContent = label.text;
      if (element.className !== style) element.className = style;
      laid.push({ ...own, own, anchor: [x, y], y, isRight: label.kind === "force" });
    });
    for (const each of laid)
      if (Number.isNaN(each.width)) each.width = each.own.width = each.element.offsetWidth;
    for (const isRight of [false, true]) {
      const side = laid.filter((each) => each.isRight === isRight);
      spread(side, height);
      for (const each of side) this.place(each, isRight ? right : left, width);
    }
  }

  private place(laid: Laid, edge: number, width: number): void {
    const { element, line, anchor, y, isRight } = laid;
    const x = isRight
      ? Math.min(edge, width - laid.width - MARGIN_PX)
      : Math.max(edge - laid.width, MARGIN_PX);
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(0, -50%)`;
    // Link names need no line: they stand beside their link.
    line.style.display = isRight ? "" : "none";
    line.setAttribute("x1", x.toFixed(1));
    line.setAttribute("y1", y.toFixed(1));
    line.setAttribute("x2", anchor[0].toFixed(1));
    line.setAttribute("y2", anchor[1].toFixed(1));
  }
}

function widthKey(text: string): string {
  return text.replace(/\d/g, "0");
}

// One below the other, each as near to its spot as there is room.
function spread(side: Laid[], height: number): void {
  side.sort((a, b) => a.y - b.y);
  let least = LINE_PX / 2 + MARGIN_PX;
  for (const each of side) {
    each.y = Math.max(each.y, least);
    least = each.y + LINE_PX;
  }
  let most = height - LINE_PX / 2 - MARGIN_PX;
  for (const each of [...side].reverse()) {
    each.y = Math.min(each.y, most);
    most = each.y - LINE_PX;
  }
}
