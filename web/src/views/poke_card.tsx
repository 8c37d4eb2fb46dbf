import { useSignal } from "@preact/signals";
import { SourceKind, type Link } from "../api/gen/taclink/v1/arm_pb";
import { BodyShape } from "../api/gen/taclink/v1/simulation_pb";
import { useApp } from "../app_state";
import { feltOf } from "../model/felt";
import { fixed, newtons } from "../ui/format";
import { NumberField } from "../ui/number_field";

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
  const isPast = store.lookedAtS.value !== undefined;
  if (links.length === 0 || app.log.value || isPast || !app.session.mayOperate.value) return null;
  const pressed = links.find((each) => each.name === link) ?? links[0];
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
      <Place key={pressed.name} link={pressed} />
      {links.map((each) => (
        <FeltLine link={each.name} />
      ))}
    </section>
  );
}

// The same without a pointer, and what else can be changed in the scene.
function Place({ link }: { link: Link }) {
  const app = useApp();
  const angleDeg = useSignal(0);
  const zMm = useSignal(90);
  const pressed = app.poker.place.value !== undefined;
  const toggle = () => {
    if (pressed) app.poker.letGo();
    else
      app.poker.press({ link: link.name, angleRad: (angleDeg.value * Math.PI) / 180, zM: zMm.value / 1e3 });
  };
  const lengthMm = Math.round((link.model?.lengthM ?? 0.2) * 1e3);
  return (
    <details>
      <summary>By numbers</summary>
      <div class="row">
        <NumberField
          label="angle"
          unit="°"
          value={0}
          min={-360}
          max={360}
          step={5}
          onNumber={(value) => (angleDeg.value = value)}
        />
        <NumberField
          label="z"
          unit="mm"
          value={90}
          min={0}
          max={lengthMm}
          step={5}
          onNumber={(value) => (zMm.value = value)}
        />
        <button type="button" aria-pressed={pressed} onClick={toggle}>
          Press {link.name}
        </button>
      </div>
      <div class="row">
        <NumberField
          label="pressure"
          unit="kPa"
          placeholder="scene"
          min={0}
          max={3}
          step={0.1}
          onNumber={(kpa) => app.poker.setPressure(link.name, kpa * 1e3)}
        />
        <NumberField
          label="joint"
          unit="°"
          placeholder="scene"
          min={-180}
          max={180}
          step={5}
          onNumber={(deg) => app.poker.moveJoint(link.name, (deg * Math.PI) / 180)}
        />
        <button type="button" onClick={() => app.poker.followScene(link.name)}>
          Follow the scene
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
