import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import {
  QuantityVerdict,
  TrialKind,
  TrialPhase,
  TrialState,
  type Acceptance,
  type AcceptanceTrial,
} from "../api/gen/taclink/v1/acceptance_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import {
  isMeasured,
  quantityText,
  resultText,
  summaryText,
  trialText,
  verdictText,
} from "../ui/acceptance_text";
import { Dialog } from "../ui/dialog";
import { OperatorButton } from "../ui/operator_button";
import { TouchLine } from "./tare_dialog";

const PLANS = {
  quick: "10 g at five places, about five minutes",
  inflated: "50 g at five places, at 1 kPa, about five minutes",
  full: "two loads, slack and inflated, about an hour",
} as const;
type Plan = keyof typeof PLANS;
const SPARE_MS = 30_000;

/** How accurate the link was in its last acceptance, and the way to the next one. */
export function AcceptanceForm({ link }: { link: Link }) {
  const accepting = useSignal(false);
  const summary = link.acceptance;
  return (
    <fieldset>
      <legend>Acceptance</legend>
      <p class="small">Compares the link with known loads: how accurate it is.</p>
      <p class="small numbers">{summary ? summaryText(summary) : "The link was never accepted."}</p>
      {summary?.findings.map((finding) => (
        <p class="small bad">{finding}</p>
      ))}
      <div class="row">
        <OperatorButton onClick={() => (accepting.value = true)}>Accept …</OperatorButton>
        {summary && <ReportButton link={link.name} />}
      </div>
      {accepting.value && <AcceptanceDialog link={link.name} onClose={() => (accepting.value = false)} />}
    </fieldset>
  );
}

/** Opens the report of the last finished acceptance, a page of its own. */
function ReportButton({ link }: { link: string }) {
  const app = useApp();
  const open = async () => {
    try {
      const { acceptance } = await app.session.acceptance.getAcceptance(
        { link, finished: true, withFiles: true },
        { timeoutMs: SPARE_MS },
      );
      const page = URL.createObjectURL(new Blob([acceptance?.reportHtml ?? ""], { type: "text/html" }));
      const anchor = document.createElement("a");
      anchor.href = page;
      anchor.download = `acceptance-${link}.html`;
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(page), 60_000);
    } catch (error) {
      app.tell(`Report of ${link}: ${messageOf(error)}`, true);
    }
  };
  return (
    <button type="button" onClick={() => void open()}>
      Save the report
    </button>
  );
}

function AcceptanceDialog({ link, onClose }: { link: string; onClose: () => void }) {
  const app = useApp();
  const plan = useSignal<Plan>("quick");
  const acceptance = useSignal<Acceptance | undefined>(undefined);
  const busy = useSignal("");
  const trouble = useSignal("");
  // The load of the trial is on and was measured: what is left of it comes next.
  const loaded = useSignal<AcceptanceTrial | undefined>(undefined);
  // A second click throws away what was measured.
  const discarding = useSignal(false);
  const calls = app.session.acceptance;

  const end = async (what: string, discard: boolean) => {
    const ended = await ask(what, () => calls.finishAcceptance({ link, discard }, { timeoutMs: SPARE_MS }));
    if (!ended) return;
    loaded.value = undefined;
    discarding.value = false;
    if (discard) acceptance.value = undefined;
  };
  const ask = async (what: string, call: () => Promise<{ acceptance?: Acceptance }>) => {
    busy.value = what;
    trouble.value = "";
    try {
      acceptance.value = (await call()).acceptance;
      return true;
    } catch (error) {
      trouble.value = messageOf(error);
      return false;
    } finally {
      busy.value = "";
    }
  };
  // One that is under way is gone on with.
  useEffect(() => {
    void (async () => {
      try {
        const { acceptance: known } = await calls.getAcceptance({ link }, { timeoutMs: SPARE_MS });
        if (known?.finishedUtcNs === 0n) acceptance.value = known;
      } catch {
        // There is none.
      }
    })();
  }, [link]);

  const now = acceptance.value;
  const next = now?.trials.find((trial) => trial.id === now.nextTrial);
  const before = now?.trials.filter((trial) => trial.state === TrialState.MEASURED).at(-1);
  const measuredCount = now?.trials.filter((trial) => trial.state === TrialState.MEASURED).length ?? 0;
  const isOver = now !== undefined && now.finishedUtcNs !== 0n;

  const measure = async (trial: AcceptanceTrial, phase: TrialPhase, reference: number | undefined) => {
    const held = phase === TrialPhase.LOADED ? trial.holdS : 0;
    const isPressure = trial.kind === TrialKind.PRESSURE;
    const request = {
      link,
      trial: trial.id,
      phase,
      reference:
        reference === undefined ? {} : isPressure ? { pressurePa: 1e3 * reference } : { forceN: reference },
    };
    const measured = await ask(held > 0 ? `Measuring for ${held} s …` : "Measuring …", () =>
      calls.measureTrial(request, { timeoutMs: SPARE_MS + 2000 * Math.max(1, held) }),
    );
    if (measured) loaded.value = phase === TrialPhase.LOADED && !isPressure ? trial : undefined;
  };

  return (
    <Dialog title={`Accept ${link}`} onClose={onClose}>
      {!now && (
        <PlanChoice
          plan={plan.value}
          onPlan={(chosen) => (plan.value = chosen)}
          onStart={() =>
            void ask("Starting …", () =>
              calls.startAcceptance({ link, plan: plan.value }, { timeoutMs: SPARE_MS }),
            )
          }
        />
      )}
      {now && !isOver && loaded.value && (
        <>
          <p>Take the load off.</p>
          <TouchLine link={link} />
          <div class="row">
            <OperatorButton
              class="primary"
              disabled={busy.value !== ""}
              onClick={() => void measure(loaded.value!, TrialPhase.RELEASED, undefined)}
            >
              It is off
            </OperatorButton>
          </div>
        </>
      )}
      {now && !isOver && !loaded.value && next && (
        <TrialStep
          key={next.id}
          text={trialText(next, before)}
          count={`${next.id} of ${now.trials.length}`}
          link={link}
          isPressure={next.kind === TrialKind.PRESSURE}
          disabled={busy.value !== ""}
          onMeasure={(reference) => void measure(next, TrialPhase.LOADED, reference)}
          onSkip={() =>
            void ask("", () => calls.skipTrial({ link, trial: next.id }, { timeoutMs: SPARE_MS }))
          }
        />
      )}
      <div aria-live="polite">
        {busy.value && <p>{busy.value}</p>}
        {trouble.value && (
          <p role="alert" class="refusal">
            {trouble.value}
          </p>
        )}
        {before && !isOver && (
          <p class="numbers">
            Trial {before.id}: {resultText(before)}
          </p>
        )}
      </div>
      {isOver && now && <Result acceptance={now} />}
      <div class="dialog-foot">
        {now && !isOver && (
          <>
            <OperatorButton
              disabled={busy.value !== ""}
              onClick={() => (discarding.value ? void end("", true) : (discarding.value = true))}
            >
              {discarding.value ? `Really discard ${measuredCount} measured trials` : "Discard"}
            </OperatorButton>
            <OperatorButton
              disabled={busy.value !== "" || !before || loaded.value !== undefined}
              onClick={() =>
                void ask("", () =>
                  calls.skipTrial({ link, trial: before!.id, reopen: true }, { timeoutMs: SPARE_MS }),
                )
              }
            >
              Repeat the last
            </OperatorButton>
            <OperatorButton
              disabled={busy.value !== "" || !before}
              class={next ? undefined : "primary"}
              onClick={() => void end("Finishing …", false)}
            >
              Finish
            </OperatorButton>
          </>
        )}
        <button type="button" onClick={onClose}>
          Close
        </button>
      </div>
    </Dialog>
  );
}

function PlanChoice(props: { plan: Plan; onPlan: (plan: Plan) => void; onStart: () => void }) {
  return (
    <>
      <p>
        Known loads are put on the skin and taken off again. Each reading is kept on the server: an
        interrupted acceptance can be resumed.
      </p>
      {(Object.keys(PLANS) as Plan[]).map((name) => (
        <label class="row">
          <input type="radio" name="plan" checked={props.plan === name} onChange={() => props.onPlan(name)} />
          {name}: {PLANS[name]}
        </label>
      ))}
      <div class="row">
        <OperatorButton class="primary" onClick={props.onStart}>
          Start
        </OperatorButton>
      </div>
    </>
  );
}

function TrialStep(props: {
  text: string;
  count: string;
  link: string;
  isPressure: boolean;
  disabled: boolean;
  onMeasure: (reference: number | undefined) => void;
  onSkip: () => void;
}) {
  const reference = useSignal<number | undefined>(undefined);
  return (
    <>
      <p>
        <strong>{props.count}.</strong> {props.text}
      </p>
      <TouchLine link={props.link} />
      <label>
        {props.isPressure ? "Manometer" : "True force"}{" "}
        <input
          type="number"
          min={0}
          step="any"
          placeholder="as planned"
          onInput={(event) => {
            const value = event.currentTarget.valueAsNumber;
            reference.value = Number.isFinite(value) && value >= 0 ? value : undefined;
          }}
        />{" "}
        {props.isPressure ? "kPa" : "N"}
      </label>
      <div class="row">
        <OperatorButton
          class="primary"
          disabled={props.disabled}
          onClick={() => props.onMeasure(reference.value)}
        >
          Measure
        </OperatorButton>
        <OperatorButton disabled={props.disabled} onClick={props.onSkip}>
          Skip
        </OperatorButton>
      </div>
    </>
  );
}

function Result({ acceptance }: { acceptance: Acceptance }) {
  const quantities = (acceptance.report?.quantities ?? []).filter(isMeasured);
  return (
    <>
      <p>
        <strong>{verdictText(acceptance)}</strong>
      </p>
      {acceptance.report?.findings.map((finding) => (
        <p class="refusal">{finding.text}</p>
      ))}
      <ul class="small numbers">
        {quantities.map((quantity) => (
          <li class={quantity.verdict === QuantityVerdict.FAILED ? "bad" : ""}>
            {quantity.label}: {quantityText(quantity)}
          </li>
        ))}
      </ul>
      <ReportButton link={acceptance.link} />
    </>
  );
}
