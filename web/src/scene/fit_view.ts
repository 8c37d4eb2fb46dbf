import * as THREE from "three";

const MARGIN = 1.12;

/** Moves the camera along its direction from the box's center to where the box just fits. */
export function fitView(camera: THREE.PerspectiveCamera, box: THREE.Box3): void {
  const center = box.getCenter(new THREE.Vector3());
  const back = camera.position.clone().sub(center).normalize();
  const right = new THREE.Vector3().crossVectors(camera.up, back).normalize();
  const up = new THREE.Vector3().crossVectors(back, right);
  const tan = Math.tan(THREE.MathUtils.degToRad(camera.fov / 2));
  let distance = 0;
  for (let corner = 0; corner < 8; ++corner) {
    const at = (axis: "x" | "y" | "z", bit: number) => (corner & bit ? box.max[axis] : box.min[axis]);
    const p = new THREE.Vector3(at("x", 1), at("y", 2), at("z", 4)).sub(center);
    const high = Math.abs(p.dot(up)) / tan;
    const wide = Math.abs(p.dot(right)) / (tan * camera.aspect);
    distance = Math.max(distance, Math.max(high, wide) + p.dot(back));
  }
  camera.position.copy(center).addScaledVector(back, MARGIN * distance);
}
