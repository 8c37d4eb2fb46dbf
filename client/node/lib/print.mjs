/** A vector's numbers, aligned. */
export function vector(v, digits) {
  return `(${["x", "y", "z"].map((axis) => (v?.[axis] ?? 0).toFixed(digits).padStart(digits + 3)).join(", ")})`;
}

/** Of an enum's value, for people. */
export function name(enumName, prefix) {
  return enumName.slice(prefix.length).toLowerCase().replaceAll("_", " ");
}
