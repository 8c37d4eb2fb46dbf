interface Size {
  width: number;
  height: number;
}

const sizes = new WeakMap<Element, Size>();
const observer = new ResizeObserver((entries) => {
  for (const { target } of entries) sizes.set(target, read(target));
});

function read({ clientWidth: width, clientHeight: height }: Element): Size {
  return { width, height };
}

/** Inner size of an element, CSS pixels, as of the last layout: to ask the element itself makes the browser lay out the page. */
export function sizeOf(element: Element): Size {
  const known = sizes.get(element);
  if (known) return known;
  const size = read(element);
  sizes.set(element, size);
  observer.observe(element);
  return size;
}
