import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import { useApp } from "../app_state";
import { colourTable, inkOn, roundUp, StickyRange } from "../skin/colour_map";
import { isKnown, MarkerFields, QUANTITIES } from "../skin/fields";
import { sameShape } from "../skin/same_shape";
import { outlineFlat } from "../skin/unroll";
import { fixed } from "../ui/format";
import { statusOf } from "../ui/words";
import { ContactList } from "./contact_list";
import { FlatPainter, type Cell } from "./flat_painter";

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
      if (!frame || !isKnown(frame, quantity)) return painter.hatch();
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
      <MapFrame link={link}>
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label={`${QUANTITIES[app.quantity.value].name} of ${link.name} laid flat. Arrow keys choose a marker.`}
          onPointerMove={move}
          onPointerLeave={() => (cell.value = undefined)}
          onKeyDown={steer}
        />
      </MapFrame>
      <div class="beside-map">
        <Readout link={link} cell={cell.value} fields={fields} top={range.top} />
        <ContactList link={link.name} />
      </div>
    </div>
  );
}

const FULL_TURN_DEG = 360;
const QUARTER_DEG = 90;
const AXES: Record<number, string> = { 0: "+x", 90: "+y", 180: "−x", 270: "−y" };

/** The map in its true proportions, with angles around the axis and millimeters along it. */
function MapFrame({ link, children }: { link: Link; children: ComponentChildren }) {
  const model = link.model!;
  const { paths, firstPathAngleRad, ringZM } = model.markers!;
  const radiusM = Math.max(...model.profileRadiusM);
  const ratio =
    (2 * Math.PI * radiusM) / (ringZM[ringZM.length - 1] - ringZM[0] + model.lengthM / ringZM.length);
  // The middle of path 0 is half a cell from the left.
  const firstDeg = (firstPathAngleRad * 180) / Math.PI - FULL_TURN_DEG / paths / 2;
  const angles = [0, QUARTER_DEG, 2 * QUARTER_DEG, 3 * QUARTER_DEG].map((deg) => ({
    deg,
    left: ((((deg - firstDeg) % FULL_TURN_DEG) + FULL_TURN_DEG) % FULL_TURN_DEG) / FULL_TURN_DEG,
  }));
  const rings = [0, Math.floor((ringZM.length - 1) / 2), ringZM.length - 1];
  return (
    <div class="map-frame" style={{ "--ratio": ratio.toFixed(3) }}>
      <span class="map-end">bottom camera</span>
      <div class="axis-y numbers" aria-hidden="true">
        {rings.map((ring) => (
          <span style={{ bottom: `${((ring + 0.5) / ringZM.length) * 100}%` }}>
            {(ringZM[ring] * 1e3).toFixed(0)} mm
          </span>
        ))}
      </div>
      {children}
      <div class="axis-x numbers" aria-hidden="true">
        {angles.map(({ deg, left }) => (
          <span style={{ left: `${left * 100}%` }}>
            {deg}° {AXES[deg]}
          </span>
        ))}
      </div>
      <span class="map-end low">top camera</span>
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
  const why = statusOf(link, store.link(link.name).newest).reason;
  if (!frame) return <p class="readout">Nothing is measured now. {why}</p>;
  const top = roundUp(props.top);
  if (!isKnown(frame, app.quantity.value)) return <p class="readout">No forces are known now. {why}</p>;
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
