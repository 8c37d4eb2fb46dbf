import * as THREE from "three";

const SIZE = 32;

/** Stripes for skins of which nothing is known. */
export function hatching(): THREE.Texture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext("2d")!;
  context.fillStyle = "#7d858d";
  context.fillRect(0, 0, SIZE, SIZE);
  context.strokeStyle = "#525a62";
  context.lineWidth = SIZE / 3;
  context.beginPath();
  for (const shift of [-SIZE, 0, SIZE]) {
    context.moveTo(shift - 4, SIZE + 4);
    context.lineTo(shift + SIZE + 4, -4);
  }
  context.stroke();
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(16, 12);
  return texture;
}
