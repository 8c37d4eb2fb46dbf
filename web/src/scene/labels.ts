import * as THREE from "three";

export interface Label {
  place: THREE.Vector3;
  text: string;
  kind: "link" | "force";
  marked?: boolean;
}

/** Text over the scene, as elements of the page: sharp, and readable by other means than a canvas. */
export class Labels {
  private readonly elements: HTMLElement[] = [];

  constructor(private readonly host: HTMLElement) {}

  dispose(): void {
    for (const element of this.elements) element.remove();
  }

  show(labels: readonly Label[], camera: THREE.Camera, width: number, height: number): void {
    while (this.elements.length < labels.length)
      this.elements.push(this.host.appendChild(document.createElement("span")));
    this.elements.forEach((element, i) => {
      const label = labels[i];
      if (!label) {
        element.hidden = true;
        return;
      }
      const at = label.place.clone().project(camera);
      element.hidden = at.z > 1 || Math.abs(at.x) > 1.1 || Math.abs(at.y) > 1.1;
      element.className = `label ${label.kind}${label.marked ? " marked" : ""}`;
      if (element.textContent !== label.text) element.textContent = label.text;
      const x = ((at.x + 1) / 2) * width;
      const y = ((1 - at.y) / 2) * height;
      element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }
}
