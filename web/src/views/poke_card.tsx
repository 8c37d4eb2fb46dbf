import { useSignal } from "@preact/signals";
import { SourceKind } from "../api/gen/taclink/v1/arm_pb";
import { BodyShape } from "../api/gen/taclink/v1/simulation_pb";
import { useApp } from "../app_state";
import { feltOf } from "../model/felt";
import { fixed, newtons } from "../ui/format";

const SHAPES: [BodyShape, string][] = [
  [BodyShape.FINGER, "finger"],
  [BodyShape.DISC, "disc"],
  [BodyShape.PLATE, "plate"],
  [BodyShape.HAND, "hand"],
];

/** Invites to press a simulated skin, and shows what is felt beside what is true. */
export function PokeCard({ link }: { link: string }) {
  const app = useApp();
  const { poker } = app;
  const store = app.store.value;
  store.beat.value;
  const links = (store.arm.value?.links ?? []).filter((each) => each.source?.kind === SourceKind.SIMULATED);
  if (links.length === 0 || app.log.value || !app.session.mayOperate.value) return null;
  return (
    <section class="poke" aria-label="Press a simulated skin">
      <p>
        <strong>Press a skin.</strong> Drag moves the body, the wheel changes its depth.
      </p>
      <div class="row">
        <label>
          <span class="hidden-text">What presses</span>
          <select
            value={String(poker.shape.value)}
            onChange={(event) => (poker.shape.value = Number(event.currentTarget.value))}
          >
            {SHAPES.map(([shape, name]) => (
              <option value={String(shape)}>{name}</option>
            ))}
          </select>
        </label>
        <label>
          <span class="hidden-text">Depth, mm</span>
          <input
            type="range"
            min="1"
            max="20"
            value={String(Math.round(poker.depthM.value * 1e3))}
            onInput={(event) => (poker.depthM.value = Number(event.currentTarget.value) / 1e3)}
          />
        </label>
        <span class="numbers">{(poker.depthM.value * 1e3).toFixed(0)} mm</span>
      </div>
      <div class="row">
        <label>
          <input
            type="checkbox"
            checked={poker.stays.value}
            onChange={(event) => (poker.stays.value = event.currentTarget.checked)}
          />{" "}
          stays
        </label>
        <button type="button" onClick={() => poker.releaseAll()}>
          Let go of all
        </button>
      </div>
      <Place link={links.some((each) => each.name === link) ? link : links[0].name} />
      {links.map((each) => (
        <FeltLine link={each.name} />
      ))}
    </section>
  );
}

// The same without a pointer.
function Place({ link }: { link: string }) {
  const app = useApp();
  const angleDeg = useSignal(0);
  const zMm = useSignal(90);
  const pressed = app.poker.place.value !== undefined;
  const toggle = () => {
    if (pressed) app.poker.letGo();
    else app.poker.press({ link, angleRad: (angleDeg.value * Math.PI) / 180, zM: zMm.value / 1e3 });
  };
  return (
    <details>
      <summary>By numbers</summary>
      <div class="row">
        <label>
          angle{" "}
          <input
            type="number"
            step="5"
            value={String(angleDeg.value)}
            onInput={(event) => (angleDeg.value = Number(event.currentTarget.value))}
          />
          °
        </label>
        <label>
          z{" "}
          <input
            type="number"
            step="5"
            value={String(zMm.value)}
            onInput={(event) => (zMm.value = Number(event.currentTarget.value))}
          />{" "}
          mm
        </label>
        <button type="button" aria-pressed={pressed} onClick={toggle}>
          Press {link}
        </button>
      </div>
    </details>
  );
}

function FeltLine({ link }: { link: string }) {
  const { newest } = useApp().store.value.link(link);
  const felt = feltOf(newest);
  const trouble = newest?.simulation?.trouble;
  if (!felt && !trouble) return null;
  return (
    <p class="felt numbers" data-link={link}>
      {felt && (
        <>
          {link}: <strong>{felt.feltN > 0 ? newtons(felt.feltN) : "nothing felt"}</strong>, true{" "}
          {newtons(felt.trueN)}
          {felt.feltN > 0 && felt.trueN > 0 && `; ${fixed(felt.offM * 1e3, 1)} mm off`}
        </>
      )}
      {trouble && <span class="bad"> {trouble}</span>}
    </p>
  );
}
