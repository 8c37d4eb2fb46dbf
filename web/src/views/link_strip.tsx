import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import { LinkStatus } from "../api/gen/taclink/v1/frame_pb";
import { selectedLink, useApp } from "../app_state";
import { totalMagnitudeN } from "../model/magnitude";
import { colourTable, inkOn } from "../skin/colour_map";
import { isKnown, MarkerFields, QUANTITIES } from "../skin/fields";
import { sameShape } from "../skin/same_shape";
import { outlineFlat } from "../skin/unroll";
import { newtons } from "../ui/format";
import { STATUS_SIGNS, STATUS_WORDS, statusOf } from "../ui/words";
import { FlatPainter } from "./flat_painter";

/** All skins laid flat, small, in the arm's order; a click selects one. */
export function LinkStrip() {
  const store = useApp().store.value;
  const links = (store.arm.value?.links ?? []).filter((link) => link.model?.markers);
  return (
    <ol class="strip" aria-label="All links">
      {links.map((link) => (
        <li key={link.name}>
          <SmallMap link={link} />
        </li>
      ))}
    </ol>
  );
}

function SmallMap({ link }: { link: Link }) {
  const app = useApp();
  const store = app.store.value;
  const beat = store.beat.value;
  const canvas = useRef<HTMLCanvasElement>(null);
  const known = useRef(link.model!);
  if (!sameShape(known.current, link.model!)) known.current = link.model!;
  const fields = useMemo(() => new MarkerFields(known.current), [known.current]);
  const grid = known.current.markers!;
  const { newest, shape } = store.link(link.name);
  const { status } = statusOf(link, newest);
  const selected = selectedLink(app) === link.name;

  // A few times a second is enough for so small a picture.
  const painting = useRef<FlatPainter>();
  useEffect(() => void (painting.current = undefined), [grid.paths, grid.rings]);
  useEffect(() => {
    const painter = (painting.current ??= new FlatPainter(canvas.current!, grid.paths, grid.rings, 2));
    const quantity = app.quantity.value;
    if (!shape || !isKnown(shape, quantity)) return painter.hatch();
    const { range, scale } = QUANTITIES[quantity];
    painter.paint(fields.values(shape, quantity), range * scale, colourTable(app.colourMap.value));
    painter.ink = inkOn(app.colourMap.value);
    for (const contact of shape.contacts) painter.outline(outlineFlat(contact.outlineM, grid));
  }, [beat, fields, app.quantity.value, app.colourMap.value]);

  const force = newest && status !== LinkStatus.LOST ? newtons(totalMagnitudeN(newest)) : "–";
  return (
    <button
      type="button"
      class="small-map"
      aria-pressed={selected}
      title={`${link.name}: ${STATUS_WORDS[status]}`}
      onClick={() => (app.link.value = link.name)}
    >
      <canvas ref={canvas} aria-hidden="true" />
      <span class="caption">
        <span class={`status s${status}`} aria-label={STATUS_WORDS[status]}>
          {STATUS_SIGNS[status]}
        </span>
        <span class="name">{link.name}</span>
        <span class="numbers">{force}</span>
      </span>
    </button>
  );
}
