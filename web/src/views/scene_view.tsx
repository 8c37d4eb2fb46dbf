import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { selectedLink, useApp, type AppState } from "../app_state";
import { SourceKind } from "../api/gen/taclink/v1/arm_pb";
import type { ArmScene, Scales } from "../scene/arm_scene";
import type { LensPlace } from "../scene/lens";
import { COLOUR_MAPS, gradientOf, type ColourMapName } from "../skin/colour_map";
import { QUANTITIES, type Quantity } from "../skin/fields";
import { PokeCard } from "./poke_card";

const HINT = "Arrow keys turn the view, + and - zoom, Home shows the whole arm.";

/** The arm in 3-D with its legend. */
export function SceneView() {
  const app = useApp();
  const canvas = useRef<HTMLCanvasElement>(null);
  const labels = useRef<HTMLDivElement>(null);
  const scene = useSignal<ArmScene | undefined>(undefined);
  const scales = useSignal<Scales | undefined>(undefined);
  const trouble = useSignal("");
  const lens = useSignal<{ text: string; place: LensPlace } | undefined>(undefined);
  const store = app.store.value;

  useEffect(() => {
    let made: ArmScene | undefined;
    let gone = false;
    // three.js is most of the code: the page is there before it.
    void import("../scene/arm_scene").then(({ ArmScene: Scene }) => {
      if (gone) return;
      try {
        made = new Scene(canvas.current!, labels.current!, store);
      } catch {
        trouble.value = "This browser shows no WebGL: the arm can't be drawn in 3-D. Everything else works.";
        return;
      }
      made.onPick = (link) => (app.link.value = link);
      made.onScales = (now) => (scales.value = now);
      made.onLens = (text, place) => {
        const before = lens.peek();
        if (before?.text === text && before.place.width === place?.width && before.place.y === place.y)
          return;
        lens.value = place && { text, place };
      };
      made.mayPress = (link) => mayPress(app, link);
      made.onPress = (place) => app.poker.press(place);
      made.onDeepen = (byM) => app.poker.deepen(byM);
      made.onLetGo = () => app.poker.letGo();
      scene.value = made;
    });
    return () => {
      gone = true;
      app.poker.letGo();
      scene.value = undefined;
      made?.dispose();
    };
  }, [store]);

  const link = selectedLink(app);
  useEffect(
    () => scene.value?.setColours(app.quantity.value, app.colourMap.value),
    [scene.value, app.quantity.value, app.colourMap.value],
  );
  useEffect(() => scene.value?.setDepthScale(app.depthScale.value), [scene.value, app.depthScale.value]);
  useEffect(() => scene.value?.select(link), [scene.value, link]);

  return (
    <section class="scene" aria-label="The arm in 3-D">
      <div class="canvas-host">
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label={`The arm with its skins and forces. ${HINT}`}
        />
        <div ref={labels} class="labels" aria-hidden="true" />
        {lens.value && <LensFrame {...lens.value} />}
        {trouble.value && <p class="empty">{trouble.value}</p>}
        {!store.arm.value && !trouble.value && <p class="empty">Waiting for the server …</p>}
      </div>
      <Legend scales={scales.value} />
      <PokeCard link={link} />
      <div class="tools" role="group" aria-label="View">
        <button type="button" onClick={() => scene.value?.reset()} title="The whole arm (Home)">
          Whole arm
        </button>
        <button type="button" onClick={() => scene.value?.focus(link)} title={`Look at ${link}`}>
          Focus {link || "link"}
        </button>
        <button
          type="button"
          onClick={() => scene.value?.resetScales()}
          title="Colours and arrows as at the beginning"
        >
          Reset scales
        </button>
      </div>
    </section>
  );
}

function LensFrame({ text, place }: { text: string; place: LensPlace }) {
  const { x, y, width, height } = place;
  return (
    <div
      class="lens"
      style={{ left: `${x}px`, bottom: `${y}px`, width: `${width}px`, height: `${height}px` }}
    >
      <span class="numbers">{text}</span>
    </div>
  );
}

function mayPress(app: AppState, link: string): boolean {
  const arm = app.store.value.arm.peek();
  const kind = arm?.links.find((each) => each.name === link)?.source?.kind;
  return (
    kind === SourceKind.SIMULATED &&
    !app.log.peek() &&
    app.store.value.lookedAtS.peek() === undefined &&
    app.session.mayOperate.peek()
  );
}

function Legend({ scales }: { scales: Scales | undefined }) {
  const app = useApp();
  const { name, unit, range } = QUANTITIES[app.quantity.value];
  const top = scales?.top ?? range;
  return (
    <div class="legend">
      <label>
        <span class="hidden-text">Colour means</span>
        <select
          value={app.quantity.value}
          onChange={(event) => (app.quantity.value = event.currentTarget.value as Quantity)}
        >
          {Object.entries(QUANTITIES).map(([key, info]) => (
            <option value={key}>
              {info.name}, {info.unit}
            </option>
          ))}
        </select>
      </label>
      <div
        class="ramp"
        role="img"
        aria-label={`${name} from 0 to ${top} ${unit}`}
        style={{ background: gradientOf(app.colourMap.value) }}
      />
      <div class="ticks numbers" aria-hidden="true">
        <span>0</span>
        <span>{top / 2}</span>
        <span>
          {top} {unit}
        </span>
      </div>
      <div class="arrow-scale numbers">
        <span class="arrow-sign" aria-hidden="true">
          ⟶
        </span>
        {scales ? `${(scales.arrowM * 100).toFixed(0)} cm arrow = ${scales.arrowN} N` : ""}
      </div>
      <label class="small">
        Dents{" "}
        <select
          value={String(app.depthScale.value)}
          onChange={(event) => (app.depthScale.value = Number(event.currentTarget.value))}
        >
          {[1, 2, 3, 5].map((scale) => (
            <option value={String(scale)}>×{scale}</option>
          ))}
        </select>
      </label>{" "}
      <label class="small">
        Colours{" "}
        <select
          value={app.colourMap.value}
          onChange={(event) => (app.colourMap.value = event.currentTarget.value as ColourMapName)}
        >
          {COLOUR_MAPS.map((map) => (
            <option value={map}>{map}</option>
          ))}
        </select>
      </label>
    </div>
  );
}
