import { useSignal } from "@preact/signals";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import type { CalibrationParameter, CalibrationResult } from "../api/gen/taclink/v1/tactile_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { parameterText, shiftText } from "../ui/calibration_text";
import { Dialog } from "../ui/dialog";
import { fixed } from "../ui/format";
import { OperatorButton } from "../ui/operator_button";
import { CameraView } from "./camera_view";
import { Steps, TouchLine } from "./tare_dialog";

/** Guides through a calibration, and shows how good it is. */
export function CalibrationDialog({ link, onClose }: { link: Link; onClose: () => void }) {
  const app = useApp();
  const progress = useSignal<[number, number] | undefined>(undefined);
  const result = useSignal<CalibrationResult | undefined>(undefined);
  const trouble = useSignal("");
  const save = useSignal(false);
  const repeats = useSignal(1);
  const life = useSignal<AbortController | undefined>(undefined);

  const start = async () => {
    const control = (life.value = new AbortController());
    trouble.value = "";
    result.value = undefined;
    progress.value = [0, 8 * repeats.value];
    try {
      const request = { link: link.name, save: save.value, repeats: repeats.value };
      for await (const { message } of app.session.tactile.calibrate(request, { signal: control.signal })) {
        if (message.case === "progress")
          progress.value = [message.value.pairsTaken, message.value.pairsWanted];
        else if (message.case === "result") result.value = message.value;
      }
    } catch (error) {
      if (!control.signal.aborted) trouble.value = messageOf(error);
    }
    progress.value = undefined;
    life.value = undefined;
  };
  const close = () => {
    life.value?.abort();
    onClose();
  };
  const step = result.value ? 3 : progress.value ? 2 : 1;

  return (
    <Dialog title={`Calibrate ${link.name}`} onClose={close}>
      <Steps names={["Free the skin", "Take pictures", "Check the result"]} now={step} />
      {step === 1 && (
        <>
          <p>Finds both cameras and the rest shape again. Nothing may touch the skin until it has ended.</p>
          <TouchLine link={link.name} />
          <CameraView link={link} />
          <label>
            <input
              type="checkbox"
              checked={save.value}
              onChange={(event) => (save.value = event.currentTarget.checked)}
            />{" "}
            also write the link's calibration file
          </label>
          <label>
            Repeat{" "}
            <input
              type="number"
              min={1}
              max={100}
              value={repeats.value}
              onInput={(event) =>
                (repeats.value = Math.min(
                  100,
                  Math.max(1, Math.round(event.currentTarget.valueAsNumber) || 1),
                ))
              }
            />{" "}
            times, to see how far calibrations scatter
          </label>
        </>
      )}
      <div aria-live="polite">
        {progress.value && (
          <p>
            <progress value={progress.value[0]} max={progress.value[1]} aria-label="Rest pairs taken" />{" "}
            {progress.value[0]} of {progress.value[1]} rest pairs
          </p>
        )}
        {trouble.value && (
          <p role="alert" class="refusal">
            {trouble.value}{" "}
            {repeats.value > 1
              ? "The link uses the last calibration that was complete."
              : "The previous calibration stays in use."}
          </p>
        )}
        {result.value && <CalibrationFacts result={result.value} />}
      </div>
      <div class="dialog-foot">
        <OperatorButton onClick={() => void start()} disabled={life.value !== undefined} class="primary">
          {result.value || trouble.value ? "Again" : "Start"}
        </OperatorButton>
        <button type="button" onClick={close}>
          {life.value ? "Cancel" : "Close"}
        </button>
      </div>
    </Dialog>
  );
}

function CalibrationFacts({ result }: { result: CalibrationResult }) {
  const mm = (metres: number) => `${fixed(metres * 1e3, 3)} mm`;
  return (
    <dl class="facts numbers">
      <dt>Markers used</dt>
      <dd>{result.markersUsed}</dd>
      <dt>Reprojection</dt>
      <dd>{fixed(result.rmsPx, 3)} px RMS</dd>
      <dt>Radius, around, along</dt>
      <dd>
        {mm(result.rmseRM)}, {mm(result.rmseTangentialM)}, {mm(result.rmseZM)} RMS
      </dd>
      <dt>File</dt>
      <dd>{result.savedTo || "not written"}</dd>
      {result.endedEarly && (
        <>
          <dt>Ended after {result.repeats}</dt>
          <dd>{result.endedEarly}</dd>
        </>
      )}
      {result.shifts.map((shift) => (
        <>
          <dt>Camera {shift.camera}</dt>
          <dd class={shift.isLarge ? "refusal" : undefined}>{shiftText(shift)}</dd>
        </>
      ))}
      <dt>Parameters</dt>
      <dd>
        <ParameterTable parameters={result.parameters} repeats={result.repeats} />
      </dd>
    </dl>
  );
}

/** Every parameter with the standard deviation of its fit, and its scatter over the repeats. */
function ParameterTable(props: { parameters: readonly CalibrationParameter[]; repeats: number }) {
  const repeated = props.repeats > 1;
  return (
    <div class="scroller">
      <table class="numbers">
        <thead>
          <tr>
            <th>Camera</th>
            <th>Parameter</th>
            <th>Value ± fit</th>
            {repeated && <th>Mean ± scatter of {props.repeats}</th>}
          </tr>
        </thead>
        <tbody>
          {props.parameters.map((one) => (
            <tr>
              <td>{one.camera}</td>
              <td>{one.name.replaceAll("_", " ")}</td>
              <td>{parameterText(one.unit, one.value, one.fitSigma)}</td>
              {repeated && (
                <td>{parameterText(one.unit, one.mean ?? one.value, one.standardDeviation ?? 0)}</td>
              )}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
