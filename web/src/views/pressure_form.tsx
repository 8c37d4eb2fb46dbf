import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { RegulatorState, type PressureRegulator } from "../api/gen/taclink/v1/pressure_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { PASCALS_PER_KPA } from "../ui/format";
import { NumberField } from "../ui/number_field";
import { OperatorButton } from "../ui/operator_button";
import { readingText, regulatorText } from "../ui/regulator_text";

const POLL_MS = 500;

/** The pressure regulator of a link. `last`: as the arm was described last. */
export function PressureForm({ link, last }: { link: string; last: PressureRegulator }) {
  const app = useApp();
  const newest = useSignal(last);
  const regulator = newest.value;
  const isTripped = regulator.state === RegulatorState.TRIPPED;

  useEffect(() => {
    const life = new AbortController();
    const look = async () => {
      try {
        const answer = await app.session.pressure.getPressure(
          { link },
          { signal: life.signal, timeoutMs: 3000 },
        );
        if (answer.regulator) newest.value = answer.regulator;
      } catch {
        // The banner says that the server does not answer.
      }
    };
    const again = setInterval(() => void look(), POLL_MS);
    return () => {
      clearInterval(again);
      life.abort();
    };
  }, [link]);

  const order = async (request: Parameters<typeof app.session.pressure.setPressure>[0]) => {
    try {
      const answer = await app.session.pressure.setPressure({ link, ...request }, { timeoutMs: 5000 });
      if (answer.regulator) newest.value = answer.regulator;
    } catch (error) {
      app.tell(`Pressure of ${link}: ${messageOf(error)}`, true);
    }
  };
  const submit = (event: JSX.TargetedSubmitEvent<HTMLFormElement>) => {
    event.preventDefault();
    const kpa = String(new FormData(event.currentTarget).get("kpa") ?? "").trim();
    if (kpa) void order({ goal: { case: "pressurePa", value: Number(kpa) * PASCALS_PER_KPA } });
  };
  return (
    <fieldset>
      <legend>Pressure</legend>
      <p class="small numbers" aria-live="polite">
        Measured {readingText(regulator)}. The regulator is {regulatorText(regulator)}.
      </p>
      {regulator.trip && (
        <p role="alert" class="refusal">
          {regulator.trip.text}
        </p>
      )}
      {regulator.trouble && <p class="small bad">{regulator.trouble}</p>}
      <form onSubmit={submit} class="row">
        <NumberField
          name="kpa"
          label="Setpoint"
          unit="kPa"
          value={(regulator.targetPa ?? 0) / PASCALS_PER_KPA}
          min={regulator.minPa / PASCALS_PER_KPA}
          max={regulator.maxPa / PASCALS_PER_KPA}
          step={0.01}
        />
        <OperatorButton type="submit" disabled={isTripped} onClick={() => undefined}>
          Set
        </OperatorButton>
        <OperatorButton onClick={() => void order({ goal: { case: "vent", value: true } })}>
          Vent
        </OperatorButton>
        {isTripped && (
          <OperatorButton
            onClick={() => void order({ goal: { case: "vent", value: true }, resetTrip: true })}
          >
            Reset
          </OperatorButton>
        )}
      </form>
      <p class="small">
        The setpoint moves by at most {regulator.maxRampPaPerS / PASCALS_PER_KPA} kPa/s. Vent closes the valve
        at once. After a trip remove the cause, then reset; the valve stays closed until a pressure is set.
      </p>
    </fieldset>
  );
}
