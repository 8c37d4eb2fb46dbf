import { useSignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import type { MarkerRange } from "../api/gen/taclink/v1/events_pb";
import { useApp } from "../app_state";
import { colourTable, inkOn, roundUp, StickyRange } from "../skin/colour_map";
import { isKnown, MarkerFields, QUANTITIES } from "../skin/fields";
import { sameShape } from "../skin/same_shape";
import { outlineFlat, paintFlat } from "../skin/unroll";
import { fixed } from "../ui/format";
import { ContactList } from "./contact_list";

const FINE = 6; // pixels of the picture a cell, before the browser scales it

interface Cell {
  path: number;
  ring: number;
}

/** The selected skin laid flat: path across, ring up. */
export function UnrolledMap({ link }: { link: Link }) {
  const app = useApp();
  const store = app.store.value;
  const canvas = useRef<HTMLCanvasElement>(null);
  const cell = useSignal<Cell | undefined>(undefined);
  const model = link.model!;
  const grid = model.markers!;
  const known = useRef(model);
  if (!sameShape(known.current, model)) known.current = model;
  const fields = useMemo(() => new MarkerFields(known.current), [known.current]);
  const range = useMemo(
    () => new StickyRange(QUANTITIES[app.quantity.value].range),
    [app.quantity.value, link.name],
  );

  useEffect(() => {
    let waiting = 0;
    const painter = new FlatPainter(canvas.current!, grid.paths, grid.rings);
    const draw = () => {
      waiting = 0;
      const frame = store.link(link.name).shape;
      const quantity = app.quantity.value;
      const { scale } = QUANTITIES[quantity];
      if (!frame || !isKnown(frame, quantity)) return painter.clear();
      const values = fields.values(frame, quantity);
      range.include(Math.max(...values) / scale);
      painter.paint(values, range.top * scale, colourTable(app.colourMap.value));
      painter.ink = inkOn(app.colourMap.value);
      for (const contact of frame.contacts) painter.outline(outlineFlat(contact.outlineM, grid));
      const now = store.arm.peek()?.links.find((each) => each.name === link.name);
      painter.regions(now?.forceLevels.flatMap((level) => (level.markers ? [level.markers] : [])) ?? []);
      painter.mark(cell.value);
    };
    const request = () => {
      if (waiting === 0) waiting = requestAnimationFrame(draw);
    };
    request();
    const end = store.onChange((changed) => changed === link.name && request());
    const size = new ResizeObserver(request);
    size.observe(canvas.current!);
    return () => {
      end();
      size.disconnect();
      cancelAnimationFrame(waiting);
    };
  }, [store, link.name, fields, range, app.quantity.value, app.colourMap.value, cell.value]);

  const move = (event: PointerEvent) => {
    const box = canvas.current!.getBoundingClientRect();
    const path = Math.floor(((event.clientX - box.left) / box.width) * grid.paths);
    const ring = Math.floor((1 - (event.clientY - box.top) / box.height) * grid.rings);
    const inside = path >= 0 && path < grid.paths && ring >= 0 && ring < grid.rings;
    if (inside) cell.value = { path, ring };
  };
  const steer = (event: KeyboardEvent) => {
    const steps: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, 1],
      ArrowDown: [0, -1],
    };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    const at = cell.value ?? { path: 0, ring: 0 };
    cell.value = {
      path: (at.path + step[0] + grid.paths) % grid.paths,
      ring: Math.min(grid.rings - 1, Math.max(0, at.ring + step[1])),
    };
  };

  return (
    <div class="map">
      <div class="map-frame">
        <span class="axis-y">ring (1 at the top camera's side)</span>
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label={`${QUANTITIES[app.quantity.value].name} of ${link.name} laid flat. Arrow keys choose a marker.`}
          onPointerMove={move}
          onPointerLeave={() => (cell.value = undefined)}
          onKeyDown={steer}
        />
        <span class="axis-x">path (around the axis)</span>
      </div>
      <Readout link={link} cell={cell.value} fields={fields} top={range.top} />
      <ContactList link={link.name} />
    </div>
  );
}

function Readout(props: { link: Link; cell: Cell | undefined; fields: MarkerFields; top: number }) {
  const app = useApp();
  const store = app.store.value;
  store.beat.value;
  const { link, cell, fields } = props;
  const info = QUANTITIES[app.quantity.value];
  const frame = store.link(link.name).shape;
  if (!frame) return <p class="readout empty">Nothing is measured now: see the link's status.</p>;
  const top = roundUp(props.top);
  if (!isKnown(frame, app.quantity.value))
    return <p class="readout empty">No forces are known now: see the link's status.</p>;
  if (!cell)
    return (
      <p class="readout numbers">
        0 to {top} {info.unit}. Lines: contacts. Point at a marker, or use the arrow keys.
      </p>
    );
  const marker = cell.ring * link.model!.markers!.paths + cell.path;
  const pressure = isKnown(frame, "pressure") ? fields.values(frame, "pressure")[marker] / 1e3 : undefined;
  const move = fields.values(frame, "displacement")[marker] * 1e3;
  const force = frame.nodalForcesN.slice(3 * marker, 3 * marker + 3);
  const sigma = frame.nodalForceSigmasN[marker];
  return (
    <p class="readout numbers" aria-live="polite">
      path {cell.path + 1}, ring {cell.ring + 1}: {pressure === undefined ? "–" : `${fixed(pressure, 1)} kPa`}
      , {fixed(move, 2)} mm, {force.length === 3 ? `${fixed(Math.hypot(...force), 3)} N` : "–"}
      {sigma > 0 ? ` ± ${fixed(sigma, 3)} N` : ""}
    </p>
  );
}

/** Draws on the canvas of the map. */
class FlatPainter {
  ink = "#ffffff";
  private readonly picture: ImageData;
  private readonly buffer = document.createElement("canvas");

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly paths: number,
    private readonly rings: number,
  ) {
    this.buffer.width = paths * FINE;
    this.buffer.height = rings * FINE;
    this.picture = new ImageData(this.buffer.width, this.buffer.height);
  }

  private get context(): CanvasRenderingContext2D {
    return this.canvas.getContext("2d")!;
  }

  clear(): void {
    this.fit();
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  private fit(): void {
    const width = Math.round(this.canvas.clientWidth * devicePixelRatio);
    const height = Math.round(this.canvas.clientHeight * devicePixelRatio);
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }

  paint(values: ArrayLike<number>, range: number, table: Uint8Array): void {
    this.fit();
    const { width, height } = this.buffer;
    paintFlat(
      this.picture.data,
      width,
      height,
      values,
      { paths: this.paths, rings: this.rings },
      table,
      range,
    );
    this.buffer.getContext("2d")!.putImageData(this.picture, 0, 0);
    this.context.imageSmoothingEnabled = true;
    this.context.drawImage(this.buffer, 0, 0, this.canvas.width, this.canvas.height);
  }

  private x(path: number): number {
    return (path / this.paths) * this.canvas.width;
  }
  private y(ring: number): number {
    return (1 - ring / this.rings) * this.canvas.height;
  }

  // A second and a third time a turn away: what crosses the seam is on both sides of it.
  outline(corners: readonly [path: number, ring: number][]): void {
    const { context } = this;
    context.beginPath();
    for (const turn of [-this.paths, 0, this.paths]) {
      for (const [i, [path, ring]] of corners.entries()) {
        if (i === 0) context.moveTo(this.x(path + turn), this.y(ring));
        else context.lineTo(this.x(path + turn), this.y(ring));
      }
      context.closePath();
    }
    context.strokeStyle = this.ink;
    context.lineWidth = 2 * devicePixelRatio;
    context.stroke();
  }

  regions(regions: readonly MarkerRange[]): void {
    const { context } = this;
    context.strokeStyle = this.ink;
    context.lineWidth = devicePixelRatio;
    context.setLineDash([6, 4]);
    for (const { firstRing, lastRing, firstPath, lastPath } of regions) {
      const parts =
        firstPath <= lastPath
          ? [[firstPath, lastPath]]
          : [
              [firstPath, this.paths - 1],
              [0, lastPath],
            ];
      for (const [from, to] of parts) {
        const top = this.y(lastRing + 1);
        context.strokeRect(this.x(from), top, this.x(to + 1) - this.x(from), this.y(firstRing) - top);
      }
    }
    context.setLineDash([]);
  }

  mark(cell: Cell | undefined): void {
    if (!cell) return;
    const { context } = this;
    context.strokeStyle = "#ff6a13";
    context.lineWidth = 2 * devicePixelRatio;
    const top = this.y(cell.ring + 1);
    context.strokeRect(this.x(cell.path), top, this.x(1), this.y(cell.ring) - top);
  }
}
