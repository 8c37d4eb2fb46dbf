import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { Supervision, type Link } from "../api/gen/taclink/v1/arm_pb";
import type { Camera } from "../api/gen/taclink/v1/camera_pb";
import type { ForceLevelState } from "../api/gen/taclink/v1/events_pb";
import { ForceModel, ForceModelSchema } from "../api/gen/taclink/v1/frame_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { duration, fixed, newtons } from "../ui/format";
import { NumberField } from "../ui/number_field";
import { OperatorButton } from "../ui/operator_button";
import { MODEL_NOTES, MODEL_WORDS } from "../ui/words";
import { AcceptanceForm } from "./acceptance_form";
import { CalibrationDialog } from "./calibration_dialog";
import { PressureForm } from "./pressure_form";
import { TareDialog } from "./tare_dialog";

/** All that can be chosen, the most exact ones first. */
const MODELS = ForceModelSchema.values
  .slice(1)
  .reverse()
  .map(({ number }) => number as ForceModel);

const MOST_FORCE_N = 1000;

/** What can be done to a link. */
export function SettingsView({ link }: { link: Link }) {
  return (
    <div class="settings">
      <Baseline link={link} />
      {link.regulator && <PressureForm link={link.name} last={link.regulator} />}
      <AcceptanceForm link={link} />
      <Model link={link} />
      {link.forceLevels.map((state) => (
        <ThresholdForm key={`${link.name}\n${state.region}`} link={link} state={state} />
      ))}
      <Cameras link={link} />
      <Worker link={link} />
    </div>
  );
}

function Baseline({ link }: { link: Link }) {
  const taring = useSignal(false);
  const calibrating = useSignal(false);
  const baseline = link.baseline;
  return (
    <fieldset>
      <legend>Baseline</legend>
      <p class="small">The shape against which displacements and forces are measured.</p>
      <p class="small numbers">
        {baseline && baseline.origin
          ? `Taken ${duration(Date.now() / 1e3 - Number(baseline.takenUtcNs / 1_000_000n) / 1e3)} ago, drift ${fixed(baseline.driftM * 1e3, 2)} mm.${missing(baseline.missingMarkers.length)}`
          : "There is none yet."}
        {baseline && baseline.calibratedUtcNs > 0n
          ? ` Cameras calibrated ${duration(Date.now() / 1e3 - Number(baseline.calibratedUtcNs / 1_000_000n) / 1e3)} ago.`
          : ""}
      </p>
      <div class="row">
        <OperatorButton onClick={() => (taring.value = true)}>Tare …</OperatorButton>
        <OperatorButton onClick={() => (calibrating.value = true)}>Calibrate …</OperatorButton>
      </div>
      {taring.value && <TareDialog links={[link]} onClose={() => (taring.value = false)} />}
      {calibrating.value && <CalibrationDialog link={link} onClose={() => (calibrating.value = false)} />}
    </fieldset>
  );
}

function Model({ link }: { link: Link }) {
  const app = useApp();
  const frame = app.store.value.link(link.name).newest;
  const chosen = useSignal<ForceModel | undefined>(undefined);
  const now = frame?.forceModel ?? ForceModel.UNSPECIFIED;
  const set = async () => {
    const model = chosen.value ?? now;
    try {
      await app.session.tactile.setForceModel({ link: link.name, model }, { timeoutMs: 30_000 });
      app.tell(`${link.name} computes its forces by the ${MODEL_WORDS[model]} model now.`);
      chosen.value = undefined;
    } catch (error) {
      app.tell(`Force model of ${link.name}: ${messageOf(error)}`, true);
    }
  };
  return (
    <fieldset>
      <legend>Force model</legend>
      <p class="small">{MODEL_NOTES[chosen.value ?? now]}</p>
      <div class="row">
        <label>
          <span class="hidden-text">Model</span>
          <select
            value={chosen.value ?? now}
            onChange={(event) => (chosen.value = Number(event.currentTarget.value) as ForceModel)}
          >
            {MODELS.map((model) => (
              <option value={model}>{MODEL_WORDS[model]}</option>
            ))}
          </select>
        </label>
        <OperatorButton
          onClick={() => void set()}
          disabled={chosen.value === undefined || chosen.value === now}
        >
          Use
        </OperatorButton>
      </div>
    </fieldset>
  );
}

function ThresholdForm({ link, state }: { link: Link; state: ForceLevelState }) {
  const app = useApp();
  const where = state.region || "whole link";
  const submit = async (event: JSX.TargetedSubmitEvent<HTMLFormElement>) => {
    event.preventDefault();
    const data = new FormData(event.currentTarget);
    const value = (name: string) => Number(data.get(name)) || 0;
    const thresholds = {
      warningN: value("warning"),
      alarmN: value("alarm"),
      hysteresisN: value("hysteresis"),
    };
    try {
      await app.session.tactile.setThresholds({ link: link.name, region: state.region, thresholds });
      app.tell(`Thresholds of ${link.name}, ${where}, are set.`);
    } catch (error) {
      app.tell(`Thresholds of ${link.name}: ${messageOf(error)}`, true);
    }
  };
  const field = (name: string, label: string, value: number | undefined) => (
    <NumberField name={name} label={label} unit="N" value={value ?? 0} min={0} max={MOST_FORCE_N} />
  );
  return (
    <fieldset>
      <legend>Thresholds, {where}</legend>
      <form onSubmit={submit} class="row">
        {field("warning", "Warning", state.thresholds?.warningN)}
        {field("alarm", "Alarm", state.thresholds?.alarmN)}
        {field("hysteresis", "Hysteresis", state.thresholds?.hysteresisN)}
        <OperatorButton type="submit" onClick={() => undefined}>
          Set
        </OperatorButton>
      </form>
      <p class="small">
        Now {newtons(state.forceN)}. Above warning or alarm the level rises, and an event tells it; it falls
        once the force is below by the hysteresis. 0 switches a level off. They hold until the server ends.
      </p>
    </fieldset>
  );
}

function Cameras({ link }: { link: Link }) {
  const app = useApp();
  const submit = async (event: JSX.TargetedSubmitEvent<HTMLFormElement>) => {
    event.preventDefault();
    const data = new FormData(event.currentTarget);
    const exposureMs = Number(data.get("exposure"));
    const gain = String(data.get("gain") ?? "").trim();
    const automatic = data.get("automatic") !== null;
    const exposure = automatic
      ? ({ case: "automatic", value: true } as const)
      : exposureMs > 0
        ? ({ case: "exposureS", value: exposureMs / 1e3 } as const)
        : ({ case: undefined } as const);
    try {
      await app.session.tactile.setCamera(
        {
          link: link.name,
          camera: String(data.get("camera")),
          exposure,
          gain: gain ? Number(gain) : undefined,
        },
        { timeoutMs: 10_000 },
      );
      app.tell(`The cameras of ${link.name} are set.`);
    } catch (error) {
      app.tell(`Cameras of ${link.name}: ${messageOf(error)}`, true);
    }
  };
  const exposureS = link.cameras[0]?.exposureS;
  const exposureMs = exposureS === undefined ? undefined : exposureS * 1e3;
  return (
    <fieldset>
      <legend>Cameras</legend>
      <p class="small">
        Markers must be bright and the skin dark, without blur: exposure below 10 ms where the arm moves fast.
        Gain is in the camera's own units.
      </p>
      <form onSubmit={submit} class="row">
        <label>
          <span class="hidden-text">Which</span>
          <select name="camera">
            <option value="">both</option>
            <option value="top">top</option>
            <option value="bottom">bottom</option>
          </select>
        </label>
        <NumberField
          name="exposure"
          label="Exposure"
          unit="ms"
          placeholder={exposureMs === undefined ? "" : exposureMs.toFixed(1)}
          min={0.1}
          max={1000}
        />
        <label>
          <input name="automatic" type="checkbox" /> automatic
        </label>
        <NumberField
          name="gain"
          label="Gain"
          unit=""
          step={1}
          placeholder={link.cameras[0]?.gain === undefined ? "" : String(link.cameras[0].gain)}
        />
        <OperatorButton type="submit" onClick={() => undefined}>
          Set
        </OperatorButton>
      </form>
      <ul class="small numbers plain-list">
        {link.cameras.map((camera) => (
          <li>
            {camera.name}: {exposureOf(camera)}
            {camera.gain !== undefined && `, gain ${camera.gain}`}
          </li>
        ))}
      </ul>
      <p class="small">Empty fields stay as they are. It holds until the server ends.</p>
    </fieldset>
  );
}

function exposureOf(camera: Camera): string {
  if (camera.exposureS !== undefined) return `exposure ${fixed(camera.exposureS * 1e3, 1)} ms`;
  return camera.automaticExposure ? "automatic exposure" : "exposure not known";
}

function Worker({ link }: { link: Link }) {
  const app = useApp();
  const restart = async () => {
    try {
      await app.session.operations.restartLink({ link: link.name });
      app.tell(`${link.name} is started again. Without a calibration file nothing may touch it now.`);
    } catch (error) {
      app.tell(`Restart of ${link.name}: ${messageOf(error)}`, true);
    }
  };
  return (
    <fieldset>
      <legend>Worker</legend>
      <p class="small">The threads that read the cameras and compute the forces of this link.</p>
      <p class="small">
        {link.supervision > Supervision.RUNNING ? link.supervisionReason : "Runs."} Restarted{" "}
        {String(link.statistics?.workerRestarts ?? 0n)} times.
        {link.statistics?.lastFailure && ` Last failure: ${link.statistics.lastFailure}`}
      </p>
      <OperatorButton onClick={() => void restart()}>Restart the link</OperatorButton>
    </fieldset>
  );
}

function missing(markers: number): string {
  if (markers === 0) return "";
  return ` No camera shows ${markers === 1 ? "one marker" : `${markers} markers`}: forces near them are less accurate.`;
}
